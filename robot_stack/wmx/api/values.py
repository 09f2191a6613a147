"""Command values of the engine, by the vendor's names.

Positions are in user units (rad for the robot), velocities per second, accelerations per second squared, times in
milliseconds. They are plain mutable records, as in the vendor's library: a caller fills the fields it needs. Nothing is
checked here; the engine checks its arguments and returns a code.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from robot_stack.wmx.api.enums import ProfileType

MAX_AXES = 128
MAX_IO_BYTES = 8000
MAX_DEVICES = 256
MAX_SPLINE_DIMENSIONS = 6
"""The vendor's header of 2021 has 6, a later manual 8; 6 works with either."""
MAX_SPLINE_CHANNELS = 128
INFINITE = 0xFFFFFFFF
"""Wait without a limit, where a call takes milliseconds. The vendor's Python module does not export it."""


@dataclass(slots=True)
class Profile:
    """How a motion reaches its velocity and stops.

    Trapezoidal uses ``acc`` and ``dec``; TimeAccTrapezoidal uses the two times: to its velocity, and from that to rest,
    which is also the rate at which it slows down to its velocity. The simulated engine rejects starting and end
    velocities other than zero.
    """

    type: int = ProfileType.Trapezoidal
    velocity: float = 0.0
    acc: float = 0.0
    dec: float = 0.0
    accTimeMilliseconds: float = 0.0
    decTimeMilliseconds: float = 0.0
    startingVelocity: float = 0.0
    endVelocity: float = 0.0

    @staticmethod
    def SetupTrapezoidal(
        velocity: float, acc: float, dec: float, startingVelocity: float = 0.0, endVelocity: float = 0.0
    ) -> Profile:
        """Constant acceleration and deceleration."""
        return Profile(ProfileType.Trapezoidal, velocity, acc, dec, 0.0, 0.0, startingVelocity, endVelocity)

    @staticmethod
    def SetupTimeAccTrapezoidal(
        velocity: float,
        accTimeMilliseconds: float,
        decTimeMilliseconds: float,
        startingVelocity: float = 0.0,
        endVelocity: float = 0.0,
    ) -> Profile:
        """Acceleration and deceleration by the time that they take."""
        return Profile(
            ProfileType.TimeAccTrapezoidal,
            velocity,
            0.0,
            0.0,
            accTimeMilliseconds,
            decTimeMilliseconds,
            startingVelocity,
            endVelocity,
        )


@dataclass(slots=True)
class AxisSelection:
    """The axes of a call: the first ``axisCount`` entries of a list that grows as it is written."""

    axisCount: int = 0
    axis: list[int] = field(default_factory=list)

    def SetAxis(self, index: int, value: int) -> None:
        """Entry ``index`` names axis ``value``. Raises IndexError beyond the largest number of axes."""
        if not 0 <= index < MAX_AXES:
            raise IndexError(f"index must be in 0..{MAX_AXES - 1}, is {index}")
        self.axis.extend([0] * (index + 1 - len(self.axis)))
        self.axis[index] = value

    def GetAxis(self, index: int) -> int:
        """The axis of entry ``index``; an entry never written is axis 0, as with the vendor's fixed array."""
        if not 0 <= index < MAX_AXES:
            raise IndexError(f"index must be in 0..{MAX_AXES - 1}, is {index}")
        return self.axis[index] if index < len(self.axis) else 0

    @classmethod
    def of(cls, *axes: int) -> AxisSelection:
        """A selection of the given axes (not in the vendor's library)."""
        return cls(len(axes), list(axes))


@dataclass(slots=True)
class Motion_PosCommand:
    """Go to ``target`` (StartPos) or by ``target`` (StartMov)."""

    axis: int = 0
    target: float = 0.0
    profile: Profile = field(default_factory=Profile)


@dataclass(slots=True)
class Velocity_VelCommand:
    """Run in velocity mode at the signed ``profile.velocity`` until another command."""

    axis: int = 0
    profile: Profile = field(default_factory=Profile)


@dataclass(slots=True)
class Velocity_TimedVelCommand:
    """A velocity motion that ends by itself: deceleration begins after ``runTimeMilliseconds``."""

    axis: int = 0
    runTimeMilliseconds: float = 0.0
    profile: Profile = field(default_factory=Profile)


@dataclass(slots=True)
class AdvMotion_SplinePoint:
    """One point of a spline: a position per dimension, user units."""

    pos: list[float] = field(default_factory=list)

    def SetPos(self, index: int, value: float) -> None:
        """Position of dimension ``index``. Raises IndexError beyond the largest number of dimensions."""
        if not 0 <= index < MAX_SPLINE_DIMENSIONS:
            raise IndexError(f"index must be in 0..{MAX_SPLINE_DIMENSIONS - 1}, is {index}")
        self.pos.extend([0.0] * (index + 1 - len(self.pos)))
        self.pos[index] = value

    def GetPos(self, index: int) -> float:
        """A dimension never written is 0, as with the vendor's fixed array."""
        if not 0 <= index < MAX_SPLINE_DIMENSIONS:
            raise IndexError(f"index must be in 0..{MAX_SPLINE_DIMENSIONS - 1}, is {index}")
        return self.pos[index] if index < len(self.pos) else 0.0


@dataclass(slots=True)
class AdvMotion_PointTimeSplineCommand:
    """The axis of each dimension of a spline."""

    dimensionCount: int = 0
    axis: list[int] = field(default_factory=list)

    def SetAxis(self, index: int, value: int) -> None:
        """Dimension ``index`` is axis ``value``. Raises IndexError beyond the largest number of dimensions."""
        if not 0 <= index < MAX_SPLINE_DIMENSIONS:
            raise IndexError(f"index must be in 0..{MAX_SPLINE_DIMENSIONS - 1}, is {index}")
        self.axis.extend([0] * (index + 1 - len(self.axis)))
        self.axis[index] = value

    def GetAxis(self, index: int) -> int:
        if not 0 <= index < MAX_SPLINE_DIMENSIONS:
            raise IndexError(f"index must be in 0..{MAX_SPLINE_DIMENSIONS - 1}, is {index}")
        return self.axis[index] if index < len(self.axis) else 0
