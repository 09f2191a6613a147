"""Node v4l2_camera_driver: front and rear camera by Video4Linux."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.nodes.camera_output import CameraOutput, publish_mountings
from robot_stack.drivers.nodes.v4l2_device import V4l2Device
from robot_stack.drivers.v4l2.frames import FrameChooser, Picture
from robot_stack.drivers.v4l2.params import V4l2CameraDriverParams
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode

_NAMES = ("front", "rear")


class V4l2CameraDriverNode(StackNode, bulk=True):
    """Frames are read and decoded in a separate thread per camera; the node wakes once an image."""

    def __init__(self) -> None:
        super().__init__("v4l2_camera_driver", V4l2CameraDriverParams)
        devices = self.params.devices
        # An absolute path replaces the runtime folder.
        given = {name: str(runtime_dir() / file) for name in _NAMES if (file := getattr(devices, name))}
        publish_mountings(self, given)
        self._cameras = {name: _Camera(self, name, device) for name, device in given.items()}
        self.set_health(False, "waiting for the cameras")
        self.every(1.0 / self.params.silence_s, self._watch)

    def _watch(self) -> None:
        """Reports silence; old images are never repeated."""
        now_s = self.steady_s()
        problems = [camera.problem(now_s) for camera in self._cameras.values()]
        self.set_health(not any(problems), "; ".join(filter(None, problems)) or "images arrive")
        for camera in self._cameras.values():
            self.report.values |= camera.values()


class _Camera:
    """One camera: its thread, and its two topics."""

    def __init__(self, node: V4l2CameraDriverNode, name: str, device: str) -> None:
        self._node, self._name = node, name
        self._output = CameraOutput(node, name)
        size = self._output.width, self._output.height
        self._chooser = FrameChooser(node.params, size[1], size[0])
        self._device = V4l2Device(device, size, node.params, self._chooser.begin_anew, self._wants, self._on_frame)
        self._thread = DeviceThread(self._device, node.params.reopen_s)
        node.at_end.callback(self._thread.close)

    def problem(self, now_s: float) -> str:
        """Why no images arrive; empty while they do."""
        if now_s - self._output.published_s <= self._node.params.silence_s:
            return ""
        return f"no images of the {self._name} camera: {self._thread.problem(self._chooser.problem)}"

    def values(self) -> dict[str, str]:
        """For /diagnostics."""
        values = {"device": self._thread.state, "exposure": self._device.exposure, **self._chooser.counters.values()}
        return {f"{self._name} {key}": value for key, value in values.items()}

    def _wants(self, stamp_s: float) -> bool:
        return self._chooser.wants(stamp_s, self._node.device_s())

    def _on_frame(self, data: NDArray[np.uint8], stamp_s: float) -> None:
        picture = self._chooser.picture(data, stamp_s)
        if picture is not None:
            self._node.call_soon(partial(self._publish, picture))

    def _publish(self, picture: Picture) -> None:
        # The difference of the kernel's and the system clock at this moment.
        stamp = time_from_s(self._node.now_s() - (self._node.device_s() - picture.time_s))
        self._output.publish(picture.pixels, stamp)
