"""Wheel odometry: motions computed by hand, exactness, lost messages, slip, encoder jumps and clock jumps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.drive.kinematics import ZEROS, Four, wheel_velocities
from robot_stack.drive.odometry import Encoders, Odometry, SwerveOdometry
from robot_stack.drive.params import OdometryParams
from robot_stack.drive.wheel_fit import robust_fit
from tests.benchmarks.support.perfect_ride import PerfectRide, perfect_ride
from tests.unit.drive.robot import PARAMS, POSITIONS, ROBOT

RADIUS = ROBOT.wheel_radius_m
DT_S = 0.02
moderate = st.floats(-1.5, 1.5)
twists = st.builds(Twist2, moderate, moderate, st.floats(-1.0, 1.0))


@pytest.fixture(scope="module")
def ride() -> PerfectRide:
    return perfect_ride(ROBOT, 20.0)


def new_odometry() -> SwerveOdometry:
    return SwerveOdometry(PARAMS.odometry, ROBOT)


class Wheels:
    """Encoders of a robot that moves with piecewise constant twists, in fake time."""

    def __init__(self) -> None:
        self.stamp_s = 0.0
        self.drive_m = [0.0] * 4
        self.steer_rad = [0.0] * 4
        self.odometry = new_odometry()
        self.odometry.update(self.reading())

    def reading(self) -> Encoders:
        drive = tuple(way / RADIUS for way in self.drive_m)
        return Encoders(self.stamp_s, drive, tuple(self.steer_rad))  # type: ignore[arg-type]

    def move(self, twist: Twist2, dt_s: float = DT_S, slip: tuple[float, ...] = ZEROS) -> Odometry:
        """Steers at rest, moves and reads. slip: additional speed of each wheel, m/s."""
        self.turn(twist)
        self.advance(twist, dt_s, slip)
        return self.odometry.update(self.reading())

    def turn(self, twist: Twist2) -> None:
        before = list(self.steer_rad)
        for i, (vx, vy) in enumerate(wheel_velocities(POSITIONS, twist)):
            if vx or vy:
                self.steer_rad[i] += math.remainder(math.atan2(vy, vx) - self.steer_rad[i], 2 * math.pi)
        if self.steer_rad != before:
            for seconds in (0.5, DT_S):  # steer, then stand, so that the next motion starts with constant headings
                self.stamp_s += seconds
                self.odometry.update(self.reading())

    def advance(self, twist: Twist2, dt_s: float = DT_S, slip: tuple[float, ...] = ZEROS) -> None:
        self.stamp_s += dt_s
        for i, (vx, vy) in enumerate(wheel_velocities(POSITIONS, twist)):
            self.drive_m[i] += (math.hypot(vx, vy) + slip[i]) * dt_s


def near(a: Pose2, b: Pose2, tolerance: float = 1e-9) -> bool:
    return a.distance_to(b) <= tolerance and abs(math.remainder(a.yaw - b.yaw, 2 * math.pi)) <= tolerance


@given(twists, st.integers(0, 3), st.floats(0.5, 3.0), st.floats(0.0, 2 * math.pi))
def test_one_wheel_that_contradicts_is_found(motion: Twist2, module: int, size: float, direction: float):
    displacements = list(wheel_velocities(POSITIONS, motion))
    dx, dy = displacements[module]
    displacements[module] = dx + size * math.cos(direction), dy + size * math.sin(direction)
    got = robust_fit(POSITIONS, displacements, 0.01)
    assert got.consistent
    assert module not in got.used
    assert (got.motion.vx, got.motion.vy, got.motion.omega) == pytest.approx(
        (motion.vx, motion.vy, motion.omega), abs=1e-9
    )


def test_two_contradicting_wheels_are_kept_and_fit_is_inconsistent():
    displacements = [(1.0, 0.0), (2.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    got = robust_fit(POSITIONS, displacements, 0.01)
    assert not got.consistent
    assert got.used == (0, 1, 2, 3)


@given(twists, st.floats(0.005, 0.1))
@settings(deadline=None)
def test_constant_twist_is_exact(twist: Twist2, dt_s: float):
    """With constant headings the integration is exact for any arc."""
    wheels = Wheels()
    expected = IDENTITY
    wheels.turn(twist)
    for _ in range(10):
        wheels.advance(twist, dt_s)
        got = wheels.odometry.update(wheels.reading())
        expected = expected.compose(exp_se2(twist, dt_s))
    assert near(got.pose, expected, 1e-9)
    assert (got.twist.vx, got.twist.vy, got.twist.omega) == pytest.approx((twist.vx, twist.vy, twist.omega), abs=1e-9)
    assert (got.faults, got.slipping) == ((), False)
    assert wheels.odometry.update(wheels.reading()) == got, "the same message again is nothing"
    wheels.odometry.reset()
    assert wheels.odometry.update(wheels.reading()) == Odometry()


def follow(ride: PerfectRide, keep: list[int]) -> Odometry:
    odometry = new_odometry()
    for index in keep:
        got = odometry.update(ride.encoders(index, RADIUS))
        assert got.faults == ()
    return got


def test_a_mixed_ride_and_the_same_with_lost_messages(ride: PerfectRide):
    """Of the second, every fifth message is lost, and 0.2 s of messages every 6 s."""
    last = len(ride.stamps_s) - 1
    whole = follow(ride, list(range(last + 1)))
    assert near(whole.pose, ride.pose(last), 5e-5)
    assert not whole.slipping
    matrix = np.array(whole.pose_covariance).reshape(3, 3)
    assert np.allclose(matrix, matrix.T)
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    keep = [i for i in range(last) if i % 5 != 3 and not 200 < i % 300 < 210] + [last]
    assert follow(ride, keep).pose.distance_to(ride.pose(last)) < 0.0005


def test_a_reading_right_after_another_does_not_halve_the_speed():
    """After a stall the machine sends the late reading and the next one at almost the same time."""
    odometry = new_odometry()
    for stamp_s in (0.0, DT_S, DT_S + 0.0024, 3 * DT_S, 3 * DT_S + 0.001, 3 * DT_S + 0.003, 3 * DT_S + 0.006, 4 * DT_S):
        got = odometry.update(Encoders(stamp_s, (0.5 * stamp_s / RADIUS,) * 4, ZEROS))
        assert stamp_s == 0.0 or got.twist.vx == pytest.approx(0.5)
    assert got.pose.x == pytest.approx(0.5 * 4 * DT_S)


def test_stop_within_short_interval_reports_zero_speed_at_next_update():
    odometry = new_odometry()
    for stamp_s in (0.0, DT_S, DT_S + 0.002):
        odometry.update(Encoders(stamp_s, (0.5 * min(stamp_s, DT_S) / RADIUS,) * 4, ZEROS))
    got = odometry.update(Encoders(2 * DT_S, (0.5 * DT_S / RADIUS,) * 4, (1e-9,) * 4))
    assert abs(got.twist.vx) < 1e-6


def test_a_clock_that_was_set_back_leaves_a_speed():
    odometry = new_odometry()
    for stamp_s in (10.0, 10.0 + DT_S):
        odometry.update(Encoders(stamp_s, (0.5 * (stamp_s - 10.0) / RADIUS,) * 4, ZEROS))
    got = odometry.update(Encoders(3.0, (0.5 * DT_S / RADIUS,) * 4, (1e-9,) * 4))
    assert abs(got.twist.vx) < 1e-6  # the wheels are at rest
    got = odometry.update(Encoders(3.0 + DT_S, (0.5 * 2 * DT_S / RADIUS,) * 4, (1e-9,) * 4))
    assert got.twist.vx == pytest.approx(0.5)


def test_encoders_with_counts(ride: PerfectRide):
    """With 16384 counts of the drive and 65536 of the steering, the rounding error stays small."""
    drive_step, steer_step = (
        2 * math.pi / ROBOT.drive.counts_per_turn,
        2 * math.pi / ROBOT.steer.counts_per_turn,
    )

    def counted(values: Four, step: float) -> Four:
        a, b, c, d = (round(value / step) * step for value in values)
        return a, b, c, d

    odometry = new_odometry()
    last = len(ride.stamps_s) - 1
    for index in range(last + 1):
        reading = ride.encoders(index, RADIUS)
        counts = Encoders(
            reading.stamp_s, counted(reading.drive_rad, drive_step), counted(reading.steer_rad, steer_step)
        )
        got = odometry.update(counts)
        assert not got.slipping
    assert got.pose.distance_to(ride.pose(last)) < 0.001


RADIUS_ERRORS, ZERO_ERRORS = (0.002, -0.001, 0.0, -0.001), (0.001, -0.001, 0.0005, -0.0005)  # each sums to zero


def imperfect(reading: Encoders) -> Encoders:
    """A larger wheel turns less; the zero error adds to the steering angle."""
    drive = [value / (1.0 + error) for value, error in zip(reading.drive_rad, RADIUS_ERRORS, strict=True)]
    steer = [value + error for value, error in zip(reading.steer_rad, ZERO_ERRORS, strict=True)]
    return Encoders(reading.stamp_s, tuple(drive), tuple(steer))  # type: ignore[arg-type]


def test_wheel_radii_and_steering_zeros_are_learnt_from_the_ride(ride: PerfectRide):
    """In the first run; ``reset`` clears only the pose. The learnt values come with their deviations."""
    odometry, unlearnt = new_odometry(), SwerveOdometry(without_learning(), ROBOT)
    untold = odometry.calibration.learnt()
    assert (untold.readings, untold.unlike_m, untold.left_m) == (0, 0.0, 0.0)
    # Deviations are relative to the other wheels: the common part is held at zero.
    prior = PARAMS.odometry.calibration.radius_deviation
    assert untold.radius_deviations == pytest.approx([math.sqrt(0.75) * prior] * 4, rel=1e-3)
    last = len(ride.stamps_s) - 1
    for _ in range(2):
        odometry.reset()
        unlearnt.reset()
        for index in range(last + 1):
            got = odometry.update(imperfect(ride.encoders(index, RADIUS)))
            drifted = unlearnt.update(imperfect(ride.encoders(index, RADIUS)))
    assert odometry.calibration.radius_errors == pytest.approx(RADIUS_ERRORS, abs=2e-5)
    assert odometry.calibration.zero_errors_rad == pytest.approx(ZERO_ERRORS, abs=2e-5)
    assert drifted.pose.distance_to(ride.pose(last)) > 0.1
    assert got.pose.distance_to(ride.pose(last)) < 0.01
    learnt = odometry.calibration.learnt()
    assert learnt.radius_errors == pytest.approx(RADIUS_ERRORS, abs=5e-5)
    assert learnt.zero_errors_rad == pytest.approx(ZERO_ERRORS, abs=5e-5)
    # Noise-free encoders yield smaller deviations than the specified ones.
    assert max(learnt.radius_deviations) < 0.1 * PARAMS.odometry.calibration.radius_deviation
    assert max(learnt.zero_deviations_rad) < 0.1 * PARAMS.odometry.calibration.zero_deviation_rad
    assert learnt.readings > 500
    assert learnt.left_m < 0.2 * learnt.unlike_m


def without_learning() -> OdometryParams:
    prior = {"radius_deviation": 1e-9, "zero_deviation_rad": 1e-9}
    calibration = PARAMS.odometry.calibration.model_copy(update=prior)
    return PARAMS.odometry.model_copy(update={"calibration": calibration})


def test_nothing_is_learnt_from_standing_or_slipping_wheels():
    wheels = Wheels()
    for _ in range(50):
        wheels.advance(Twist2(0.0, 0.0, 0.0))
        wheels.odometry.update(wheels.reading())
        wheels.advance(Twist2(0.5, 0.0, 0.0), slip=(0.0, 0.4, 0.0, 0.0))
        wheels.odometry.update(wheels.reading())
    assert wheels.odometry.calibration.radius_errors == ZEROS


def test_calibrated_radius_error_is_bounded():
    """An error of 4 % is within the slip tolerance, but larger than any real radius error."""
    wheels = Wheels()
    for _ in range(1500):
        wheels.advance(Twist2(1.0, 0.0, 0.0), slip=(-0.04, 0.0, 0.0, 0.0))
        wheels.odometry.update(wheels.reading())
    deviation = PARAMS.odometry.calibration.radius_deviation
    assert max(map(abs, wheels.odometry.calibration.radius_errors)) <= 4.0 * deviation


def test_one_spinning_wheel_is_left_out():
    wheels = Wheels()
    for _ in range(50):
        got = wheels.move(Twist2(0.5, 0.0, 0.0), slip=(0.0, 0.4, 0.0, 0.0))
    assert near(got.pose, Pose2(0.5, 0.0, 0.0))
    assert got.slipping
    assert got.used == (0, 2, 3)


def test_several_slipping_wheels_widen_the_covariance():
    calm, slippery = Wheels(), Wheels()
    for _ in range(20):
        good = calm.move(Twist2(0.5, 0.0, 0.0))
        bad = slippery.move(Twist2(0.5, 0.0, 0.0), slip=(0.3, -0.3, 0.2, 0.0))
    assert bad.slipping
    assert bad.used == (0, 1, 2, 3)
    assert bad.pose_covariance[0] > 20.0 * good.pose_covariance[0]
    assert bad.twist_covariance[0] > 2.0 * good.twist_covariance[0]


@pytest.mark.parametrize(
    ("encoder", "module", "says"),
    [
        ("drive_m", 0, "fl_drive jumped by 1.010 m in 0.020 s, at most 0.099 m"),
        ("drive_m", 3, "rr_drive jumped by 1.010 m in 0.020 s, at most 0.099 m"),
        ("steer_rad", 2, "rl_steer jumped by 1.000 rad"),
    ],
)
def test_jumping_encoder_is_excluded_and_reported(encoder: str, module: int, says: str):
    wheels = Wheels()
    wheels.move(Twist2(0.5, 0.0, 0.0))
    wheels.advance(Twist2(0.5, 0.0, 0.0))
    getattr(wheels, encoder)[module] += 1.0
    got = wheels.odometry.update(wheels.reading())
    assert near(got.pose, Pose2(0.02, 0.0, 0.0))
    assert got.faults[0].startswith(says)
    assert module not in got.used
    if encoder == "drive_m":
        wheels.advance(Twist2(0.5, 0.0, 0.0))
        after = wheels.odometry.update(wheels.reading())
        assert near(after.pose, Pose2(0.03, 0.0, 0.0))  # the module is used again
        assert after.faults == ()


def test_long_silence_is_named_and_not_integrated():
    wheels = Wheels()
    wheels.advance(Twist2(1.0, 0.0, 0.0), dt_s=1.5)
    got = wheels.odometry.update(wheels.reading())
    assert got.pose == IDENTITY
    assert got.faults[0].startswith("no encoder reading for 1.50 s, at most 1.0 s")
    assert got.pose_covariance[0] > 1.0


def test_all_encoders_that_jump_leave_the_pose_standing():
    wheels = Wheels()
    wheels.drive_m = [5.0] * 4
    wheels.stamp_s += DT_S
    got = wheels.odometry.update(wheels.reading())
    assert got.pose == IDENTITY
    assert got.twist == ZERO_TWIST
    assert got.used == ()
    assert "fewer than 2 modules are plausible" in got.faults[-1]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("field", ["stamp_s", "drive_rad", "steer_rad"])
def test_reading_that_is_not_finite_moves_nothing(bad: float, field: str):
    wheels = Wheels()
    wheels.move(Twist2(0.5, 0.0, 0.0))
    values = {"stamp_s": wheels.stamp_s + DT_S, "drive_rad": ZEROS, "steer_rad": ZEROS}
    values[field] = bad if field == "stamp_s" else (0.0, bad, 0.0, 0.0)
    got = wheels.odometry.update(Encoders(**values))  # type: ignore[arg-type]
    assert got.pose.is_finite()
    assert near(got.pose, Pose2(0.01, 0.0, 0.0))
    assert got.faults == ("encoder reading is not finite",)
    wheels.advance(Twist2(0.5, 0.0, 0.0))
    assert near(wheels.odometry.update(wheels.reading()).pose, Pose2(0.02, 0.0, 0.0))


def test_time_that_runs_back_loses_no_distance():
    wheels = Wheels()
    wheels.move(Twist2(0.05, 0.0, 0.0))
    wheels.stamp_s -= 100.0
    wheels.advance(Twist2(0.05, 0.0, 0.0))
    got = wheels.odometry.update(wheels.reading())
    assert near(got.pose, Pose2(0.002, 0.0, 0.0))
    assert got.twist.is_finite()
    wheels.advance(Twist2(0.05, 0.0, 0.0))
    assert near(wheels.odometry.update(wheels.reading()).pose, Pose2(0.003, 0.0, 0.0))


@pytest.mark.parametrize("step_s", [3600.0, 2.0, -0.05, -2.0])
def test_set_clock_changes_no_odometry_of_received_readings(step_s: float):
    odometry, set_clock = new_odometry(), new_odometry()
    for tick in range(20):
        stamp_s, way = 10.0 + tick * DT_S, (1.5 * tick * DT_S / RADIUS,) * 4
        expected = odometry.update(Encoders(stamp_s, way, ZEROS, stamp_s))
        stepped_s = stamp_s + (step_s if tick >= 10 else 0.0)
        got = set_clock.update(Encoders(stepped_s, way, ZEROS, stamp_s))
        assert got.faults == ()
        assert got.twist.vx == pytest.approx(expected.twist.vx)
        assert near(got.pose, expected.pose)
        assert got.pose_covariance == pytest.approx(expected.pose_covariance)


def test_readings_that_waited_are_dated_by_their_stamps():
    odometry, waited = new_odometry(), new_odometry()
    for tick in range(3):
        stamp_s, way = 10.0 + tick * DT_S, (0.5 * tick * DT_S / RADIUS,) * 4
        expected = odometry.update(Encoders(stamp_s, way, ZEROS))
        assert waited.update(Encoders(stamp_s, way, ZEROS, 10.0 if tick == 0 else 15.0)) == expected


def test_covariance_of_ten_metres_straight():
    """sigma_x^2 = 0.01^2 * 10; yaw noise, 0.005^2 per metre, adds to y: the integral of (10 - s)^2 is 10^3 / 3."""
    wheels = Wheels()
    for _ in range(1000):
        got = wheels.move(Twist2(0.5, 0.0, 0.0))
    xx, _, _, _, yy, _, _, _, tt = got.pose_covariance
    assert xx == pytest.approx(1e-4 * 10.0, rel=1e-6)
    assert tt == pytest.approx(2.5e-5 * 10.0, rel=1e-6)
    assert yy == pytest.approx(1e-4 * 10.0 + 2.5e-5 * 1000.0 / 3.0, rel=0.01)
