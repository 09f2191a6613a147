"""Images of a camera with its intrinsics on the contract's topics, and the cameras' places on /tf_static."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Image

from robot_stack.contract import frames, topics
from robot_stack.contract.model import Topic
from robot_stack.core.camera import camera_file, load_intrinsics
from robot_stack.core.camera import mounting as camera_mounting
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.middleware.conversions import camera_info
from robot_stack.middleware.node import StackNode
from tf2_msgs.msg import TFMessage

_ROWS: dict[str, tuple[str, Topic, Topic]] = {
    "front": (frames.FRONT_CAMERA, topics.FRONT_IMAGE, topics.FRONT_CAMERA_INFO),
    "rear": (frames.REAR_CAMERA, topics.REAR_IMAGE, topics.REAR_CAMERA_INFO),
}


class CameraOutput:
    """name: front or rear. height, width: those of its calibration in ``config/cameras``."""

    def __init__(self, node: StackNode, name: str) -> None:
        self._node = node
        frame, image_row, info_row = _ROWS[name]
        calibrated = load_intrinsics(camera_file(frame))
        self.height, self.width = calibrated.height, calibrated.width
        self._image = Image(height=self.height, width=self.width, encoding="mono8", step=self.width)
        self._info = camera_info(calibrated)
        self._image.header.frame_id = self._info.header.frame_id = frame
        self._images, self._infos = node.advertise(image_row), node.advertise(info_row)
        self.published_s = -math.inf

    def publish(self, pixels: NDArray[np.uint8], stamp: Time) -> None:
        """pixels: (height, width) brightness. stamp: the middle of the exposure of the middle row."""
        self._image.header.stamp = self._info.header.stamp = stamp
        self._image.data = array("B", pixels.tobytes())
        self._images.publish(self._image)
        self._infos.publish(self._info)
        self.published_s = self._node.steady_s()


def publish_mountings(node: StackNode, names: Iterable[str]) -> None:
    tf = node.advertise(topics.TF_STATIC)
    tf.publish(TFMessage(transforms=[camera_transform(node, _ROWS[name][0]) for name in names]))


def camera_transform(node: StackNode, frame: str) -> TransformStamped:
    """The nominal mounting."""
    pose = camera_mounting(node.robot, frame)
    x, y, z = (float(value) for value in pose[:3, 3])
    return mounting(frame, (x, y, z), pose[:3, :3], node.stamp())
