"""The drive's set point: starting, turning, stopping, holding; modules stay within their limits."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import STANDSTILL, MotionLimits
from robot_stack.drive.arbitration import Command
from robot_stack.drive.kinematics import ZEROS, Four, fastest_wheel_mps, wheel_velocities, x_lock_angles
from robot_stack.drive.swerve_drive import DriveOutput, DriveState, SwerveDrive
from tests.unit.drive.robot import EMPTY, MODULE_LIMITS, PARAMS, POSITIONS, TICK_S, WITH_PASSENGER, new_drive

FORWARD, LEFT = Twist2(1.0, 0.0, 0.0), Twist2(0.0, 1.0, 0.0)
moderate = st.floats(-2.0, 2.0)
twists = st.builds(Twist2, moderate, moderate, moderate)


class Story:
    """A drive whose modules follow their set points at once, in fake time."""

    def __init__(self, measured: Four | None = ZEROS) -> None:
        self.drive: SwerveDrive = new_drive()
        self.output: DriveOutput = self.drive.halt(measured)
        self.ideal = measured is not None

    def ride(self, requested: Twist2, seconds: float, limits: MotionLimits = EMPTY, **how: bool) -> list[DriveOutput]:
        outputs = []
        for _ in range(round(seconds / TICK_S)):
            measured = self.output.modules.angles_rad if self.ideal else None
            self.output = self.drive.step(
                Command(requested), limits, TICK_S, measured, **{"standing": requested == ZERO_TWIST, **how}
            )
            outputs.append(self.output)
        return outputs


def close(a: Twist2, b: Twist2, tolerance: float = 1e-9) -> bool:
    return max(abs(a.vx - b.vx), abs(a.vy - b.vy), abs(a.omega - b.omega)) <= tolerance


def slip_mps(output: DriveOutput) -> float:
    """Returns the largest difference between a wheel's commanded velocity and that of the body's twist there."""
    needed = wheel_velocities(POSITIONS, output.twist)
    pairs = zip(output.modules.speeds_mps, output.modules.angles_rad, needed, strict=True)
    return max(math.hypot(v * math.cos(a) - x, v * math.sin(a) - y) for v, a, (x, y) in pairs)


def test_forward_and_back_turn_no_module():
    story = Story()
    for sign, seconds in ((1.0, 2.0), (-1.0, 4.0)):
        outputs = story.ride(FORWARD.scaled(sign), seconds)
        assert all(output.modules.angles_rad == ZEROS for output in outputs)
        assert story.output.modules.speeds_mps == pytest.approx((sign,) * 4)


def test_sideways_from_rest_turns_the_modules_first():
    story = Story()
    outputs = story.ride(LEFT, 0.3)
    assert outputs[0].state is DriveState.ALIGNING
    for output in outputs:
        if output.state is DriveState.ALIGNING:
            assert output.twist == ZERO_TWIST
            assert output.modules.speeds_mps == ZEROS
    story.ride(LEFT, 2.0)
    assert close(story.output.twist, LEFT)
    assert story.output.modules.angles_rad == pytest.approx((math.pi / 2,) * 4)


def test_too_fast_twist_is_scaled_uniformly():
    story = Story()
    story.ride(Twist2(30.0, 40.0, 5.0), 5.0)
    assert close(story.output.twist, Twist2(0.9, 1.2, 0.15), 1e-6)


def test_limit_of_zero_ramps_to_a_stop():
    story = Story()
    story.ride(FORWARD, 2.0)
    outputs = story.ride(FORWARD, 3.0, EMPTY.slower(STANDSTILL))
    assert outputs[0].twist.vx > 0.9  # a ramp, no step
    assert story.output.twist == ZERO_TWIST
    assert all(close(output.twist, Twist2(output.twist.vx, 0.0, 0.0)) for output in outputs)


def test_tiny_twist_is_ignored():
    story = Story()
    assert story.ride(Twist2(0.0009, 0.0, 0.0019), 0.5)[-1].state is DriveState.HOLDING
    assert story.ride(Twist2(0.002, 0.0, 0.0), 1.0)[-1].twist == Twist2(0.002, 0.0, 0.0)


@given(st.lists(twists, min_size=1, max_size=5), st.sampled_from([EMPTY, WITH_PASSENGER]))
@example(  # a wheel within the hysteresis beyond 90 degrees stands, so all of its speed is slip
    [
        Twist2(0.30078125, 0.0, 0.0),
        Twist2(-0.421875, 0.0, 0.0),
        Twist2(0.0, -0.365234375, 1.17578125),
        Twist2(-1.0, -1.5, 2.0),
    ],
    WITH_PASSENGER,
)
@example([Twist2(2.0, 0.0, 1.0), Twist2(2.0, 0.0, 0.0)], EMPTY)  # the target jumps while the robot accelerates
@settings(deadline=None, max_examples=80)
def test_modules_are_never_asked_for_the_impossible(requests: list[Twist2], limits: MotionLimits):
    story = Story(measured=None)  # only the set points, without the cosine for a lagging axis
    before = story.output
    rates = [0.0] * 4
    for requested in requests:
        for output in story.ride(requested, 1.5, limits):
            assert output.twist.is_finite()
            assert output.twist.speed() <= limits.speed_mps + 1e-9
            assert fastest_wheel_mps(POSITIONS, output.twist) <= MODULE_LIMITS.max_wheel_speed_mps + 1e-9
            for i in range(4):
                turned = math.remainder(output.modules.angles_rad[i] - before.modules.angles_rad[i], 2 * math.pi)
                rate, rates[i] = rates[i], turned / TICK_S
                assert abs(rates[i]) <= MODULE_LIMITS.max_steering_rate_radps + 1e-6
                assert abs(rates[i] - rate) <= MODULE_LIMITS.max_steering_acceleration_radps2 * TICK_S + 1e-6
                assert -math.pi <= output.modules.angles_rad[i] <= math.pi
            if output.state is DriveState.DRIVING:
                assert slip_mps(output) <= MODULE_LIMITS.slip_tolerance_mps + 1e-9
                for old, new in zip(before.modules.speeds_mps, output.modules.speeds_mps, strict=True):
                    assert abs(new - old) <= MODULE_LIMITS.max_wheel_acceleration_mps2 * TICK_S + 1e-6
            before = output


@given(st.lists(twists, min_size=1, max_size=4), twists)
@settings(deadline=None, max_examples=60)
def test_every_wish_is_reached(before: list[Twist2], requested: Twist2):
    """For any previous motion: no command makes the modules block each other for ever."""
    story = Story()
    for other in before:
        story.ride(other, 0.7)
    story.ride(requested, 15.0)
    speed, yaw_rate = requested.speed(), abs(requested.omega)
    factor = min(1.0, 1.5 / speed if speed else 1.0, 1.0 / yaw_rate if yaw_rate else 1.0)
    target = requested.scaled(factor)
    at_rest = target.speed() < PARAMS.drive.rest_speed_mps and abs(target.omega) < PARAMS.drive.rest_yaw_rate_radps
    assert close(story.output.twist, ZERO_TWIST if at_rest else target, 1e-6)


def test_lagging_module_is_driven_by_the_cosine():
    story = Story()
    story.ride(FORWARD, 2.0)
    measured = (math.radians(60.0), 0.0, math.radians(120.0), 4 * math.pi)
    output = story.drive.step(Command(FORWARD), EMPTY, TICK_S, measured, standing=False)
    assert output.modules.speeds_mps == pytest.approx((0.5, 1.0, 0.0, 1.0))


def test_module_that_does_not_turn_keeps_the_robot_standing_and_is_named():
    story = Story()
    for _ in range(60):
        angles = story.output.modules.angles_rad
        measured = (angles[0], 0.0, angles[2], angles[3])  # FR is stuck at 0
        story.output = story.drive.step(Command(LEFT), EMPTY, TICK_S, measured, standing=True)
        assert story.output.twist == ZERO_TWIST
    assert story.output.stuck == (1,)


def test_halt_is_zero_at_once_and_the_next_start_gentle():
    story = Story()
    story.ride(FORWARD, 2.0)
    story.output = story.drive.halt((0.1, 0.2, 0.3, 7.0))
    assert story.output.twist == ZERO_TWIST
    assert story.output.modules.speeds_mps == ZEROS
    assert story.output.modules.angles_rad == pytest.approx((0.1, 0.2, 0.3, 7.0 - 2 * math.pi))
    story.output = story.drive.halt(ZEROS)
    assert story.ride(FORWARD, TICK_S)[0].twist.vx <= EMPTY.jerk_mps3 * TICK_S * TICK_S + 1e-9


@pytest.mark.parametrize("bad", [Twist2(math.nan, 0.0, 0.0), Twist2(1.0, math.inf, 0.0), Twist2(1.0, 0.0, -math.inf)])
def test_wish_that_is_not_finite_is_standstill(bad: Twist2):
    story = Story()
    story.ride(FORWARD, 2.0)
    twist = story.ride(bad, TICK_S)[0].twist
    assert twist.is_finite()
    assert twist.vx < 1.0


def test_braking_uses_the_emergency_deceleration_whatever_is_wished():
    story = Story()
    story.ride(FORWARD, 2.0)
    outputs = story.ride(FORWARD, 0.5, WITH_PASSENGER, braking=True)
    assert [output.twist.vx for output in outputs] == pytest.approx(
        [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0], abs=1e-9
    )
    assert outputs[-1].twist == ZERO_TWIST


def test_may_brake_only_while_driving_without_braking():
    story = Story()
    assert not story.drive.may_brake
    story.ride(FORWARD, 1.0)
    assert story.drive.may_brake
    story.ride(FORWARD, TICK_S, braking=True)
    assert not story.drive.may_brake
    story.ride(FORWARD, TICK_S)
    assert story.drive.may_brake


def test_step_without_time_changes_nothing():
    story = Story()
    story.ride(FORWARD, 1.0)
    for dt_s in (0.0, -1.0, math.nan):
        output = story.drive.step(Command(LEFT), EMPTY, dt_s, ZEROS, standing=False)
        assert output.twist == story.output.twist


def test_late_step_makes_no_leap():
    story = Story()
    story.ride(FORWARD, 0.5)
    before = story.output.twist.vx
    output = story.drive.step(Command(FORWARD), EMPTY, 5.0, ZEROS, standing=False)
    assert output.twist.vx - before <= EMPTY.acceleration_mps2 * PARAMS.drive.longest_step_s + 1e-9


def test_headings_are_kept_at_rest():
    story = Story()
    story.ride(LEFT, 2.0)
    story.ride(ZERO_TWIST, 3.0)
    assert story.output.state is DriveState.HOLDING
    assert story.output.modules.angles_rad == pytest.approx((math.pi / 2,) * 4)


def test_wheels_cross_after_a_time_at_rest_and_uncross_before_driving():
    story = Story()
    story.ride(ZERO_TWIST, PARAMS.drive.x_lock_after_s - 0.2)
    assert story.output.modules.angles_rad == ZEROS
    story.ride(ZERO_TWIST, 1.5)
    assert story.output.state is DriveState.LOCKED
    assert story.output.modules.speeds_mps == ZEROS
    for angle, crossed in zip(story.output.modules.angles_rad, x_lock_angles(POSITIONS), strict=True):
        assert math.remainder(angle - crossed, math.pi) == pytest.approx(0.0, abs=1e-9)
    first = story.ride(FORWARD, TICK_S)[0]
    assert first.state is DriveState.ALIGNING
    assert first.modules.speeds_mps == ZEROS
    story.ride(FORWARD, 2.0)
    assert close(story.output.twist, FORWARD)


def test_wheels_do_not_cross_while_something_pushes_the_robot():
    story = Story()
    story.ride(ZERO_TWIST, 2 * PARAMS.drive.x_lock_after_s, standing=False)
    assert story.output.state is DriveState.HOLDING


def test_a_sampled_course_is_carried_on_to_now():
    """Commands 20 ms old that grow by 0.5 m/s2: the set point is extrapolated to the end of the step."""
    drive = new_drive()
    drive.halt(ZEROS)
    for k in range(60):
        now_s = k * TICK_S
        course = Command(Twist2(0.5 * (now_s - 0.02), 0.0, 0.0), Twist2(0.5, 0.0, 0.0), 0.02)
        output = drive.step(course, EMPTY, TICK_S, ZEROS, standing=False)
    assert output.twist.vx == pytest.approx(0.5 * (now_s + TICK_S), abs=1e-6)
