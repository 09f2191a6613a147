"""A module that does not follow its steering command, and wheel speeds that contradict each other."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract import topics
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.safety.dead_reckoning import Modules
from robot_stack.safety.inputs import CLEAR, Level
from robot_stack.safety.steering_watch import SteeringWatch
from tests.unit.safety.story import PARAMS, ROBOT, TICK_S, Story

P = PARAMS.steering
MODULES = Modules(ROBOT.module_positions_m(), ROBOT.wheel_radius_m)
STALE_S = topics.WHEEL_COMMANDS.stale_limit_s
TURNED = math.radians(51.0)
TINY = 1e-6


def watch() -> SteeringWatch:
    return SteeringWatch(P, MODULES, PARAMS.standstill_mps, STALE_S)


def held(commanded: list[float], speeds: list[float], angles: list[float], for_s: float) -> str:
    """Returns the finding after this state has lasted for ``for_s``."""
    found = watch()
    for now_s in (0.0, for_s):
        found.commanded(commanded, now_s)
        found.measured(speeds, angles)
        finding = found.judge(now_s)
    if finding == CLEAR:
        return ""
    assert (finding.level, finding.action) == (Level.PRESENT, SafetyAction.EMERGENCY_STOP)
    return finding.detail


def test_one_module_is_stuck_where_the_others_have_turned() -> None:
    stuck = [0.0, TURNED, TURNED, TURNED]
    detail = held([TURNED] * 4, [0.2] * 4, stuck, 0.51)
    assert detail == "fl_steer is 51 deg off"
    detail = held([TURNED] * 4, [0.64] * 4, stuck, 0.51)
    assert detail.startswith("fl_steer is 51 deg off, a wheel differs by 0.")
    assert held([TURNED] * 4, [0.64] * 4, stuck, P.hold_s) == ""


@pytest.mark.parametrize("module", range(4))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_limit_of_the_angle(module: int, sign: float) -> None:
    for off, wrong in ((P.angle_rad - TINY, False), (P.angle_rad + TINY, True)):
        commanded = [0.0] * 4
        commanded[module] = sign * off
        assert bool(held(commanded, [-0.2] * 4, [0.0] * 4, 0.51)) == wrong


def test_whole_turns_are_no_difference() -> None:
    assert held([math.pi] * 4, [0.5] * 4, [-math.pi, math.pi, 3 * math.pi, -7 * math.pi], 0.51) == ""


@pytest.mark.parametrize(("faster_mps", "judged"), [(-TINY, False), (0.0, True)])
def test_a_standing_robot_turns_its_modules(faster_mps: float, judged: bool) -> None:
    speed_mps = PARAMS.standstill_mps + faster_mps
    assert bool(held([TURNED] * 4, [0.0, 0.0, -speed_mps, 0.0], [0.0] * 4, 0.51)) == judged


def test_the_limit_of_the_disagreement() -> None:
    """If one wheel is faster by d, the mean takes d/4 and the rotation a share that depends on the wheel's position."""
    speeds = [0.5, 0.5, 0.5, 0.5]
    step = MODULES.disagreement_mps([1.5, 0.5, 0.5, 0.5], [0.0] * 4) / 1.0
    assert MODULES.disagreement_mps(speeds, [0.0] * 4) == pytest.approx(0.0)
    for by, wrong in ((-TINY, False), (TINY, True)):
        speeds[0] = 0.5 + (P.disagreement_mps + by) / step
        assert bool(held([0.0] * 4, speeds, [0.0] * 4, 0.51)) == wrong


def test_a_turn_and_a_crab_course_are_no_disagreement() -> None:
    for vx, vy, omega in ((0.5, 0.3, 0.0), (0.0, 0.0, 1.0), (0.4, -0.2, -0.8)):
        wheels = [(vx - omega * y, vy + omega * x) for x, y in ROBOT.module_positions_m()]
        speeds, angles = [math.hypot(*v) for v in wheels], [math.atan2(v[1], v[0]) for v in wheels]
        assert MODULES.disagreement_mps(speeds, angles) == pytest.approx(0.0, abs=1e-9)
        assert held(angles, speeds, angles, 0.51) == ""


def test_commands_that_are_old_or_no_commands_are_not_compared() -> None:
    for bad in ([], [0.0] * 3, [math.nan, 0.0, 0.0, 0.0]):
        assert held(bad, [0.2] * 4, [TURNED] * 4, 0.51) == ""
    found = watch()
    found.commanded([0.0] * 4, 0.0)
    found.measured([0.2] * 4, [TURNED] * 4)
    assert found.judge(0.0) == CLEAR
    assert found.judge(STALE_S) == CLEAR
    found.commanded([0.0] * 4, 0.51)
    assert found.judge(0.51).level is Level.PRESENT  # no interruption
    assert found.judge(0.51 + STALE_S + TINY) == CLEAR


def test_missing_measurement_is_no_fault() -> None:
    found = watch()
    found.commanded([0.0] * 4, 0.0)
    assert found.judge(0.0) == CLEAR


def test_a_stuck_module_ends_the_ride_until_a_reset() -> None:
    story = Story().healthy()
    story.wheel_radps = 0.5 / ROBOT.wheel_radius_m
    ticks = round(P.hold_s / TICK_S)
    for _ in range(ticks - 1):
        story.monitor.observation.steering.commanded([0.0, 0.0, 0.0, 1.0], story.now_s)
        story.tick().expect(SafetyState.NORMAL, ())
    for _ in range(4):
        story.monitor.observation.steering.commanded([0.0, 0.0, 0.0, 1.0], story.now_s)
        story.tick()
    story.expect(SafetyState.EMERGENCY_STOP, ("STEERING_FAULT",))
    story.wheel_radps = 0.0
    story.run(1.0).expect(SafetyState.EMERGENCY_STOP, ("STEERING_FAULT",))
    assert story.reset().success
