"""Grey images from the encodings of other vendors' cameras (sensor_msgs/image_encodings.hpp)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from robot_stack.core.config import Config
from robot_stack.drivers.vendor.topic import MessageRefused, VendorTopicParams


class _Layout(NamedTuple):
    """bytes: of a pixel. to_grey: OpenCV's conversion code, None without colour."""

    bytes: int
    to_grey: int | None


_ENCODINGS = {
    "mono8": _Layout(1, None),
    "8UC1": _Layout(1, None),
    "mono16": _Layout(2, None),
    "bgr8": _Layout(3, cv2.COLOR_BGR2GRAY),
    "8UC3": _Layout(3, cv2.COLOR_BGR2GRAY),  # any order; blue first is OpenCV's
    "rgb8": _Layout(3, cv2.COLOR_RGB2GRAY),
    "bgra8": _Layout(4, cv2.COLOR_BGRA2GRAY),
    "rgba8": _Layout(4, cv2.COLOR_RGBA2GRAY),
}


class CameraTopicParams(VendorTopicParams):
    """frame_id: that the driver writes; images in another frame are refused. mono16_bits: significant ones of mono16.

    exposure_middle_s: from the driver's stamp to the middle of the exposure of the middle row.
    """

    frame_id: Annotated[str, Field(min_length=1)]
    mono16_bits: Annotated[int, Field(ge=8, le=16)]
    exposure_middle_s: Annotated[float, Field(ge=-0.1, le=0.1)]


class CameraAdapterParams(Config):
    """The cameras; null where there is no such camera."""

    front: CameraTopicParams | None
    rear: CameraTopicParams | None

    @model_validator(mode="after")
    def _fits(self) -> CameraAdapterParams:
        topics = [camera.topic for camera in (self.front, self.rear) if camera is not None]
        if not topics:
            raise ValueError("front, rear: name no camera")
        if len(topics) > len(set(topics)):
            raise ValueError("topic: front and rear are the same")
        return self


@dataclass(frozen=True, slots=True)
class Picture:
    """The fields of an image message. data: (n,) uint8."""

    frame_id: str
    height: int
    width: int
    encoding: str
    is_bigendian: bool
    step: int
    data: NDArray[np.uint8]


def grey(picture: Picture, params: CameraTopicParams, height: int, width: int) -> NDArray[np.uint8]:
    """(height, width) brightness; the size is that of the calibration. Raises MessageRefused."""
    if picture.frame_id != params.frame_id:
        raise MessageRefused(f"frame_id is {picture.frame_id!r}, expected {params.frame_id!r}")
    layout = _ENCODINGS.get(picture.encoding)
    if layout is None:
        raise MessageRefused(f"encoding is {picture.encoding!r}, expected one of {', '.join(_ENCODINGS)}")
    if (picture.width, picture.height) != (width, height):
        size = f"{picture.width}x{picture.height}"
        raise MessageRefused(f"the image is {size}, its calibration in config/cameras is for {width}x{height}")
    row = layout.bytes * width
    if picture.step < row:
        raise MessageRefused(f"step is {picture.step}, expected at least {width} pixels of {layout.bytes} bytes")
    if picture.data.size != picture.step * height:
        raise MessageRefused(f"has {picture.data.size} bytes of data, expected {height} rows of {picture.step}")
    pixels = picture.data.reshape(height, picture.step)[:, :row]
    if layout.to_grey is not None:
        return np.asarray(cv2.cvtColor(pixels.reshape(height, width, layout.bytes), layout.to_grey), np.uint8)
    if layout.bytes == 1:
        return pixels
    deep = np.ascontiguousarray(pixels).view(">u2" if picture.is_bigendian else "<u2")
    bright: NDArray[np.uint8] = np.minimum(deep >> (params.mono16_bits - 8), 255).astype(np.uint8)
    return bright
