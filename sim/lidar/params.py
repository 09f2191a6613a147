"""Numbers of the simulated LiDARs: ``config/robot.yaml`` and, by sensor, ``config/sim_lidar.yaml`` and its like."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.contract import frames
from robot_stack.core.config import Config, Fraction, NotNegative, Positive, load
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.core.robot import load_robot

_FULL_TURN_DEG = 360.0


class Beams(Config):
    """Scan pattern: ``columns`` firings per turn, each of ``rings`` simultaneous beams, clockwise from above."""

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


class RangingModel(Config):
    """Systematic errors of a range."""

    # A square target of 10 % reflectivity is seen half of the time at this range.
    range_at_ten_percent_m: Positive
    lost_share: Fraction
    mixed_share: Fraction
    # Neighbouring beams this far apart make an edge; surfaces farther apart than the reach are resolved.
    mixed_step_m: Positive
    mixed_reach_m: Positive
    intensity_noise: NotNegative


class Ranging(RangingModel):
    """Range and its errors."""

    min_m: Positive
    max_m: Positive
    noise_m: NotNegative
    # Of a ring, at most; drawn by the sensor's seed.
    range_bias_m: NotNegative
    elevation_bias_deg: NotNegative


class Mounting(Config):
    """Largest deviation of the true mounting from the nominal one: the residual of a good calibration."""

    position_m: NotNegative
    rotation_rad: NotNegative


class Wet(Config):
    """Wet ground and its effects."""

    friction_below: NotNegative
    reflectivity: Fraction
    lost_share: Fraction
    mirror_share: Fraction
    mirror_reflectivity: Fraction


class Reflectivity(Config):
    """Share of light that a surface reflects, by kind of object."""

    ground: Fraction
    ramp: Fraction
    kerb: Fraction
    wall: Fraction
    box: Fraction
    cylinder: Fraction
    station: Fraction
    person: Fraction
    chair: Fraction


class Cover(Config):
    """Returns of a covered lens: a share of the beams returns from a short range, the rest not at all."""

    return_share: Fraction
    nearest_m: NotNegative
    farthest_m: Positive


class Air(Config):
    """Response of the sensor to airborne particles, see ``weather``."""

    # The beam is a cone: width where it leaves, and what it gains per distance.
    beam_width_mm: Positive
    beam_divergence_mrad: Positive
    # Least signal, as in ``returns``, at which a particle is detected.
    least_signal: Positive
    seen_share: Fraction
    rain_reflectivity: Annotated[float, Field(gt=0.0, le=1.0)]
    snow_reflectivity: Annotated[float, Field(gt=0.0, le=1.0)]
    # Diameter of a flake in diameters of the drop that it melts to.
    flake_size_factor: Annotated[float, Field(ge=1.0)]
    dust_lidar_ratio_sr: Positive
    dust_share_per_m: NotNegative
    pulse_m: Positive
    wet_surface_factor: Annotated[float, Field(gt=0.0, le=1.0)]
    wet_ground_factor: Annotated[float, Field(gt=0.0, le=1.0)]


class Glass(Config):
    """Panes, see ``glass``. dirt: share of the light reflected by dirt on a pane."""

    refractive_index: Annotated[float, Field(ge=1.0, le=3.0)]
    dirt: Annotated[float, Field(gt=0.0, le=1.0)]
    glint_deg: Annotated[float, Field(ge=0.0, le=90.0)]


class Glare(Config):
    """Effect of the sun on beams near its direction, see ``sun``: at its centre; zero from ``reach_deg`` on."""

    reach_deg: Annotated[float, Field(gt=0.0, le=90.0)]
    false_per_m: NotNegative
    lost_share: Fraction


class LidarParams(Config):
    """``config/sim_lidar.yaml``."""

    beams: Beams
    ranging: Ranging
    mounting: Mounting
    wet: Wet
    cover: Cover
    air: Air
    glare: Glare
    glass: Glass
    reflectivity: Reflectivity

    def with_columns(self, columns: int) -> LidarParams:
        """The same sensor with another number of columns. Raises ValidationError."""
        return LidarParams.model_validate(
            {**self.model_dump(), "beams": {**self.beams.model_dump(), "columns": columns}}
        )


class SensorModel(Config):
    """``config/sim_lidar.yaml`` and its like: values missing in a data sheet; geometry and ranges are in robot.yaml."""

    ranging: RangingModel
    mounting: Mounting
    wet: Wet
    cover: Cover
    air: Air
    glare: Glare
    glass: Glass
    reflectivity: Reflectivity


def load_lidar_params(sensor: str = frames.LIDAR) -> LidarParams:
    """A range sensor of ``config/robot.yaml`` as the simulation measures with it. Raises ConfigError, KeyError."""
    return lidar_params(load_robot().range_sensors[sensor], load(SensorModel, f"sim_{sensor}"))


def lidar_params(sensor: RangeSensor, model: SensorModel) -> LidarParams:
    """Raises ValidationError for a sensor that does not cover a full turn."""
    beams = {name: getattr(sensor, name) for name in ("rings", "columns", "lowest_deg", "highest_deg", "period_s")}
    beams["start_azimuth_deg"] = sensor.first_azimuth_deg
    if sensor.span_deg != _FULL_TURN_DEG:
        raise ValueError(f"span_deg must be {_FULL_TURN_DEG:g}: the simulated sensor turns")
    true = ("min_m", "max_m", "noise_m", "range_bias_m", "elevation_bias_deg")
    ranging = {**{name: getattr(sensor, name) for name in true}, **model.ranging.model_dump()}
    own = model.model_dump(exclude={"ranging"})
    return LidarParams.model_validate({"beams": beams, "ranging": ranging, **own})
