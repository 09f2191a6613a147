"""The thread that owns a V4L2 camera: it opens, configures, reads, and reopens it after a disconnection."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable

os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")  # s; 10 by default, in which nothing can be ended

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.drivers.v4l2.params import V4l2CameraDriverParams

_MANUAL = 1  # V4L2_EXPOSURE_MANUAL
_EXPOSURE_UNIT_S = 1e-4  # of V4L2_CID_EXPOSURE_ABSOLUTE
_FAILURES = 3  # consecutive, each after a second of silence or at once: the device is reopened


class CameraReader:
    """Starts at once; ``close`` ends it. Callbacks come from its thread.

    wants: called with each frame's timestamp (monotonic, s); only frames for which it returns True are copied.
    on_frame: (bytes, timestamp). on_opened: before the first frame. ``state`` describes the device's state,
    ``exposure`` the camera's response to the exposure setting.
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
        self._device, self._params = device, params
        self._width, self._height = size
        self._on_opened, self._wants, self._on_frame = on_opened, wants, on_frame
        self.state = f"{device} is not open yet"
        self.exposure = "unknown"
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera_reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Safe to call twice. A pending read takes up to a second."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.is_set():
            if not os.path.exists(self._device):
                self.state = f"{self._device} is not there"
            else:
                self._use()
            self._closing.wait(self._params.reopen_s)

    def _use(self) -> None:
        capture = cv2.VideoCapture(self._device, cv2.CAP_V4L2)
        try:
            if not capture.isOpened():
                self.state = f"{self._device} cannot be opened as a V4L2 camera"
                return
            problem = self._set(capture)
            if problem:
                self.state = f"{self._device} {problem}"
                return
            self._on_opened()
            self.state = f"{self._device} is open"
            self._read(capture)
        finally:
            capture.release()

    def _set(self, capture: cv2.VideoCapture) -> str:
        """Settings that the camera does not apply; empty if it applies all."""
        code = cv2.VideoWriter.fourcc(*self._params.pixel_format)
        capture.set(cv2.CAP_PROP_FOURCC, code)
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._height)
        capture.set(cv2.CAP_PROP_FPS, self._params.frame_rate_hz)
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
        size = round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if int(capture.get(cv2.CAP_PROP_FOURCC)) != code:
            return f"does not send {self._params.pixel_format}"
        if size != (self._width, self._height):
            return f"sends {size[0]}x{size[1]}, the calibration is for {self._width}x{self._height}"
        rate_hz = capture.get(cv2.CAP_PROP_FPS)
        if abs(rate_hz - self._params.frame_rate_hz) > 0.02 * self._params.frame_rate_hz:
            return f"sends {rate_hz:g} frames a second instead of {self._params.frame_rate_hz:g}"
        self._expose(capture)
        return ""

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

    def _read(self, capture: cv2.VideoCapture) -> None:
        """Reads until the device is lost or silent, or closed by us."""
        failures = 0
        while not self._closing.is_set():
            if not capture.grab():
                failures += 1
                if failures >= _FAILURES or not os.path.exists(self._device):
                    self.state = f"{self._device} sends no frames"
                    return
                time.sleep(0.01)
                continue
            failures = 0
            stamp_s = 1e-3 * capture.get(cv2.CAP_PROP_POS_MSEC)
            if self._wants(stamp_s):
                taken, data = capture.retrieve()
                if taken:
                    self._on_frame(np.asarray(data, np.uint8), stamp_s)
