"""The inputs of the safety monitor, tracked message by message. Non-finite values count as not received."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_stack.contract.frames import DRIVE_AXES, JOINTS, STEER_AXES
from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.safety.attitude import PlanarAcceleration, UpDirection
from robot_stack.safety.dead_reckoning import DeadReckoning, Modules
from robot_stack.safety.inputs import ImuSample
from robot_stack.safety.timing import Hold, age_s

_MOST_RADPS = 1e4  # beyond the speed of any wheel or steering axis
_MODULE_AXES = tuple(zip(DRIVE_AXES, STEER_AXES, strict=True))


class EstopWatch:
    """The newest ``/emergency_stop`` and the two-key rule's first key: the time since its release."""

    def __init__(self) -> None:
        self._pressed: bool | None = None
        self._pressed_since_step = False
        self._released_for = Hold()

    def received(self, pressed: bool, now_s: float) -> None:
        self._pressed = pressed
        # A true followed by a false before the next step must not be lost.
        self._pressed_since_step |= pressed
        self._released_for.update(not pressed, now_s)

    @property
    def pressed(self) -> bool | None:
        """The newest value, None if there never was one."""
        return self._pressed

    def take_pressed(self) -> bool:
        """True if the stop is pressed, or was at any moment since the last call."""
        taken, self._pressed_since_step = self._pressed_since_step, False
        return taken or self._pressed is True

    def released_for_s(self, now_s: float) -> float | None:
        """Seconds since the newest change to false; None while pressed or never received."""
        return self._released_for.update(self._pressed is False, now_s)


class Latest:
    """The newest usable value of a number and its age."""

    def __init__(self, lowest: float, highest: float) -> None:
        self._lowest, self._highest = lowest, highest
        self._at_s: float | None = None
        self.value = math.nan

    def received(self, value: float, now_s: float) -> None:
        """Stores the value if it is in range; anything else does not reset the age."""
        if self._lowest <= value <= self._highest:
            self.value, self._at_s = value, now_s

    def age_s(self, now_s: float) -> float:
        return age_s(now_s, self._at_s)


class PoseWatch:
    """Age of the pose and how far it jumped from one message to the next."""

    def __init__(self) -> None:
        self._at_s: float | None = None
        self._xy_m: tuple[float, float] | None = None
        self._jump_m = 0.0

    def received(self, x_m: float, y_m: float, now_s: float) -> None:
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return
        if self._xy_m is not None:
            self._jump_m = max(self._jump_m, math.dist(self._xy_m, (x_m, y_m)))
        self._xy_m, self._at_s = (x_m, y_m), now_s

    def age_s(self, now_s: float) -> float:
        return age_s(now_s, self._at_s)

    def take_jump_m(self) -> float:
        """The longest jump since the last call, m."""
        jump_m, self._jump_m = self._jump_m, 0.0
        return jump_m


class WheelWatch:
    """Age of the joint states, and the robot's motion by them.

    speeds_mps, angles_rad: of the wheels and of the modules, from the newest usable ones.
    """

    def __init__(
        self, modules: Modules, standstill_mps: float, motion: PlanarAcceleration, dead_reckoning: DeadReckoning
    ) -> None:
        self._modules = modules
        self._standstill_mps = standstill_mps
        self._motion = motion
        self._dead_reckoning = dead_reckoning
        self._at_s: float | None = None
        self._longest_s = 0.0  # the longest silence that has ended since the last take
        self._fastest_mps = math.inf
        self._still_for = Hold()
        self._fresh_for = Hold()
        self._up = False
        self.problem = "never received"
        self.speeds_mps: list[float] = []
        self.angles_rad: list[float] = []

    def received(
        self, names: Sequence[str], position: Sequence[float], velocity: Sequence[float], now_s: float
    ) -> None:
        """Joint states: rad and rad/s, in any order. Incomplete or non-finite ones do not reset the age."""
        self.problem = joint_states_problem(names, position, velocity)
        if self.problem:
            return
        index = {name: i for i, name in enumerate(names)}
        order = [index[name] for name in JOINTS]
        self.speeds_mps = speeds = [self._modules.wheel_radius_m * velocity[order[drive]] for drive, _ in _MODULE_AXES]
        self.angles_rad = [position[order[steer]] for _, steer in _MODULE_AXES]
        twist = self._modules.twist(speeds, self.angles_rad)
        if self._at_s is not None:
            self._longest_s = max(self._longest_s, self.age_s(now_s))
        self._at_s = now_s
        self._fastest_mps = max(abs(speed) for speed in speeds)
        self._motion.update(twist.vx, twist.vy, now_s)
        self._dead_reckoning.update(twist, now_s)
        self.still_for_s(now_s, math.inf)

    def up(self, complete: bool, now_s: float, stale_s: float, settle_s: float) -> bool:
        """True once they have been fresh for ``settle_s`` without a break while the stack was complete.

        Call at every step.
        """
        fresh_for_s = self._fresh_for.update(complete and self.age_s(now_s) <= stale_s, now_s)
        self._up |= fresh_for_s is not None and fresh_for_s >= settle_s
        return self._up

    def age_s(self, now_s: float) -> float:
        return age_s(now_s, self._at_s)

    def take_silence_s(self, now_s: float) -> float:
        """The age, or the longest silence since the last call if that was longer.

        A pause of the whole machine ends with fresh joint states, which may arrive before their age is judged.
        """
        longest_s, self._longest_s = self._longest_s, 0.0
        return max(longest_s, self.age_s(now_s))

    def twist(self, now_s: float, stale_s: float) -> Twist2:
        """The measured twist of base_link; zero while the robot stands or the twist is unknown."""
        known = self.age_s(now_s) <= stale_s
        return self._dead_reckoning.twist if known and self._fastest_mps >= self._standstill_mps else ZERO_TWIST

    def still_for_s(self, now_s: float, stale_s: float) -> float | None:
        """Seconds for which every wheel has been below the standstill speed; None while one is faster or unknown."""
        known = self.age_s(now_s) <= stale_s
        return self._still_for.update(known and self._fastest_mps < self._standstill_mps, now_s)


def joint_states_problem(names: Sequence[str], position: Sequence[float], velocity: Sequence[float]) -> str:
    """Why joint states are unusable, else an empty text."""
    missing = [name for name in JOINTS if name not in names]
    if missing:
        return f"joints are missing: {', '.join(missing)}"
    if not len(names) == len(position) == len(velocity):
        return f"{len(names)} names, {len(position)} positions, {len(velocity)} velocities"
    for index, name in enumerate(names):
        if not (math.isfinite(position[index]) and math.isfinite(velocity[index])):
            return f"{name} is not finite"
        if abs(velocity[index]) > _MOST_RADPS:
            return f"{name} turns at {velocity[index]:g} rad/s"
    return ""


class CameraWatch:
    """Age of the cameras' newest images, while a docking is guided by markers.

    ``/docking/status`` does not name the camera in use, so that all of them are required.
    """

    def __init__(self, cameras: Sequence[str]) -> None:
        self._at_s: dict[str, float | None] = dict.fromkeys(cameras)
        self._status_at_s: float | None = None
        self._since_s: float | None = None

    def docking(self, looking: bool, now_s: float) -> None:
        """A docking status. looking: in its state the docking is guided by images."""
        self._status_at_s = now_s
        if not looking:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = now_s

    def received(self, camera: str, now_s: float) -> None:
        self._at_s[camera] = now_s

    def ages_s(self, now_s: float, stale_s: float) -> dict[str, float]:
        """Camera -> seconds since its newest image, or since the guidance by images began if that is later.

        Empty without a docking guided by images, also if its status is older than ``stale_s``.
        """
        if self._since_s is None or age_s(now_s, self._status_at_s) > stale_s:
            return {}
        since_s = self._since_s
        return {
            name: age_s(now_s, since_s if at_s is None else max(at_s, since_s)) for name, at_s in self._at_s.items()
        }


class ImuWatch:
    """Age of the last valid, changed sample, and the inclination estimated from all of them."""

    def __init__(
        self, up: UpDirection, motion: PlanarAcceleration, min_mps2: float, max_mps2: float, max_radps: float
    ) -> None:
        self._up = up
        self._motion = motion
        self._min_mps2, self._max_mps2, self._max_radps = min_mps2, max_mps2, max_radps
        self._last: ImuSample | None = None
        self._at_s: float | None = None
        self.problem = "never received"

    def received(self, sample: ImuSample, now_s: float) -> None:
        """A sample; one that is not plausible, or equal to the previous one, does not reset the age."""
        self.problem = self._problem(sample)
        if self.problem:
            return
        self._last, self._at_s = sample, now_s
        self._up.update(sample, self._motion.at(sample.wz, now_s), now_s)

    def _problem(self, sample: ImuSample) -> str:
        if not all(map(math.isfinite, (sample.ax, sample.ay, sample.az, sample.wx, sample.wy, sample.wz))):
            return "not finite"
        if not self._min_mps2 <= math.hypot(sample.ax, sample.ay, sample.az) <= self._max_mps2:
            return "acceleration is not plausible"
        if not math.hypot(sample.wx, sample.wy, sample.wz) <= self._max_radps:
            return "angular rate is not plausible"
        # The noise of a working sensor never repeats all six numbers.
        return "frozen" if sample == self._last else ""

    def age_s(self, now_s: float) -> float:
        return age_s(now_s, self._at_s)

    def inclination_rad(self, now_s: float, stale_s: float) -> float:
        """Angle between base_link's z axis and the vertical; NaN while unknown."""
        return self._up.inclination_rad() if self.age_s(now_s) <= stale_s else math.nan

    @property
    def downhill_rad(self) -> float:
        """Bearing of the fall line in base_link, down; valid only while the inclination is known."""
        return self._up.downhill_rad()
