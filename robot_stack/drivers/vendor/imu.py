"""Checks the samples of another vendor's inertial unit, and converts them to base_link's axes.

Sources: sensor_msgs/msg/Imu (a covariance of -1: no such measurement); REP 103 (units, z up), REP 145 (at rest the
acceleration is 9.8 m/s2 upwards).
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from robot_stack.drivers.counters import Counters
from robot_stack.drivers.imu import ImuParams, Sample
from robot_stack.drivers.vendor.topic import MessageRefused, VendorTopicParams

NOT_FINITE, FROZEN, IMPLAUSIBLE = "samples not finite", "samples frozen", "samples implausible"
_QUATERNION_TOLERANCE = 0.01
_GRAVITY_MPS2 = (8.5, 11.0)  # of the mean; 1 for a unit that measures in g
_UPRIGHT = math.cos(math.radians(45.0))  # of the mean in base_link: a wrong rpy_deg is off by more
_AGREES = math.cos(math.radians(20.0))  # of mean and orientation, while the robot accelerates


class ImuAdapterParams(VendorTopicParams, ImuParams):
    """frame_id: that the driver writes; samples in another frame are refused.

    acceleration_max_mps2, rotation_max_radps: magnitudes above are refused. mean_s: time constant of the mean
    acceleration, by which unit and axes are checked.
    """

    frame_id: Annotated[str, Field(min_length=1)]
    acceleration_max_mps2: Annotated[float, Field(ge=20.0, le=200.0)]
    rotation_max_radps: Annotated[float, Field(ge=1.0, le=35.0)]
    mean_s: Annotated[float, Field(ge=0.2, le=10.0)]


class ImuAdapter:
    """Keeps the mean acceleration, and the sample before."""

    def __init__(self, params: ImuAdapterParams) -> None:
        self._params = params
        self._mounted = Rotation.from_euler("xyz", params.rpy_deg, degrees=True)
        self._mean: NDArray[np.float64] | None = None
        self._stamp_s = -math.inf
        self._before: tuple[float, ...] = ()
        self.counters = Counters(NOT_FINITE, FROZEN, IMPLAUSIBLE)

    def convert(
        self,
        frame_id: str,
        orientation: tuple[float, ...],
        measured: tuple[float, ...],
        covariances: tuple[float, float, float],
        stamp_s: float,
    ) -> Sample:
        """orientation: x, y, z, w. measured: acceleration x, y, z, m/s2, rotation x, y, z, rad/s, in the unit's axes.

        covariances: the first of orientation, acceleration and rotation. Raises MessageRefused.
        """
        if frame_id != self._params.frame_id:
            raise MessageRefused(f"frame_id is {frame_id!r}, expected {self._params.frame_id!r}")
        if any(value < 0.0 for value in covariances):
            raise MessageRefused(
                "a covariance is -1, so a value is not measured: orientation, acceleration and rotation are all needed"
            )
        if not all(map(math.isfinite, (*orientation, *measured))):
            self._refuse(NOT_FINITE, "a value is not finite")
        if measured == self._before:
            # The noise of a working sensor never repeats all six numbers.
            self._refuse(FROZEN, "all six values are those of the sample before: the unit is frozen")
        self._before = measured
        acceleration, rotation = np.array(measured[:3]), np.array(measured[3:])
        self._check_magnitudes(orientation, acceleration, rotation)
        turned = Rotation.from_quat(orientation) * self._mounted.inv()
        acceleration, rotation = self._mounted.apply(acceleration), self._mounted.apply(rotation)
        self._check_axes(turned.inv().apply((0.0, 0.0, 1.0)), acceleration, stamp_s)
        return Sample(stamp_s, _tuple(turned.as_quat(canonical=True)), _tuple(acceleration), _tuple(rotation))

    def _check_magnitudes(self, orientation: tuple[float, ...], acceleration: Any, rotation: Any) -> None:
        norm, force, rate = (float(np.linalg.norm(item)) for item in (orientation, acceleration, rotation))
        if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
            self._refuse(IMPLAUSIBLE, f"the orientation is no unit quaternion, its norm is {norm:.3f}")
        if force > self._params.acceleration_max_mps2:
            limit = self._params.acceleration_max_mps2
            self._refuse(IMPLAUSIBLE, f"the acceleration is {force:.4g} m/s2, expected at most {limit:g}")
        if rate > self._params.rotation_max_radps:
            limit = self._params.rotation_max_radps
            self._refuse(
                IMPLAUSIBLE, f"the rotation is {rate:.4g} rad/s, expected at most {limit:g}: are these degrees?"
            )

    def _check_axes(self, up: NDArray[np.float64], acceleration: NDArray[np.float64], stamp_s: float) -> None:
        """up: (3,) by the orientation, in base_link, as the acceleration."""
        if self._mean is None:
            self._mean = acceleration
        else:
            share = 1.0 - math.exp(-max(0.0, stamp_s - self._stamp_s) / self._params.mean_s)
            self._mean = self._mean + share * (acceleration - self._mean)
        self._stamp_s = stamp_s
        size = float(np.linalg.norm(self._mean))
        if not _GRAVITY_MPS2[0] <= size <= _GRAVITY_MPS2[1]:
            self._refuse(IMPLAUSIBLE, f"the mean acceleration is {size:.4g} m/s2, expected about 9.8: another unit?")
        if self._mean[2] < _UPRIGHT * size:
            seen = ", ".join(f"{value:.1f}" for value in self._mean)
            self._refuse(
                IMPLAUSIBLE, f"the mean acceleration is ({seen}) m/s2 in base_link, expected upwards: see rpy_deg"
            )
        if float(up @ self._mean) < _AGREES * size:
            self._refuse(IMPLAUSIBLE, "orientation and acceleration differ on where up is, expected ENU or NWU")

    def _refuse(self, name: str, why: str) -> None:
        self.counters.add(name)
        raise MessageRefused(why)


def _tuple(values: NDArray[np.float64]) -> Any:
    return tuple(values.tolist())
