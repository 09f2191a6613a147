"""Parameters of the node v4l2_camera_driver: ``config/v4l2_camera_driver.yaml``."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.contract import topics
from robot_stack.core.config import Config


class PixelFormat(StrEnum):
    """Pixel format of the buffers, by its V4L2 name."""

    MJPG = "MJPG"
    GREY = "GREY"
    YUYV = "YUYV"


class StampAt(StrEnum):
    """Reference of a buffer's timestamp (V4L2_BUF_FLAG_TSTAMP_SRC_SOE and _EOF)."""

    START_OF_EXPOSURE = "start_of_exposure"
    END_OF_FRAME = "end_of_frame"


class Devices(Config):
    """Device files; a relative name lies in the runtime folder; empty where there is no such camera."""

    front: str
    rear: str


class V4l2CameraDriverParams(Config):
    """frame_rate_hz: the camera's, a whole multiple of the topic's rate; the frames between are left out.

    exposure_s, gain: fixed. readout_s: from the first row's exposure to the last row's. tolerance_s: largest age of a
    buffer's timestamp, also into the future; beyond it the camera's clock is rejected. silence_s: timeout of
    images. reopen_s: retry period for a lost device.
    """

    devices: Devices
    pixel_format: PixelFormat
    frame_rate_hz: Annotated[float, Field(ge=10.0, le=120.0)]
    exposure_s: Annotated[float, Field(ge=0.0001, le=0.033)]
    gain: Annotated[int, Field(ge=0)]
    readout_s: Annotated[float, Field(ge=0.0, le=0.05)]
    stamp_at: StampAt
    tolerance_s: Annotated[float, Field(gt=0.0, le=1.0)]
    silence_s: Annotated[float, Field(gt=0.0, le=5.0)]
    reopen_s: Annotated[float, Field(gt=0.0, le=10.0)]

    @property
    def frames_per_image(self) -> int:
        return round(self.frame_rate_hz / topics.FRONT_IMAGE.nominal_rate_hz)

    @property
    def middle_s(self) -> float:
        """Time from a buffer's timestamp to the middle of the exposure of the middle row."""
        half_s = 0.5 * (self.readout_s + self.exposure_s)
        return half_s if self.stamp_at is StampAt.START_OF_EXPOSURE else -half_s

    @model_validator(mode="after")
    def _fits(self) -> V4l2CameraDriverParams:
        rate_hz = topics.FRONT_IMAGE.nominal_rate_hz
        if abs(self.frame_rate_hz - self.frames_per_image * rate_hz) > 1e-6:
            raise ValueError(f"frame_rate_hz: {self.frame_rate_hz:g} is no whole multiple of {rate_hz:g}")
        if self.exposure_s > 1.0 / self.frame_rate_hz:
            raise ValueError("exposure_s: longer than a frame")
        if not self.devices.front and not self.devices.rear:
            raise ValueError("devices: names no camera")
        if self.devices.front == self.devices.rear:
            raise ValueError("devices: front and rear are the same")
        return self
