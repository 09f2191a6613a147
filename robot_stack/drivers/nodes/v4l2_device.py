"""A V4L2 camera: configures it and reads its frames."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")  # s; 10 by default, in which nothing can be ended

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.drivers.v4l2.params import V4l2CameraDriverParams
from robot_stack.middleware.device_thread import DeviceLost, DeviceThread

_MANUAL = 1  # V4L2_EXPOSURE_MANUAL
_EXPOSURE_UNIT_S = 1e-4  # of V4L2_CID_EXPOSURE_ABSOLUTE
_FAILURES = 3  # consecutive, each after a second of silence or at once: the device is reopened


class V4l2Device:
    """Callbacks come from the device's thread. A pending read delays its end by up to a second.

    wants: called with each frame's timestamp (monotonic, s); only frames for which it returns True are copied.
    on_frame: (bytes, timestamp). on_opened: before the first frame. ``exposure`` describes the camera's response to the
    exposure setting.
    """

    def __init__(
        self,
        device: str,
        size: tuple[int, int],
        params: V4l2CameraDriverParams,
        on_opened: Callable[[], None],
        wants: Callable[[float], bool],
        on_frame: Callable[[NDArray[np.uint8], float], None],
    ) -> None:
        self.where, self._params = device, params
        self._width, self._height = size
        self._on_opened, self._wants, self._on_frame = on_opened, wants, on_frame
        self.exposure = "unknown"

    def use(self, thread: DeviceThread) -> None:
        if not os.path.exists(self.where):
            raise DeviceLost("is not there")
        capture = cv2.VideoCapture(self.where, cv2.CAP_V4L2)
        try:
            if not capture.isOpened():
                raise DeviceLost("cannot be opened as a V4L2 camera")
            self._set(capture)
            self._on_opened()
            thread.report_open()
            self._read(capture, thread)
        finally:
            capture.release()

    def _set(self, capture: cv2.VideoCapture) -> None:
        """Raises DeviceLost if the camera does not apply the settings."""
        code = cv2.VideoWriter.fourcc(*self._params.pixel_format)
        capture.set(cv2.CAP_PROP_FOURCC, code)
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._height)
        capture.set(cv2.CAP_PROP_FPS, self._params.frame_rate_hz)
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
        size = round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if int(capture.get(cv2.CAP_PROP_FOURCC)) != code:
            raise DeviceLost(f"does not send {self._params.pixel_format}")
        if size != (self._width, self._height):
            raise DeviceLost(f"sends {size[0]}x{size[1]}, the calibration is for {self._width}x{self._height}")
        rate_hz = capture.get(cv2.CAP_PROP_FPS)
        if abs(rate_hz - self._params.frame_rate_hz) > 0.02 * self._params.frame_rate_hz:
            raise DeviceLost(f"sends {rate_hz:g} frames a second instead of {self._params.frame_rate_hz:g}")
        self._expose(capture)

    def _expose(self, capture: cv2.VideoCapture) -> None:
        """A camera that rejects the exposure is still used: its images are blurred and their time is less exact."""
        asked = max(1, round(self._params.exposure_s / _EXPOSURE_UNIT_S))
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL)
        capture.set(cv2.CAP_PROP_EXPOSURE, asked)
        capture.set(cv2.CAP_PROP_GAIN, self._params.gain)
        taken = capture.get(cv2.CAP_PROP_EXPOSURE)
        fixed = int(capture.get(cv2.CAP_PROP_AUTO_EXPOSURE)) == _MANUAL and abs(taken - asked) <= 0.1 * asked
        asked_ms = 1e3 * self._params.exposure_s
        self.exposure = f"{asked_ms:g} ms" if fixed else f"the camera's own, instead of {asked_ms:g} ms"

    def _read(self, capture: cv2.VideoCapture, thread: DeviceThread) -> None:
        failures = 0
        while thread.running:
            if not capture.grab():
                failures += 1
                if failures >= _FAILURES or not os.path.exists(self.where):
                    raise DeviceLost("sends no frames")
                time.sleep(0.01)
                continue
            failures = 0
            stamp_s = 1e-3 * capture.get(cv2.CAP_PROP_POS_MSEC)
            if self._wants(stamp_s):
                taken, data = capture.retrieve()
                if taken:
                    self._on_frame(np.asarray(data, np.uint8), stamp_s)
