"""A person crosses the path of a robot that drives on or brakes: when it must stop, and when it must slow down."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.geometry import ZERO_TWIST, Twist2, exp_se2
from robot_stack.safety.collision import Outline
from robot_stack.safety.pedestrian_collision import PedestrianCollision, PedestrianCollisionWatch, _along, _gaps
from tests.unit.safety.story import PARAMS, Story

P = PARAMS.pedestrian_collision
BODY = Outline(0.5, -0.5, 0.35)
BRAKE_MPS2 = 2.0
AHEAD, SLOW, BACK, TURN = Twist2(1.0, 0.0, 0.0), Twist2(0.3, 0.0, 0.0), Twist2(-0.5, 0.0, 0.0), Twist2(0.0, 0.0, 1.0)
FREE = math.inf


def who(x: float, y: float, vx: float, vy: float) -> NDArray[np.float64]:
    return np.array([[x, y, 0.8, vx, vy]])


NONE = np.empty((0, 5))


def judge(
    moving: NDArray[np.float64], request: Twist2 = AHEAD, does: Twist2 | None = None, nearest_m: float = 9.0
) -> PedestrianCollision:
    """Judges a robot that moves as requested, or with ``does`` if given."""
    watch = PedestrianCollisionWatch(P, BRAKE_MPS2)
    return watch.judge(moving, nearest_m, BODY, [request if does is None else does], request, 10.0)


def test_no_pedestrian_or_no_request_is_no_collision() -> None:
    assert judge(NONE) == PedestrianCollision()
    assert judge(who(0.6, 0.0, -1.0, 0.0), ZERO_TWIST) == PedestrianCollision()


def test_pedestrian_from_the_side_enters_the_predicted_footprint() -> None:
    """From 1 m/s the robot stops within 0.6 m. At 1.2 m/s a person 2.4 m to the side is in front of it after 1.7 s."""
    far, near = who(2.0, 2.4, 0.0, -1.2), who(1.0, 1.2, 0.0, -1.2)
    assert not judge(far).stop
    assert judge(near).stop


def test_the_nearer_the_slower_then_stop() -> None:
    limits = []
    for away_m in np.arange(3.0, 0.4, -0.1):
        found = judge(who(0.0, away_m + 0.35, 0.0, -1.5), SLOW)
        limits.append(0.0 if found.stop else found.speed_mps)
    assert limits[0] == FREE
    assert limits[-1] == 0.0
    assert limits == sorted(limits, reverse=True)
    assert any(0.0 < limit < SLOW.vx for limit in limits)


def test_standing_passing_and_leaving_pedestrians_are_ignored() -> None:
    for moving in (
        who(1.5, 0.9, -1.5, 0.0),  # passes 0.55 m to the side
        who(-1.5, -0.9, 1.6, 0.0),  # overtakes
        who(0.8, 0.0, 1.2, 0.0),  # walks ahead
        who(0.0, 0.6, 0.0, 1.0),  # leaves
    ):
        assert judge(moving, SLOW) == PedestrianCollision()


def test_pedestrian_following_at_equal_speed_causes_no_braking() -> None:
    assert judge(who(-0.9, 0.0, 1.0, 0.0)) == PedestrianCollision()
    assert judge(who(-1.0, 0.0, 1.8, 0.0)).stop  # runs into the robot


def test_pedestrian_running_into_a_reversing_or_turning_robot() -> None:
    assert judge(who(1.0, 0.0, -1.5, 0.0), BACK).stop
    assert judge(who(0.0, 1.0, 0.0, -1.0), TURN).stop
    assert judge(who(0.0, 2.5, 0.0, 1.0), TURN) == PedestrianCollision()


def test_actual_motion_is_evaluated_besides_the_request() -> None:
    """The robot is asked to reverse but still drives forward."""
    crossing = who(1.0, 0.7, 0.0, -1.0)
    assert judge(crossing, BACK, does=AHEAD).stop
    assert not judge(crossing, BACK, does=BACK).stop


def test_a_limit_is_of_the_footprints_fastest_place() -> None:
    turning = judge(who(0.0, 1.9, 0.0, -1.0), TURN)
    assert not turning.stop
    assert 0.0 < turning.speed_mps < BODY.reach()


def test_robot_waits_for_an_arrived_pedestrian_while_an_object_is_beside_it() -> None:
    watch = PedestrianCollisionWatch(P, BRAKE_MPS2)

    def stop(moving: NDArray[np.float64], nearest_m: float, now_s: float) -> bool:
        return watch.judge(moving, nearest_m, BODY, [SLOW], SLOW, now_s).stop

    assert stop(who(0.0, 0.8, 0.0, -1.0), 0.45, 10.0)
    assert stop(NONE, P.beside_m, 10.0 + P.hold_s - 0.01)
    assert not stop(NONE, P.beside_m + 0.01, 10.0 + P.hold_s - 0.01)
    assert not stop(NONE, 0.1, 10.0 + P.hold_s + 0.01)


@pytest.mark.parametrize(("jump_m", "waits"), [(P.leaves_m + 0.01, True), (P.leaves_m - 0.01, False)])
def test_robot_waits_for_an_arrived_body_that_is_lost_beside_it(jump_m: float, waits: bool) -> None:
    watch, lost_m = PedestrianCollisionWatch(P, BRAKE_MPS2), P.beside_m + 0.01

    def stop(moving: NDArray[np.float64], nearest_m: float, now_s: float) -> bool:
        return watch.judge(moving, nearest_m, BODY, [SLOW], SLOW, now_s).stop

    assert stop(who(0.0, 0.8, 0.0, -1.0), 0.45, 10.0)
    assert stop(NONE, lost_m - jump_m, 10.05)
    for now_s in (10.1, 10.0 + P.hold_s - 0.01):
        assert stop(NONE, lost_m, now_s) == waits
    assert not stop(NONE, lost_m, 10.0 + P.hold_s + 0.01)


def test_a_body_that_is_farther_by_exactly_as_much_has_left() -> None:
    watch = PedestrianCollisionWatch(P.model_copy(update={"leaves_m": 0.5, "beside_m": 0.5}), BRAKE_MPS2)
    assert watch.judge(who(0.0, 0.8, 0.0, -1.0), 0.25, BODY, [SLOW], SLOW, 10.0).stop
    assert not watch.judge(NONE, 0.75, BODY, [SLOW], SLOW, 10.05).stop


def test_a_body_that_is_found_again_may_leave_in_view() -> None:
    watch = PedestrianCollisionWatch(P, BRAKE_MPS2)
    assert watch.judge(who(0.0, 0.8, 0.0, -1.0), 0.08, BODY, [SLOW], SLOW, 10.0).stop
    assert watch.judge(NONE, math.inf, BODY, [SLOW], SLOW, 10.05).stop
    for nearest_m in (0.2, 0.5):
        assert watch.judge(NONE, nearest_m, BODY, [SLOW], SLOW, 10.1).stop
    assert not watch.judge(NONE, 0.8, BODY, [SLOW], SLOW, 10.15).stop


def test_a_body_lost_before_the_hold_is_none_of_the_next() -> None:
    watch = PedestrianCollisionWatch(P, BRAKE_MPS2)
    assert watch.judge(who(0.0, 0.8, 0.0, -1.0), 0.08, BODY, [SLOW], SLOW, 10.0).stop
    assert not watch.judge(NONE, 9.0, BODY, [SLOW], SLOW, 20.0).stop
    assert watch.judge(who(0.0, 0.8, 0.0, -1.0), 9.0, BODY, [SLOW], SLOW, 20.05).stop
    assert not watch.judge(NONE, 9.0, BODY, [SLOW], SLOW, 20.1).stop


def test_robot_does_not_wait_for_a_distant_pedestrian() -> None:
    watch = PedestrianCollisionWatch(P, BRAKE_MPS2)
    assert watch.judge(who(2.4, 0.0, -2.0, 0.0), 9.0, BODY, [AHEAD], AHEAD, 10.0).stop
    assert not watch.judge(NONE, 0.2, BODY, [AHEAD], AHEAD, 10.1).stop


def test_exactly_the_time_to_go_on_is_still_waited() -> None:
    watch = PedestrianCollisionWatch(P.model_copy(update={"hold_s": 4.0}), BRAKE_MPS2)
    assert watch.judge(who(0.0, 0.8, 0.0, -1.0), 0.45, BODY, [SLOW], SLOW, 10.0).stop
    assert watch.judge(NONE, 0.45, BODY, [SLOW], SLOW, 14.0).stop
    assert not watch.judge(NONE, 0.45, BODY, [], Twist2(1e-9, 0.0, 0.0), 14.0).stop  # no motion requested


@pytest.mark.parametrize(("nearer_m", "comes"), [(0.01, True), (-0.01, False)])
def test_pedestrian_arriving_soon_counts_as_arrived(nearer_m: float, comes: bool) -> None:
    """Within ahead_s, including the drift margin."""
    watch = PedestrianCollisionWatch(P, BRAKE_MPS2)
    away_m = P.margin_m + (0.8 + P.drift_mps) * P.ahead_s - nearer_m
    watch.judge(who(0.0, 0.35 + away_m, 0.0, -0.8), 9.0, BODY, [], ZERO_TWIST, 10.0)
    assert watch.judge(NONE, 0.5, BODY, [SLOW], SLOW, 10.1).stop is comes


def driven_m(speed_mps: float, brakes_s: float, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the distance driven at each time by numerical integration, (k,) m."""
    step_s = 1e-4
    at_s = np.arange(0.0, seconds[-1] + step_s, step_s)
    speeds = np.clip(speed_mps - BRAKE_MPS2 * np.maximum(at_s - brakes_s, 0.0), 0.0, None)
    return np.asarray(np.interp(seconds, at_s, np.concatenate([[0.0], np.cumsum(speeds[:-1]) * step_s])))


@pytest.mark.parametrize("share", [1.0, 0.6, 0.2])
@pytest.mark.parametrize("brakes_s", [0.0, P.reaction_s, P.reaction_s + P.ahead_s])
@pytest.mark.parametrize("full_mps", [1.5, 1.0, 0.4])
def test_a_robot_that_brakes_gets_as_far_as_its_brakes_let_it(full_mps: float, brakes_s: float, share: float) -> None:
    """A person stands or walks ahead, 1 cm nearer or farther than the braking distance."""
    watch, twist, speed_mps = PedestrianCollisionWatch(P, BRAKE_MPS2), Twist2(full_mps, 0.0, 0.0), share * full_mps
    times = np.arange(0.0, brakes_s + speed_mps / BRAKE_MPS2 + P.step_s, P.step_s)
    for walks_mps in (0.0, 0.1, 0.3):
        needs_m = driven_m(speed_mps, brakes_s, times) - walks_mps * times + P.margin_m + P.drift_mps * times
        for spare_m, touched in ((-0.01, True), (0.01, False)):
            away = who(BODY.front + float(needs_m.max()) + spare_m, 0.0, walks_mps, 0.0)
            assert watch._touches(away, BODY, twist, share, brakes_s) is touched


@pytest.mark.parametrize(("speed_mps", "stops"), [(1.2, False), (6.0, True)])
def test_the_course_of_a_fast_body_is_uncertain_by_more(speed_mps: float, stops: bool) -> None:
    """It passes 0.4 m beside a slow robot and gets there in 0.7 s."""
    passing = who(BODY.front + 0.7 * speed_mps, BODY.half + 0.4, -speed_mps, 0.0)
    assert judge(passing, SLOW).stop is stops


@pytest.mark.parametrize("from_rad", [0.0, 0.5 * math.pi, math.pi])
def test_a_fast_body_on_a_collision_course_stops_the_robot_in_time(from_rad: float) -> None:
    """At 7 m/s and the robot's full speed, the last moment to brake is 1.1 s before the contact."""
    full, c, s = Twist2(1.5, 0.0, 0.0), math.cos(from_rad), math.sin(from_rad)
    comes_s = P.reaction_s + full.vx / BRAKE_MPS2
    way_m = 0.5 * full.vx**2 / BRAKE_MPS2 + full.vx * P.reaction_s
    away_m = 7.0 * (comes_s + 0.05) + 0.35
    assert judge(who(way_m + away_m * c, away_m * s, -7.0 * c, -7.0 * s), full).stop


def test_a_margin_counts_as_touched() -> None:
    watch = PedestrianCollisionWatch(P.model_copy(update={"margin_m": 0.125, "drift_mps": 0.0}), BRAKE_MPS2)
    assert watch._arrives(who(0.0, 0.625, 0.0, 0.0), Outline(0.5, -0.5, 0.5))
    assert watch._touches(who(0.0, 0.625, 0.0, 0.0), Outline(0.5, -0.5, 0.5), SLOW, 1.0, 0.0)
    assert not watch._touches(who(0.0, 0.626, 0.0, 0.0), Outline(0.5, -0.5, 0.5), SLOW, 1.0, 0.0)


def test_twist_of_rounding_error_causes_no_collision() -> None:
    assert judge(who(0.5, 0.0, 0.0, 0.0), Twist2(1e-9, 0.0, 0.0)) == PedestrianCollision()


def test_the_limit_is_the_greatest_speed_from_which_a_stop_need_not_be_now() -> None:
    found = set()
    for away_m in np.arange(3.0, 0.4, -0.05):
        moving = who(away_m, 0.0, -0.3, 0.0)
        limit = judge(moving, AHEAD)
        if limit.stop or limit.speed_mps == FREE:
            continue
        steps = round(limit.speed_mps / AHEAD.vx * P.shares)
        found.add(steps)
        watch = PedestrianCollisionWatch(P, BRAKE_MPS2)
        for faster in range(steps + 1, P.shares + 1):
            assert watch._touches(moving, BODY, AHEAD, faster / P.shares, P.reaction_s + P.ahead_s)
            assert watch._touches(moving, BODY, AHEAD, faster / P.shares, None)
    assert found >= {2, 3, 4}


def test_actual_motion_is_evaluated_at_its_speed() -> None:
    """At twice its speed the robot would touch the person ahead, whether standing or walking."""
    assert not judge(who(1.4, 0.0, 0.0, 0.0), BACK, does=AHEAD).stop
    behind_and_ahead = np.concatenate([who(-0.9, 0.0, 1.0, 0.0), who(1.0, 0.0, 1.5, 0.0)])
    assert not judge(behind_and_ahead, ZERO_TWIST, does=AHEAD).stop


@given(st.floats(-1.5, 1.5), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.0, 3.0))
def test_path_of_a_twist(vx: float, vy: float, omega: float, seconds: float) -> None:
    twist = Twist2(vx, vy, omega)
    x, y, turned = _along(twist, np.array([seconds]))
    expected = exp_se2(twist, seconds)
    assert (x[0], y[0]) == pytest.approx((expected.x, expected.y), abs=1e-9)
    assert turned[0] == pytest.approx(omega * seconds)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_gaps_are_those_of_the_outline_at_each_moment(vx: float, vy: float, omega: float, x: float, y: float) -> None:
    twist, times = Twist2(vx, vy, omega), np.array([0.0, 0.7, 1.4])
    found = _gaps(who(x, y, 0.3, -0.4), BODY, twist, times, times)[0]
    for seconds, gap_m in zip(times, found, strict=True):
        pose = exp_se2(twist, float(seconds))
        dx, dy = x + 0.3 * seconds - pose.x, y - 0.4 * seconds - pose.y
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        there = np.array([[c * dx + s * dy, c * dy - s * dx]])
        assert gap_m == pytest.approx(BODY.distances(there)[0], abs=1e-9)


def test_monitor_slows_and_stops_for_a_pedestrian_from_the_side() -> None:
    story = Story().healthy()
    story.request = story.driven = SLOW
    story.run(0.2).expect(SafetyState.NORMAL)
    story.moving = who(0.0, 1.81, 0.0, -1.3).astype(np.float32)
    story.run(0.1).expect(SafetyState.COLLISION_AVOIDANCE, ["OBSTACLE_NEAR"])
    assert 0.0 < story.verdict.limit.linear_mps < SLOW.vx
    assert story.monitor.details["OBSTACLE_NEAR"] == "pedestrian approaching"
    story.moving = who(0.0, 0.9, 0.0, -1.3).astype(np.float32)
    story.run(0.1)
    assert story.verdict.action is SafetyAction.STOP
    assert story.verdict.limit.is_hard_stop()
    assert story.monitor.details["COLLISION_IMMINENT"] == "pedestrian entering the path"
    story.moving = np.empty((0, 5), np.float32)
    story.run(1.0).expect(SafetyState.NORMAL)


def test_without_moving_cloud_the_unseen_limit_applies() -> None:
    story = Story().healthy()
    story.request = story.driven = AHEAD
    story.run(0.2)
    assert story.verdict.limit.linear_mps > 1.0
    story.moving = None
    story.run(0.5)
    assert story.verdict.limit.linear_mps == pytest.approx(PARAMS.collision.unseen_mps)
    assert story.verdict.limit.codes == ("WAY_UNSEEN",)
    story.moving = np.array([[math.nan] * 5], np.float32)
    story.run(0.5)
    assert story.verdict.limit.codes == ("WAY_UNSEEN",)
