"""Node camera_adapter: front and rear camera by their vendors' own ROS drivers."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import Image

from robot_stack.contract import topics
from robot_stack.drivers.nodes.camera_output import CameraOutput, publish_mountings
from robot_stack.drivers.nodes.vendor_input import VendorInput
from robot_stack.drivers.vendor.image import CameraAdapterParams, CameraTopicParams, Picture, grey
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wire import ImageView

_ROWS = {"front": topics.VENDOR_FRONT_IMAGE, "rear": topics.VENDOR_REAR_IMAGE}


class CameraAdapterNode(StackNode, bulk=True):
    def __init__(self) -> None:
        super().__init__("camera_adapter", CameraAdapterParams)
        given = {name: getattr(self.params, name) for name in _ROWS}
        self._cameras = {name: _Camera(self, name, params) for name, params in given.items() if params is not None}
        publish_mountings(self, self._cameras)
        self.set_health(False, "waiting for the cameras")
        self.every(1.0 / min(camera.params.silence_s for camera in self._cameras.values()), self._watch)

    def _watch(self) -> None:
        """Reports silence and refusals; old images are never repeated."""
        problems = [camera.input.problem() for camera in self._cameras.values()]
        self.set_health(not any(problems), "; ".join(filter(None, problems)) or "images arrive")
        for name, camera in self._cameras.items():
            self.report.values |= {f"{name} {key}": value for key, value in camera.input.values().items()}


class _Camera:
    """One camera: its input, and its two topics."""

    def __init__(self, node: StackNode, name: str, params: CameraTopicParams) -> None:
        self.params = params
        self._output = CameraOutput(node, name)
        self.input = VendorInput(node, _ROWS[name], params, topics.FRONT_IMAGE.nominal_rate_hz, self._publish)

    def _publish(self, message: Image | ImageView, stamp_s: float) -> None:
        picture = Picture(
            message.header.frame_id,
            message.height,
            message.width,
            message.encoding,
            bool(message.is_bigendian),
            message.step,
            np.frombuffer(message.data, np.uint8),
        )
        pixels = grey(picture, self.params, self._output.height, self._output.width)
        self._output.publish(pixels, time_from_s(stamp_s + self.params.exposure_middle_s))
