"""Shared parts of the drivers of inertial units: a sample in base_link's axes, and its standard deviations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config

Sigma = Annotated[float, Field(gt=0.0, le=10.0)]
Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]


@dataclass(frozen=True, slots=True)
class Sample:
    """In base_link's axes, at the unit's place: m/s2 with gravity, rad/s. stamp_s: by this computer's clock."""

    stamp_s: float
    orientation_xyzw: tuple[float, float, float, float]
    acceleration_mps2: tuple[float, float, float]
    rotation_radps: tuple[float, float, float]


class ImuParams(Config):
    """rpy_deg: the unit in base_link, turned about its fixed axes x, y, z. sigmas: standard deviations."""

    rpy_deg: tuple[Degrees, Degrees, Degrees]
    acceleration_sigma_mps2: Sigma
    rotation_sigma_radps: Sigma
    attitude_sigma_rad: Sigma
    heading_sigma_rad: Sigma
