"""Numbers of the simulated LiDAR, ``config/sim_lidar.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, load

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Beams(Config):
    """How the sensor looks round: ``columns`` firings a turn, each of ``rings`` beams at once, clockwise from above."""

    rings: Annotated[int, Field(ge=2, le=256)]
    columns: Annotated[int, Field(ge=8, le=8192)]
    lowest_deg: Annotated[float, Field(ge=-89.0, le=89.0)]
    highest_deg: Annotated[float, Field(ge=-89.0, le=89.0)]
    start_azimuth_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    period_s: Positive

    @model_validator(mode="after")
    def _makes_sense(self) -> Beams:
        if self.highest_deg <= self.lowest_deg:
            raise ValueError("highest_deg must be above lowest_deg")
        if self.columns % 2:
            raise ValueError("columns must be even: a sweep has two halves")
        return self


class Ranging(Config):
    """Range and how true it is."""

    min_m: Positive
    max_m: Positive
    noise_m: NotNegative
    # A square target of 10 % reflectivity is seen half of the time at this range.
    range_at_ten_percent_m: Positive
    lost_share: Share
    mixed_share: Share
    # Neighbouring beams that far apart make an edge; surfaces farther apart than the reach are told apart.
    mixed_step_m: Positive
    mixed_reach_m: Positive
    intensity_noise: NotNegative


class Mounting(Config):
    """How far the true mounting may be from the nominal one: what a good calibration leaves."""

    position_m: NotNegative
    rotation_rad: NotNegative


class Wet(Config):
    """Ground that counts as wet, and what it does."""

    friction_below: NotNegative
    reflectivity: Share
    lost_share: Share
    mirror_share: Share
    mirror_reflectivity: Share


class Reflectivity(Config):
    """Share of light that a surface throws back, by kind of thing."""

    ground: Share
    ramp: Share
    kerb: Share
    wall: Share
    box: Share
    cylinder: Share
    station: Share
    person: Share
    chair: Share


class Cover(Config):
    """What the sensor says of a lens that is covered: so many beams come back from so near, the rest not at all."""

    return_share: Share
    nearest_m: NotNegative
    farthest_m: Positive


class LidarParams(Config):
    """``config/sim_lidar.yaml``."""

    beams: Beams
    ranging: Ranging
    mounting: Mounting
    wet: Wet
    cover: Cover
    reflectivity: Reflectivity

    def with_columns(self, columns: int) -> LidarParams:
        """The same sensor with another number of columns. Raises ValidationError."""
        return LidarParams.model_validate(
            {**self.model_dump(), "beams": {**self.beams.model_dump(), "columns": columns}}
        )


def load_lidar_params() -> LidarParams:
    """Raises ConfigError."""
    return load(LidarParams, "sim_lidar")
