"""Each input of the safety monitor on its own."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from robot_stack.contract.frames import JOINTS
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.safety.attitude import PlanarAcceleration, UpDirection, Vector3
from robot_stack.safety.dead_reckoning import DeadReckoning, Modules
from robot_stack.safety.inputs import ImuSample
from robot_stack.safety.watches import (
    CameraWatch,
    EstopWatch,
    ImuWatch,
    Latest,
    PoseWatch,
    WheelWatch,
    joint_states_problem,
)

STILL = ImuSample(0.0, 0.0, 9.81, 0.0, 0.0, 0.0)


# --- emergency stop --------------------------------------------------------------------------------------------------


def test_estop_never_received() -> None:
    watch = EstopWatch()
    assert watch.pressed is None
    assert not watch.take_pressed()
    assert watch.released_for_s(5.0) is None


def test_estop_pressed_stays_pressed() -> None:
    watch = EstopWatch()
    watch.received(True, 1.0)
    assert watch.pressed is True
    assert watch.take_pressed()
    assert watch.take_pressed()
    assert watch.released_for_s(9.0) is None


def test_estop_short_press_is_seen_once() -> None:
    watch = EstopWatch()
    watch.received(True, 1.0)
    watch.received(False, 1.0)
    assert watch.pressed is False
    assert watch.take_pressed()
    assert not watch.take_pressed()


def test_estop_release_time_counts_from_the_message() -> None:
    watch = EstopWatch()
    watch.received(True, 1.0)
    watch.received(False, 2.0)
    assert watch.released_for_s(2.5) == 0.5
    watch.received(False, 3.0)
    assert watch.released_for_s(4.0) == 2.0
    watch.received(True, 4.5)
    watch.received(False, 5.0)
    assert watch.released_for_s(5.0) == 0.0


# --- numbers ---------------------------------------------------------------------------------------------------------


def test_latest_keeps_the_newest_in_range() -> None:
    latest = Latest(0.0, 1.0)
    assert math.isnan(latest.value)
    assert latest.age_s(1.0) == math.inf
    for value in (0.0, 1.0, 0.4):
        latest.received(value, 2.0)
        assert latest.value == value
    for bad in (-0.01, 1.01, math.nan, math.inf):
        latest.received(bad, 3.0)
    assert (latest.value, latest.age_s(5.0)) == (0.4, 3.0)


def test_pose_age_and_jump() -> None:
    pose = PoseWatch()
    assert pose.age_s(1.0) == math.inf
    assert pose.take_jump_m() == 0.0
    pose.received(100.0, 0.0, 1.0)
    assert pose.take_jump_m() == 0.0  # the first pose is no jump
    pose.received(103.0, 4.0, 2.0)
    pose.received(103.0, 3.0, 2.5)
    assert pose.age_s(3.0) == 0.5
    assert pose.take_jump_m() == 5.0
    assert pose.take_jump_m() == 0.0


@pytest.mark.parametrize("bad", [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)])
def test_pose_that_is_none(bad: tuple[float, float]) -> None:
    pose = PoseWatch()
    pose.received(1.0, 1.0, 1.0)
    pose.received(*bad, 2.0)
    assert pose.age_s(3.0) == 2.0
    pose.received(1.0, 1.5, 4.0)
    assert pose.take_jump_m() == 0.5


# --- wheels ----------------------------------------------------------------------------------------------------------


def _wheels(standstill_mps: float = 0.05) -> tuple[WheelWatch, PlanarAcceleration]:
    motion = PlanarAcceleration(0.1, 100.0)
    modules = Modules(((0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2)), 0.1)
    return WheelWatch(modules, standstill_mps, motion, DeadReckoning(0.3)), motion


def _states(drive_radps: list[float], steer_rad: list[float]) -> tuple[list[float], list[float]]:
    position = [value for angle in steer_rad for value in (77.0, angle)]
    velocity = [value for speed in drive_radps for value in (speed, 55.0)]
    return position, velocity


def test_wheels_never_received() -> None:
    wheels, _ = _wheels()
    assert not wheels.up(True, 1.0, 10.0, 0.0)
    assert wheels.age_s(1.0) == math.inf
    assert wheels.problem == "never received"
    assert wheels.still_for_s(1.0, 10.0) is None


def test_wheels_stand_still_below_the_threshold_only() -> None:
    wheels, _ = _wheels(standstill_mps=0.25)
    slow, fast = _states([2.4, -2.4, 0.0, 0.0], [0.0] * 4), _states([0.0, 0.0, 0.0, -2.5], [0.0] * 4)
    wheels.received(JOINTS, *slow, 1.0)
    assert wheels.problem == ""
    wheels.received(JOINTS, *slow, 1.5)
    assert wheels.still_for_s(1.75, 0.5) == 0.75
    wheels.received(JOINTS, *fast, 2.0)
    assert wheels.still_for_s(2.0, 0.5) is None
    wheels.received(JOINTS, *slow, 2.5)
    assert wheels.still_for_s(2.75, 0.5) == 0.25


def test_unknown_or_standstill_twist_is_zero() -> None:
    wheels, _ = _wheels(standstill_mps=0.25)
    assert wheels.twist(1.0, 0.5) == ZERO_TWIST
    wheels.received(JOINTS, *_states([2.5] * 4, [0.0] * 4), 1.0)
    assert wheels.twist(1.5, 0.5).vx == 0.25  # at the threshold: motion; at the age limit: still valid
    assert wheels.twist(1.51, 0.5) == ZERO_TWIST
    assert wheels.twist(0.9, 0.5) == ZERO_TWIST
    wheels.received(JOINTS, *_states([2.4] * 4, [0.0] * 4), 2.0)
    assert wheels.twist(2.0, 0.5) == ZERO_TWIST


def test_a_wheel_that_moved_between_two_questions_starts_the_time_again() -> None:
    wheels, _ = _wheels()
    still, moving = _states([0.0] * 4, [0.0] * 4), _states([1.0] * 4, [0.0] * 4)
    wheels.received(JOINTS, *still, 1.0)
    assert wheels.still_for_s(1.0, 0.5) == 0.0
    wheels.received(JOINTS, *moving, 1.2)
    wheels.received(JOINTS, *still, 1.4)
    assert wheels.still_for_s(1.5, 0.5) == pytest.approx(0.1)


def test_old_wheel_speeds_are_no_standstill() -> None:
    wheels, _ = _wheels()
    wheels.received(JOINTS, *_states([0.0] * 4, [0.0] * 4), 1.0)
    assert wheels.still_for_s(1.5, 0.5) == 0.5
    assert wheels.still_for_s(1.51, 0.5) is None
    wheels.received(JOINTS, *_states([0.0] * 4, [0.0] * 4), 1.6)
    assert wheels.still_for_s(1.6, 0.5) == 0.0


def test_wheels_are_up_once_they_have_been_fresh_for_long_enough() -> None:
    wheels, _ = _wheels()
    still = _states([0.0] * 4, [0.0] * 4)
    for now_s in (1.0, 1.25, 1.5):
        wheels.received(JOINTS, *still, now_s)
        assert not wheels.up(True, now_s, 0.25, 1.0)
    assert not wheels.up(True, 1.76, 0.25, 1.0)  # after a gap
    for now_s in (2.0, 2.25, 2.5, 2.75):
        wheels.received(JOINTS, *still, now_s)
        assert not wheels.up(True, now_s, 0.25, 1.0)
    assert wheels.up(True, 3.0, 0.25, 1.0)
    assert wheels.up(False, 99.0, 0.25, 1.0)  # stays up; a later loss is a fault


def test_wheels_are_not_up_before_the_stack_is_complete() -> None:
    wheels, _ = _wheels()
    wheels.received(JOINTS, *_states([0.0] * 4, [0.0] * 4), 1.0)
    assert not wheels.up(False, 1.0, 10.0, 1.0)
    assert not wheels.up(False, 3.0, 10.0, 1.0)
    assert not wheels.up(True, 3.5, 10.0, 1.0)
    assert not wheels.up(True, 4.25, 10.0, 1.0)
    assert wheels.up(True, 4.5, 10.0, 1.0)


def test_bad_joint_states_leave_the_age_growing() -> None:
    wheels, _ = _wheels()
    position, velocity = _states([0.0] * 4, [0.0] * 4)
    wheels.received(JOINTS, position, velocity, 1.0)
    wheels.received(JOINTS, position, velocity[:-1], 2.0)
    assert wheels.age_s(3.0) == 2.0
    assert wheels.problem == "8 names, 8 positions, 7 velocities"


def test_longest_silence_is_reported_once() -> None:
    wheels, _ = _wheels()
    states = _states([0.0] * 4, [0.0] * 4)
    assert wheels.take_silence_s(1.0) == math.inf
    for now_s in (1.0, 1.5, 1.75):
        wheels.received(JOINTS, *states, now_s)
    assert wheels.take_silence_s(2.0) == 0.5
    assert wheels.take_silence_s(2.0) == 0.25


def test_there_is_no_silence_before_the_first_states() -> None:
    wheels, _ = _wheels()
    wheels.received(JOINTS, *_states([0.0] * 4, [0.0] * 4), 1.0)
    assert wheels.take_silence_s(1.25) == 0.25


@pytest.mark.parametrize(
    ("steer_rad", "drive_radps", "velocity"),
    [
        ([0.0] * 4, [10.0] * 4, (1.0, 0.0)),
        ([math.pi / 2] * 4, [10.0] * 4, (0.0, 1.0)),
        ([math.pi] * 4, [10.0] * 4, (-1.0, 0.0)),
        # turning on the spot with tangential modules: the velocities cancel
        ([0.75 * math.pi, 0.25 * math.pi, -0.75 * math.pi, -0.25 * math.pi], [10.0] * 4, (0.0, 0.0)),
        ([0.0, 0.0, math.pi / 2, math.pi / 2], [4.0, 8.0, 4.0, 8.0], (0.3, 0.3)),
    ],
)
def test_the_mean_of_the_modules_is_the_velocity_of_the_base(
    steer_rad: list[float], drive_radps: list[float], velocity: tuple[float, float]
) -> None:
    wheels, motion = _wheels()
    wheels.received(JOINTS, *_states(drive_radps, steer_rad), 1.0)
    seen = motion.at(1.0, 1.0)  # at 1 rad/s the acceleration is the velocity rotated by 90 deg
    assert (seen.y, -seen.x) == pytest.approx(velocity, abs=1e-9)


def test_joints_in_any_order() -> None:
    wheels, motion = _wheels()
    position, velocity = _states([1.0, 2.0, 3.0, 4.0], [0.0] * 4)
    order = [5, 2, 7, 0, 1, 4, 3, 6]
    names = ["arm", *(JOINTS[i] for i in order)]
    wheels.received(names, [9.0, *(position[i] for i in order)], [9.0, *(velocity[i] for i in order)], 1.0)
    assert wheels.problem == ""
    assert motion.at(1.0, 1.0).y == pytest.approx(0.25)
    assert wheels.still_for_s(1.0, 1.0) is None


@pytest.mark.parametrize(
    ("names", "position", "velocity", "problem"),
    [
        ((), (), (), f"joints are missing: {', '.join(JOINTS)}"),
        (JOINTS[:7], [0.0] * 7, [0.0] * 7, "joints are missing: rr_steer"),
        (JOINTS, [0.0] * 7, [0.0] * 8, "8 names, 7 positions, 8 velocities"),
        (JOINTS, [0.0] * 8, [], "8 names, 8 positions, 0 velocities"),
        (JOINTS, [0.0] * 7 + [math.nan], [0.0] * 8, "rr_steer is not finite"),
        (JOINTS, [0.0] * 8, [0.0, math.inf] + [0.0] * 6, "fl_steer is not finite"),
        (JOINTS, [0.0] * 8, [0.0] * 8, ""),
    ],
)
def test_joint_states_problem(names: list[str], position: list[float], velocity: list[float], problem: str) -> None:
    assert joint_states_problem(names, position, velocity) == problem


# --- IMU -------------------------------------------------------------------------------------------------------------


def _imu() -> tuple[ImuWatch, PlanarAcceleration]:
    motion = PlanarAcceleration(0.1, 2.5)
    return ImuWatch(UpDirection(2.0, 0.0, 0.3), motion, 3.0, 40.0, 10.0), motion


def test_imu_never_received() -> None:
    imu, _ = _imu()
    assert imu.age_s(1.0) == math.inf
    assert imu.problem == "never received"
    assert math.isnan(imu.inclination_rad(1.0, 1.0))


def test_imu_age_and_inclination() -> None:
    imu, _ = _imu()
    imu.received(ImuSample(5.0, 0.0, 5.0, 0.0, 0.0, 0.0), 1.0)
    assert imu.problem == ""
    assert imu.age_s(1.25) == 0.25
    assert imu.inclination_rad(1.25, 0.25) == pytest.approx(math.pi / 4)
    assert math.isnan(imu.inclination_rad(1.26, 0.25))


@pytest.mark.parametrize(
    ("sample", "problem"),
    [
        *((replace(STILL, **{name: math.nan}), "not finite") for name in ("ax", "ay", "az", "wx", "wy", "wz")),
        *((replace(STILL, **{name: math.inf}), "not finite") for name in ("ax", "wz")),
        (replace(STILL, az=2.9), "acceleration is not plausible"),
        (replace(STILL, az=40.1), "acceleration is not plausible"),
        (ImuSample(30.0, 30.0, 0.0, 0.0, 0.0, 0.0), "acceleration is not plausible"),
        (replace(STILL, wy=-10.1), "angular rate is not plausible"),
        (replace(STILL, wx=8.0, wz=8.0), "angular rate is not plausible"),
        (STILL, "frozen"),
        (replace(STILL, az=3.0), ""),
        (replace(STILL, az=-40.0), ""),
        (replace(STILL, wz=10.0), ""),
        (replace(STILL, wy=1e-12), ""),
    ],
)
def test_imu_samples_with_a_problem_do_not_reset_the_age(sample: ImuSample, problem: str) -> None:
    imu, _ = _imu()
    imu.received(STILL, 1.0)
    imu.received(sample, 2.0)
    assert imu.problem == problem
    assert imu.age_s(3.0) == (2.0 if problem else 1.0)


def test_imu_takes_the_robots_own_acceleration_off() -> None:
    imu, motion = _imu()
    motion.update(1.0, 0.0, 1.0)
    imu.received(ImuSample(0.0, 2.0, 9.81, 0.0, 0.0, 2.0), 1.0)
    assert imu.inclination_rad(1.0, 1.0) == pytest.approx(0.0, abs=1e-12)
    assert motion.at(2.0, 1.0) == Vector3(0.0, 2.0, 0.0)


# --- cameras ---------------------------------------------------------------------------------------------------------


def test_camera_timeout_is_raised_only_while_docking() -> None:
    cameras = CameraWatch(["front", "rear"])
    assert cameras.ages_s(1.0, 0.5) == {}
    cameras.received("rear", 1.0)
    cameras.docking(True, 2.0)
    assert cameras.ages_s(2.25, 0.5) == {"front": 0.25, "rear": 0.25}  # since the start of the search
    cameras.docking(True, 2.5)
    cameras.received("front", 2.75)
    assert cameras.ages_s(3.0, 0.5) == {"front": 0.25, "rear": 1.0}
    assert cameras.ages_s(3.01, 0.5) == {}  # the docking state is stale
    cameras.docking(False, 4.0)
    assert cameras.ages_s(4.0, 0.5) == {}
    cameras.docking(True, 5.0)
    assert cameras.ages_s(5.25, 0.5) == {"front": 0.25, "rear": 0.25}
