"""Converts camera buffers to grey images with their time of exposure.

Sources: Linux kernel, Userspace API, Video for Linux: "Buffers" (timestamps on CLOCK_MONOTONIC), "Image Formats" (MJPG,
GREY, YUYV); ITU-T T.81 B.1.1.3 (markers).
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.drivers.counters import Counters
from robot_stack.drivers.thinning import Thinning
from robot_stack.drivers.v4l2.params import PixelFormat, V4l2CameraDriverParams

_START, _END = b"\xff\xd8", b"\xff\xd9"


class BadFrame(ValueError):
    """The buffer holds no complete image. The message gives the reason."""


@dataclass(frozen=True, slots=True)
class Picture:
    """pixels: (height, width) uint8, its own memory. time_s: on the monotonic clock, of the middle of the exposure."""

    pixels: NDArray[np.uint8]
    time_s: float


def decode(data: NDArray[np.uint8], pixel_format: PixelFormat, height: int, width: int) -> NDArray[np.uint8]:
    """(height, width) brightness of the bytes of a buffer. Raises BadFrame.

    A JPEG may be followed by padding; one without its end has lost a part, which a decoder would fill with grey.
    """
    if pixel_format is PixelFormat.GREY:
        return _raw(data, height * width).reshape(height, width).copy()
    if pixel_format is PixelFormat.YUYV:
        return _raw(data, 2 * height * width)[::2].reshape(height, width).copy()
    pixels = _jpeg(data)
    if pixels.shape != (height, width):
        raise BadFrame(f"is {pixels.shape[1]}x{pixels.shape[0]}, the calibration is for {width}x{height}")
    return pixels


def _raw(data: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
    if data.size != size:
        raise BadFrame(f"has {data.size} bytes instead of {size}")
    return data.reshape(-1)


def _jpeg(data: NDArray[np.uint8]) -> NDArray[np.uint8]:
    content = data.tobytes().rstrip(b"\0")
    if not content.startswith(_START):
        raise BadFrame("is no JPEG")
    if not content.endswith(_END):
        raise BadFrame("is cut off")
    pixels = None
    with contextlib.suppress(cv2.error):  # a size in the header beyond the decoder's limits
        pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    if pixels is None:
        raise BadFrame("cannot be decoded")
    return np.asarray(pixels, np.uint8)


class FrameChooser:
    """Selects the frames of a camera that become images, and counts the others. Times are monotonic, in s."""

    def __init__(self, params: V4l2CameraDriverParams, height: int, width: int) -> None:
        self._params, self._height, self._width = params, height, width
        self._period_s = 1.0 / params.frame_rate_hz
        self.counters = Counters("lost frames", "corrupt frames")
        self.problem = ""
        self._last_s = -math.inf
        self._thinning = Thinning(params.frames_per_image * self._period_s, 0.5 * self._period_s)

    def wants(self, stamp_s: float, now_s: float) -> bool:
        """Called for every frame, before it is decoded. stamp_s: the buffer's timestamp."""
        if not -self._params.tolerance_s <= now_s - stamp_s <= self._params.tolerance_s:
            self.problem = f"its timestamps are {stamp_s - now_s:+.3f} s off the monotonic clock"
            self.counters.add("refused timestamps")
            return False
        if stamp_s <= self._last_s:
            self.counters.add("frames out of order")
            return False
        if self._last_s > -math.inf:
            self.counters.add("lost frames", max(0, round((stamp_s - self._last_s) / self._period_s) - 1))
        self._last_s = stamp_s
        return self._thinning.wants(stamp_s)

    def picture(self, data: NDArray[np.uint8], stamp_s: float) -> Picture | None:
        """None for a buffer without an image, which is counted."""
        try:
            pixels = decode(data, self._params.pixel_format, self._height, self._width)
        except BadFrame as error:
            self.problem = f"a frame {error}"
            self.counters.add("corrupt frames")
            return None
        self.problem = ""
        return Picture(pixels, stamp_s + self._params.middle_s)

    def begin_anew(self) -> None:
        """The device was reopened: frames in between do not count as lost."""
        self.problem = ""
        self._last_s = -math.inf
        self._thinning.restart()
