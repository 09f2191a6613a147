"""Wheel odometry: the pose of base_link in odom from accumulated encoder positions.

Distances come from position differences, never from speeds, so that a lost message loses no distance. Each interval
between two readings becomes displacements of the wheels (interval), whose least-squares fit is the body's motion
(wheel_fit), applied by the exponential map of SE(2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from robot_stack.contract.frames import MODULES
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.robot import Robot
from robot_stack.drive.interval import Interval, curvature, displacements, four, split, with_commutator
from robot_stack.drive.kinematics import TURN, Four
from robot_stack.drive.params import OdometryParams, max_wheel_speed_mps, module_positions
from robot_stack.drive.self_calibration import WheelCalibration
from robot_stack.drive.wheel_fit import WheelFit, robust_fit

# A rotation needs two wheels.
_FEWEST_MODULES = 2
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]
_ZERO_MATRIX: Matrix3 = (0.0,) * 9
_ALL = (0, 1, 2, 3)
_JUMP = 2.0  # an encoder that reports more than this multiple of the largest speed or rate has jumped


@dataclass(frozen=True, slots=True)
class Encoders:
    """stamp_s: time of the reading. drive_rad: accumulated wheel angles. steer_rad: headings, any number of turns.

    received_s: steady time of the reception, None if only the stamp is known.
    """

    stamp_s: float
    drive_rad: Four
    steer_rad: Four
    received_s: float | None = field(default=None, compare=False)

    def is_finite(self) -> bool:
        return math.isfinite(self.stamp_s) and all(map(math.isfinite, (*self.drive_rad, *self.steer_rad)))


@dataclass(frozen=True, slots=True)
class Odometry:
    """pose: base_link in odom. twist: base_link, mean over the last interval, or over the last few where readings come
    within ``shortest_interval_s``. Covariances 3 x 3, row-major: of (x, y,
    yaw) in odom, of (vx, vy, omega) in base_link. used: modules with plausible readings. slipping: wheels are
    inconsistent. faults: errors of the last reading, one sentence each.
    """

    pose: Pose2 = IDENTITY
    twist: Twist2 = ZERO_TWIST
    pose_covariance: Matrix3 = _ZERO_MATRIX
    twist_covariance: Matrix3 = _ZERO_MATRIX
    used: tuple[int, ...] = _ALL
    slipping: bool = False
    faults: tuple[str, ...] = ()


class SwerveOdometry:
    """Accumulates readings of the encoders."""

    def __init__(self, params: OdometryParams, robot: Robot) -> None:
        self._positions = module_positions(robot)
        self._params = params
        self._radius_m, self._max_wheel_speed_mps = robot.wheel_radius_m, max_wheel_speed_mps(robot)
        self._max_rate_radps = robot.steer.max_rate_radps
        self._max_acceleration_radps2 = robot.steer.max_acceleration_radps2
        self._last: Encoders | None = None
        self._previous: Interval | None = None
        self._odometry = Odometry()
        self._unread = (ZERO_TWIST, 0.0)  # motion and time since the last update of the twist
        self.calibration = WheelCalibration(self._positions, params.calibration)

    def reset(self) -> None:
        """Starts again at the identity; the next reading only sets the encoders' zero. The calibration stays."""
        self._last = self._previous = None
        self._odometry = Odometry()
        self._unread = (ZERO_TWIST, 0.0)

    def update(self, reading: Encoders) -> Odometry:
        """The odometry after ``reading``. Implausible values are ignored and named in ``faults``."""
        if not reading.is_finite():
            self._odometry = replace(self._odometry, twist=ZERO_TWIST, faults=("encoder reading is not finite",))
            return self._odometry
        last, self._last = self._last, reading
        if last is None:
            self._odometry = replace(self._odometry, twist=ZERO_TWIST, faults=())
        elif (elapsed_s := self._elapsed_s(last, reading)) > self._params.longest_gap_s:
            self._odometry = self._after_gap(elapsed_s)
        elif reading == last:
            self._odometry = replace(self._odometry, faults=())
        else:
            self._odometry = self._advanced(last, reading, elapsed_s)
        return self._odometry

    def _elapsed_s(self, last: Encoders, reading: Encoders) -> float:
        """By the stamps; by the receptions if the system clock, which stamps, was set in between.

        Stamps that are closer than the receptions are those of messages that waited.
        """
        stamps_s = reading.stamp_s - last.stamp_s
        if last.received_s is None or reading.received_s is None:
            return stamps_s
        received_s = reading.received_s - last.received_s
        return stamps_s if 0.0 <= stamps_s <= received_s + self._params.longest_gap_s else received_s

    def _after_gap(self, gap_s: float) -> Odometry:
        self._previous = None
        self._unread = (ZERO_TWIST, 0.0)
        lost_m = self._max_wheel_speed_mps * gap_s
        fault = f"no encoder reading for {gap_s:.2f} s, at most {self._params.longest_gap_s} s: motion in it is unknown"
        unknown = (lost_m * lost_m, 0.0, 0.0, 0.0, lost_m * lost_m, 0.0, 0.0, 0.0, math.pi**2)
        return replace(
            self._odometry,
            twist=ZERO_TWIST,
            pose_covariance=_sum(self._odometry.pose_covariance, unknown),
            faults=(fault,),
        )

    def _advanced(self, last: Encoders, reading: Encoders, elapsed_s: float) -> Odometry:
        interval = self._interval(last, reading, elapsed_s)
        plausible, faults = self._plausible(interval)
        if len(plausible) < _FEWEST_MODULES:
            faults.append(f"fewer than {_FEWEST_MODULES} modules are plausible: the pose is not updated")
            self._previous = None
            return replace(self._odometry, twist=ZERO_TWIST, slipping=True, used=(), faults=tuple(faults))
        pose, motion, fit = self._moved(interval, plausible)
        if faults:
            self._previous = None
        twist = self._twist(motion, elapsed_s)
        return self._result(pose, motion, twist, fit.rms_m / interval.elapsed_s, fit, tuple(faults))

    def _twist(self, motion: Twist2, elapsed_s: float) -> Twist2:
        """The mean since the twist's last update, once that is ``shortest_interval_s`` ago; until then the last one."""
        shortest_s = self._params.shortest_interval_s
        before, before_s = self._unread
        if elapsed_s <= 0.0:  # a clock that was set back, or stands
            before, before_s, elapsed_s = ZERO_TWIST, 0.0, shortest_s
        unread = Twist2(before.vx + motion.vx, before.vy + motion.vy, before.omega + motion.omega)
        unread_s = before_s + elapsed_s
        if unread_s < shortest_s:
            self._unread = unread, unread_s
            return self._odometry.twist
        self._unread = ZERO_TWIST, 0.0
        return unread.scaled(1.0 / unread_s)

    def _interval(self, last: Encoders, reading: Encoders, elapsed_s: float) -> Interval:
        # The distance is known even if the time is not (two receptions at once): only speeds and plausibility need it.
        elapsed_s = max(elapsed_s, self._params.shortest_interval_s)
        turns = (math.remainder(new - old, TURN) for new, old in zip(reading.steer_rad, last.steer_rad, strict=True))
        radius, learnt = self._radius_m, self.calibration
        ways = (
            radius * (1.0 + error) * (new - old)
            for new, old, error in zip(reading.drive_rad, last.drive_rad, learnt.radius_errors, strict=True)
        )
        headings = (angle - zero for angle, zero in zip(last.steer_rad, learnt.zero_errors_rad, strict=True))
        return Interval(elapsed_s, four(headings), four(turns), four(ways))

    def _plausible(self, interval: Interval) -> tuple[list[int], list[str]]:
        """(modules with plausible readings, errors of the others)."""
        elapsed_s = interval.elapsed_s
        most_m, most_rad = _JUMP * self._max_wheel_speed_mps * elapsed_s, _JUMP * self._max_rate_radps * elapsed_s
        plausible, faults = [], []
        for i, name in enumerate(MODULES):
            distance_m, turn_rad = interval.ways_m[i], interval.turns_rad[i]
            if abs(distance_m) > most_m:
                faults.append(_jump(f"{name}_drive", "m", distance_m, most_m, elapsed_s))
            elif abs(turn_rad) > most_rad:
                faults.append(_jump(f"{name}_steer", "rad", turn_rad, most_rad, elapsed_s))
            else:
                plausible.append(i)
        return plausible, faults

    def _moved(self, interval: Interval, plausible: list[int]) -> tuple[Pose2, Twist2, WheelFit]:
        """(new pose, sum of the body's motions, the worst of the fits)."""
        s = self._params
        parts = self._parts(interval)
        slack_m = s.slip_speed_mps * interval.elapsed_s + s.slip_share * max(map(abs, interval.ways_m))
        pose, x, y, yaw, fits = self._odometry.pose, 0.0, 0.0, 0.0, []
        for piece in self._pieces(interval, parts):
            second_difference = curvature(piece, self._previous, self._max_acceleration_radps2)
            wheels = displacements(piece, second_difference)
            fit = robust_fit(self._positions, wheels, slack_m / parts, plausible)
            if parts == 1 and fit.consistent and len(fit.used) == len(MODULES):
                self.calibration.observe(wheels)
            motion = with_commutator(fit.motion, second_difference)
            pose = pose.compose(exp_se2(motion, 1.0))
            x, y, yaw = x + motion.vx, y + motion.vy, yaw + motion.omega
            fits.append(fit)
            self._previous = replace(piece, motion=motion)
        return pose, Twist2(x, y, yaw), min(fits, key=lambda fit: (fit.consistent, len(fit.used), -fit.rms_m))

    def _pieces(self, interval: Interval, parts: int) -> list[Interval]:
        if parts == 1:
            return [interval]
        return split(interval, curvature(interval, self._previous, self._max_acceleration_radps2), parts)

    def _parts(self, interval: Interval) -> int:
        s = self._params
        parts = max(interval.elapsed_s / s.substep_s, max(map(abs, interval.turns_rad)) / s.substep_turn_rad)
        return max(1, math.ceil(parts - 0.5))  # an interval that is only a little late stays whole

    def _result(
        self, pose: Pose2, motion: Twist2, twist: Twist2, rms_mps: float, fit: WheelFit, faults: tuple[str, ...]
    ) -> Odometry:
        before = self._odometry
        factor = 1.0 if fit.consistent else self._params.slip_factor
        return Odometry(
            pose,
            twist,
            _propagated(before.pose_covariance, before.pose, pose, self._growth(motion, factor)),
            self._twist_covariance(rms_mps),
            fit.used,
            not fit.consistent or len(fit.used) < len(MODULES),
            faults,
        )

    def _growth(self, motion: Twist2, factor: float) -> tuple[float, float]:
        """Variances that this motion adds: (m2 in x and in y, rad2)."""
        s, way, turn = self._params, motion.speed(), abs(motion.omega)
        position = s.deviation_per_sqrt_m**2 * way
        yaw = s.yaw_deviation_per_sqrt_m**2 * way + s.yaw_deviation_per_sqrt_rad**2 * turn
        return position * factor**2, yaw * factor**2

    def _twist_covariance(self, rms_mps: float) -> Matrix3:
        s = self._params
        # Least squares over eight rows: a translation is the mean of four wheels, a rotation that mean over their
        # distance.
        arm = math.hypot(*self._positions[0])
        linear = s.twist_deviation_mps**2 + rms_mps**2 / 4.0
        angular = s.twist_deviation_radps**2 + rms_mps**2 / (4.0 * arm * arm)
        return linear, 0.0, 0.0, 0.0, linear, 0.0, 0.0, 0.0, angular


def _jump(joint: str, unit: str, change: float, most: float, elapsed_s: float) -> str:
    return f"{joint} jumped by {change:.3f} {unit} in {elapsed_s:.3f} s, at most {most:.3f} {unit}: rejected"


def _propagated(p: Matrix3, old: Pose2, new: Pose2, growth: tuple[float, float]) -> Matrix3:
    """F P F^T + Q for a step from ``old`` to ``new``: an error of the yaw rotates the step."""
    dx, dy = new.x - old.x, new.y - old.y
    xx, xy, xt, yy, yt, tt = p[0], p[1], p[2], p[4], p[5], p[8]
    position, yaw = growth
    new_xx = xx - 2.0 * dy * xt + dy * dy * tt + position
    new_xy = xy + dx * xt - dy * yt - dx * dy * tt
    new_xt, new_yt = xt - dy * tt, yt + dx * tt
    new_yy = yy + 2.0 * dx * yt + dx * dx * tt + position
    return new_xx, new_xy, new_xt, new_xy, new_yy, new_yt, new_xt, new_yt, tt + yaw


def _sum(a: Matrix3, b: Matrix3) -> Matrix3:
    c = [x + y for x, y in zip(a, b, strict=True)]
    return c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
