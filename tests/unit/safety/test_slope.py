"""Steepness and downhill direction: every limit at, below and above, and every course around the compass."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.contract.model import SafetyAction
from robot_stack.core.geometry import Twist2, wrap_angle
from robot_stack.core.limits import SpeedLimit
from robot_stack.safety.inputs import CLEAR, Finding, Level
from robot_stack.safety.slope import Points, SlopeWatch
from tests.unit.safety.story import PARAMS, ROBOT

P = PARAMS.descent
STEEP_DEG, EPSILON_DEG = 12.0, 1e-6
SLOW, DESCENT = SpeedLimit(0.3, 0.3), SpeedLimit(P.max_speed_mps, P.max_yaw_rate_radps)
UNKNOWN = Finding(Level.UNKNOWN)
bearings = st.floats(-math.pi, math.pi)


class Watch:
    """A slope watch updated once a second. Downhill is ahead by default."""

    def __init__(self, modules_m: Points | None = None) -> None:
        self._watch, self.now_s = SlopeWatch(PARAMS, modules_m or ROBOT.module_positions_m()), 10.0

    def __call__(self, deg: float, *motions: Twist2, downhill_rad: float = 0.0, after_s: float = 1.0) -> Finding:
        self.now_s += after_s
        return self._watch.judge(math.radians(deg), downhill_rad, motions, self.now_s)


def course(angle_rad: float, speed_mps: float = 0.3, omega: float = 0.0) -> Twist2:
    return Twist2(speed_mps * math.cos(angle_rad), speed_mps * math.sin(angle_rad), omega)


def limited(finding: Finding) -> SpeedLimit | None:
    assert finding.level is Level.PRESENT
    assert finding.action is (SafetyAction.STOP if finding.limit is None else SafetyAction.LIMIT)
    return finding.limit


def test_limits_with_their_hysteresis() -> None:
    watch, uphill = Watch(), Twist2(-0.3, 0.0, 0.0)
    assert watch(5.0, uphill) == CLEAR
    assert limited(watch(5.0 + EPSILON_DEG, uphill)) == SLOW
    assert limited(watch(4.5 + EPSILON_DEG, uphill)) == SLOW
    assert watch(4.5, uphill) == CLEAR
    assert watch(5.0, uphill) == CLEAR
    steep_deg = PARAMS.slope_stop_deg + PARAMS.slope_tolerance_deg + PARAMS.slope_hysteresis_deg
    assert steep_deg == 11.5
    assert limited(watch(steep_deg, uphill)) == SLOW
    assert limited(watch(11.5 + EPSILON_DEG, uphill)) is None
    assert limited(watch(11.0 + EPSILON_DEG, uphill)) is None
    assert limited(watch(11.0 - EPSILON_DEG, uphill)) == SLOW
    assert limited(watch(11.5 - EPSILON_DEG, uphill)) == SLOW
    assert watch(9.96, uphill).detail == "inclination 10.0 deg"


def test_an_unknown_inclination_keeps_a_limit_and_ends_a_descent() -> None:
    watch = Watch()
    assert watch(math.nan) == UNKNOWN
    watch(8.0)
    assert watch(math.nan) == UNKNOWN
    assert limited(watch(STEEP_DEG, course(0.0))) == DESCENT
    lost = watch(math.nan, course(0.0))
    assert (limited(lost), lost.detail) == (None, "the fall line is unknown on a steep slope")
    assert limited(watch(STEEP_DEG, course(0.0))) == DESCENT


def test_a_course_is_downhill_up_to_an_angle_and_a_little_more_once_under_way() -> None:
    off = math.radians(P.angle_deg)
    more = off + math.radians(P.angle_hysteresis_deg)
    for side in (1.0, -1.0):
        watch = Watch()
        assert limited(watch(STEEP_DEG, course(side * (off + 1e-6)))) is None
        assert limited(watch(STEEP_DEG, course(side * (more - 1e-6)))) is None
        assert limited(watch(STEEP_DEG, course(side * (off - 1e-6)))) == DESCENT
        assert limited(watch(STEEP_DEG, course(side * (more - 1e-6)))) == DESCENT
        assert limited(watch(STEEP_DEG, course(side * (more + 1e-6)))) is None
        assert limited(watch(STEEP_DEG, course(side * (more - 1e-6)))) is None


def test_standstill_ends_a_permitted_descent() -> None:
    watch, wide = Watch(), course(math.radians(P.angle_deg + 0.5 * P.angle_hysteresis_deg))
    watch(STEEP_DEG, course(0.0))
    assert limited(watch(STEEP_DEG, wide)) == DESCENT
    watch(STEEP_DEG)
    assert limited(watch(STEEP_DEG, wide)) is None


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize(("downhill_deg", "lever_m"), [(0.0, 0.25), (90.0, 0.30), (180.0, 0.25), (-90.0, 0.30)])
def test_a_turn_is_a_descent_only_while_no_wheel_rolls_uphill(turn: float, downhill_deg: float, lever_m: float) -> None:
    """The wheels are at x = +-0.3, y = +-0.25 m; a turn adds speed along the fall line with the lateral lever arm."""
    downhill_rad = math.radians(downhill_deg)
    assert limited(Watch()(STEEP_DEG, Twist2(0.0, 0.0, turn), downhill_rad=downhill_rad)) is None
    for share, expected in ((1.0 - 1e-9, DESCENT), (1.0 + 1e-9, None)):
        motion = course(downhill_rad, 0.2, share * turn * 0.2 / lever_m)
        assert limited(Watch()(STEEP_DEG, motion, downhill_rad=downhill_rad)) == expected


@pytest.mark.parametrize(("turn", "expected"), [(0.5, DESCENT), (0.5 + 1e-9, None), (-9.0, DESCENT)])
def test_a_wheel_that_stands_still_in_a_turn_rolls_not_uphill(turn: float, expected: SpeedLimit | None) -> None:
    """A left turn slows a wheel to the left of the course, and a right turn speeds it up."""
    assert limited(Watch(((0.0, 0.5),))(STEEP_DEG, Twist2(0.25, 0.0, turn))) == expected
    sideways = Watch(((-0.5, 0.0),))(STEEP_DEG, Twist2(0.0, 0.25, turn), downhill_rad=0.5 * math.pi)
    assert limited(sideways) == expected


def test_request_and_motion_must_both_lead_downhill() -> None:
    down, up = course(0.0), course(math.pi)
    found = Watch()(STEEP_DEG, down, down)
    assert (limited(found), found.detail) == (DESCENT, "inclination 12.0 deg, downhill")
    assert Watch()(STEEP_DEG, up).detail == "inclination 12.0 deg, the motion is not downhill"
    for motions in ((down, up), (up, down), (up, up), (up,)):
        assert limited(Watch()(STEEP_DEG, *motions)) is None


def test_robot_without_request_is_permitted_unless_recently_refused() -> None:
    watch = Watch()
    assert limited(watch(STEEP_DEG)) == DESCENT
    assert limited(watch(STEEP_DEG, course(math.pi))) is None
    refused = watch(STEEP_DEG, after_s=P.ask_again_s - 1e-3)
    assert (limited(refused), refused.detail) == (None, "inclination 12.0 deg, refused a motion that was not downhill")
    assert watch(STEEP_DEG, after_s=2e-3).detail == "inclination 12.0 deg, only downhill"
    watch(STEEP_DEG, course(math.pi))
    assert limited(watch(STEEP_DEG, after_s=P.ask_again_s)) == DESCENT
    assert limited(watch(STEEP_DEG, course(0.0))) == DESCENT
    watch(STEEP_DEG, course(math.pi))
    assert limited(watch(STEEP_DEG, course(0.0), after_s=0.02)) == DESCENT  # without a waiting time
    watch(STEEP_DEG, course(math.pi))
    assert limited(watch(STEEP_DEG, after_s=-5.0)) == DESCENT  # the clock jumped backwards; no motion is requested


@given(deg=st.floats(11.6, 80.0), downhill=bearings, heading=bearings, speed=st.floats(0.01, 2.0))
def test_only_downhill_motion_is_permitted(deg: float, downhill: float, heading: float, speed: float) -> None:
    found = Watch()(deg, course(heading, speed), downhill_rad=downhill)
    off_deg = abs(math.degrees(wrap_angle(heading - downhill)))
    if off_deg > P.angle_deg + 1e-6:
        assert limited(found) is None
    elif off_deg < P.angle_deg - 1e-6:
        assert limited(found) == DESCENT


@given(degs=st.lists(st.floats(0.0, 14.9), max_size=20), ramp=st.floats(9.0, 11.0), heading=bearings)
def test_no_history_traps_a_robot_at_10_deg(degs: list[float], ramp: float, heading: float) -> None:
    """After any earlier measurements, 10 deg measured with 1 deg of error is passable in any direction."""
    watch = Watch()
    for deg in degs:
        watch(deg, course(heading))
    assert limited(watch(ramp - EPSILON_DEG, course(heading))) == SLOW


@pytest.mark.parametrize("deg", [11.6, 14.9, 40.0])
@given(motions=st.lists(bearings, max_size=20))
def test_downhill_motion_is_permitted_after_any_history(deg: float, motions: list[float]) -> None:
    watch = Watch()
    for heading in motions:
        watch(deg, course(heading))
    assert limited(watch(deg, course(0.0))) == DESCENT
