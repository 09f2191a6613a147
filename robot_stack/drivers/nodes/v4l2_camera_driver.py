"""Node v4l2_camera_driver: front and rear camera by Video4Linux."""

from __future__ import annotations

import math
import time
from array import array
from functools import partial

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Image

from robot_stack.contract import frames, topics
from robot_stack.contract.model import Topic
from robot_stack.core.camera import camera_file, load_intrinsics
from robot_stack.core.camera import mounting as camera_mounting
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.drivers.nodes.v4l2_device import V4l2Device
from robot_stack.drivers.v4l2.frames import FrameChooser, Picture
from robot_stack.drivers.v4l2.params import V4l2CameraDriverParams
from robot_stack.middleware.conversions import camera_info, time_from_s
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode, run
from tf2_msgs.msg import TFMessage

_ROWS: dict[str, tuple[str, Topic, Topic]] = {
    "front": (frames.FRONT_CAMERA, topics.FRONT_IMAGE, topics.FRONT_CAMERA_INFO),
    "rear": (frames.REAR_CAMERA, topics.REAR_IMAGE, topics.REAR_CAMERA_INFO),
}


class V4l2CameraDriverNode(StackNode):
    """Frames are read and decoded in a separate thread per camera; the node wakes once an image."""

    def __init__(self) -> None:
        super().__init__("v4l2_camera_driver", V4l2CameraDriverParams)
        self._tf = self.advertise(topics.TF_STATIC)
        devices = self.params.devices
        given = {name: getattr(devices, name) for name in _ROWS if getattr(devices, name)}
        self._tf.publish(TFMessage(transforms=[self._mounting(_ROWS[name][0]) for name in given]))
        self._cameras = {name: _Camera(self, name, device) for name, device in given.items()}
        self.set_health(False, "waiting for the cameras")
        self.every(1.0 / self.params.silence_s, self._watch)

    def _mounting(self, frame: str) -> TransformStamped:
        pose = camera_mounting(self.robot, frame)
        x, y, z = (float(value) for value in pose[:3, 3])
        return mounting(frame, (x, y, z), pose[:3, :3], self.stamp())

    def _watch(self) -> None:
        """Reports silence; old images are never repeated."""
        now_s = self.steady_s()
        problems = [camera.problem(now_s) for camera in self._cameras.values()]
        self.set_health(not any(problems), "; ".join(filter(None, problems)) or "images arrive")
        for camera in self._cameras.values():
            self.report.values |= camera.values()

    def destroy_node(self) -> None:
        for camera in self._cameras.values():
            camera.close()
        super().destroy_node()


class _Camera:
    """One camera: its thread, and its two topics."""

    def __init__(self, node: V4l2CameraDriverNode, name: str, device: str) -> None:
        self._node, self._name = node, name
        frame, image_row, info_row = _ROWS[name]
        calibrated = load_intrinsics(camera_file(frame))
        size = calibrated.width, calibrated.height
        self._image = Image(height=size[1], width=size[0], encoding="mono8", step=size[0])
        self._info = camera_info(calibrated)
        self._image.header.frame_id = self._info.header.frame_id = frame
        self._images, self._infos = node.advertise(image_row), node.advertise(info_row)
        self._published_s = -math.inf
        self._chooser = FrameChooser(node.params, size[1], size[0])
        self._device = V4l2Device(device, size, node.params, self._chooser.begin_anew, self._wants, self._on_frame)
        self._thread = DeviceThread(self._device, node.params.reopen_s)

    def problem(self, now_s: float) -> str:
        """Why no images arrive; empty while they do."""
        if now_s - self._published_s <= self._node.params.silence_s:
            return ""
        return f"no images of the {self._name} camera: {self._chooser.problem or self._thread.state}"

    def values(self) -> dict[str, str]:
        """For /diagnostics."""
        values = {"device": self._thread.state, "exposure": self._device.exposure, **self._chooser.counters.values()}
        return {f"{self._name} {key}": value for key, value in values.items()}

    def close(self) -> None:
        self._thread.close()

    def _wants(self, stamp_s: float) -> bool:
        return self._chooser.wants(stamp_s, time.monotonic())

    def _on_frame(self, data: NDArray[np.uint8], stamp_s: float) -> None:
        picture = self._chooser.picture(data, stamp_s)
        if picture is not None:
            self._node.call_soon(partial(self._publish, picture))

    def _publish(self, picture: Picture) -> None:
        # The difference of the monotonic and the system clock at this moment.
        stamp = time_from_s(self._node.now_s() - (time.monotonic() - picture.time_s))
        self._image.header.stamp = self._info.header.stamp = stamp
        self._image.data = array("B", picture.pixels.tobytes())
        self._images.publish(self._image)
        self._infos.publish(self._info)
        self._published_s = self._node.steady_s()


def main() -> None:
    run(V4l2CameraDriverNode, bulk=True)
