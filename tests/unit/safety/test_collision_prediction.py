"""The motions that are judged, and the permitted speed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.safety.collision import FREE, Approach, Outline
from robot_stack.safety.collision_prediction import (
    CollisionPrediction,
    ground_limit_mps,
    look_ahead,
    onto_no_ground,
    seen_limit_mps,
    speed_limit_mps,
)
from robot_stack.safety.commands import CommandWatch
from robot_stack.safety.lidar_watch import LidarWatch
from tests.unit.safety.story import PARAMS, ROBOT, SWEEP

P, RIDE = PARAMS.collision, ROBOT.with_passenger
BODY, WIDENED = Outline(0.5, -0.5, 0.35), Outline(0.5, -0.5, 0.35)
AHEAD, BACK, TURN = Twist2(0.5, 0.0, 0.0), Twist2(-0.5, 0.0, 0.0), Twist2(0.0, 0.0, 0.3)
POLE = np.array([[1.5, 0.0, 1.0]])
POLE_AHEAD = Approach(2.0, 1.0)
NOTHING = np.empty((0, 3))


def look(
    measured: Twist2 = ZERO_TWIST,
    driven: Twist2 | None = ZERO_TWIST,
    requested: Twist2 = ZERO_TWIST,
    points: NDArray[np.float64] = POLE,
    unseen: NDArray[np.float64] | None = NOTHING,
) -> CollisionPrediction:
    return look_ahead(points, unseen, BODY, WIDENED, measured, driven, requested, P, 2.0, RIDE)


def test_robot_at_standstill_without_request_has_no_collision() -> None:
    assert look() == CollisionPrediction(FREE, FREE, FREE, 1.0, pytest.approx(math.hypot(0.5, 0.35)), 2.0, RIDE)
    assert look(points=np.empty((0, 3))).nearest_m == math.inf


def test_faster_is_base_link_or_the_farthest_corner_as_measured() -> None:
    corner_mps = 0.3 * math.hypot(0.5, 0.35)
    assert look(driven=AHEAD, requested=AHEAD).no_faster_than(0.0)
    for measured, speed_mps in ((BACK, 0.5), (TURN, corner_mps), (Twist2(-0.1, 0.0, -0.3), corner_mps)):
        assert look(measured=measured).no_faster_than(speed_mps + 1e-9)
        assert not look(measured=measured).no_faster_than(speed_mps - 1e-9)
    assert not look(measured=TURN).worse(replace(look(), reach_m=1.0)).no_faster_than(0.29)
    assert not replace(look(), measured=Twist2(0.0, 0.0, math.nan)).no_faster_than(1.0)


def test_standstill_has_no_collision_even_with_touching_points() -> None:
    touching = np.array([[0.5, 0.0, 1.0]])
    assert look(measured=Twist2(P.rest_mps, 0.0, 0.0), points=touching).moving == FREE
    assert look(measured=Twist2(P.rest_mps + 1e-6, 0.0, 0.0), points=touching).moving != FREE


def test_measured_and_commanded_motion_count_each() -> None:
    assert look(measured=AHEAD).moving == POLE_AHEAD
    assert look(driven=AHEAD).moving == POLE_AHEAD
    assert look(measured=BACK, driven=AHEAD).moving == POLE_AHEAD
    assert look(measured=AHEAD, driven=BACK).moving == POLE_AHEAD
    assert look(measured=BACK, driven=BACK).moving == FREE


def test_a_wish_counts_beside_only_while_the_drive_holds_the_robot() -> None:
    held = look(requested=AHEAD)
    assert (held.moving, held.wanted) == (FREE, POLE_AHEAD)
    assert (held.time_s, held.clearance_m) == (2.0, 1.0)
    assert look(driven=BACK, requested=AHEAD).wanted == FREE
    assert look(driven=Twist2(-P.rest_mps, 0.0, 0.0), requested=AHEAD).wanted == POLE_AHEAD
    assert look(driven=Twist2(-P.rest_mps - 1e-6, 0.0, 0.0), requested=AHEAD).wanted == FREE
    assert look(driven=Twist2(0.0, 0.0, P.rest_radps), requested=AHEAD).wanted == POLE_AHEAD
    assert look(driven=Twist2(0.0, 0.0, -P.rest_radps - 1e-6), requested=AHEAD).wanted == FREE


def test_a_silent_drive_is_judged_by_the_wish() -> None:
    silent = look(driven=None, requested=AHEAD)
    assert (silent.moving, silent.wanted) == (POLE_AHEAD, FREE)


def test_margin_widens_the_swept_path_and_not_the_distance() -> None:
    beside = np.array([[1.5, 0.38, 1.0]])
    found = look_ahead(
        beside, NOTHING, BODY, Outline(0.55, -0.55, 0.4, 0.05), ZERO_TWIST, AHEAD, ZERO_TWIST, P, 2.0, RIDE
    )
    assert found.moving.clearance_m == pytest.approx(1.0)
    assert found.nearest_m == pytest.approx(math.hypot(1.0, 0.03))
    assert look(driven=AHEAD, points=beside).moving == FREE


@pytest.mark.parametrize(
    ("clearance_m", "speed_mps"),
    [
        (10.0, 4.0),
        (1.0, 0.4),
        (0.5, 0.2),
        (0.3, 0.12),
        # 2 m/s2 and 0.3 s: sqrt(0.36 + 4 * 0.03) - 0.6 = 0.0928, less than 0.18 / 2.5 = 0.072
        (0.18, 0.07),
        # sqrt(0.36 + 4 * 0.01) - 0.6 = 0.0325, limited to the lowest speed
        (0.16, 0.05),
        (0.15, 0.05),
        (0.0, 0.05),
        (math.nextafter(1.0, 0.0), 0.39),
    ],
)
def test_speed_by_hand(clearance_m: float, speed_mps: float) -> None:
    assert speed_limit_mps(clearance_m, P, 2.0) == pytest.approx(speed_mps)


def test_weak_brakes_are_slower() -> None:
    """0.1 m/s2 and 0.3 s: sqrt(0.0009 + 0.2 * 0.85) - 0.03 = 0.3834."""
    assert speed_limit_mps(1.0, P, 0.1) == pytest.approx(0.38)


@given(st.floats(0.2, 20.0))
def test_at_the_limit_the_robot_can_stop_and_has_time(clearance_m: float) -> None:
    speed = speed_limit_mps(clearance_m, P, 2.0)
    assert speed == P.slowest_mps or speed * P.reaction_s + speed * speed / 4.0 <= clearance_m - P.stop_clearance_m
    assert clearance_m / speed > P.stop_s
    assert speed <= max(P.slowest_mps, clearance_m / P.approach_s) + 1e-9


# --- unseen space ----------------------------------------------------------------------------------------------------


def test_actual_and_requested_motion_are_checked_for_unseen_space() -> None:
    assert look(unseen=POLE).unseen == FREE
    for motion in ({"measured": AHEAD}, {"driven": AHEAD}, {"requested": AHEAD}, {"driven": BACK, "requested": AHEAD}):
        assert look(unseen=POLE, points=NOTHING, **motion).unseen == POLE_AHEAD
    assert look(unseen=POLE, driven=BACK, requested=BACK).unseen == FREE
    assert look(unseen=POLE, driven=AHEAD, points=NOTHING).moving == FREE


def test_only_motions_ahead_lead_onto_no_ground() -> None:
    ends = np.array([[1.5, 0.0, 0.0]])
    assert onto_no_ground(ends, BODY, [ZERO_TWIST, AHEAD], P) == POLE_AHEAD
    aside = Twist2(0.0, 0.5, 0.0)
    assert onto_no_ground(ends, BODY, [BACK, TURN, aside], P) == FREE
    assert onto_no_ground(None, BODY, [BACK, TURN, aside], P) == FREE
    assert onto_no_ground(None, BODY, [AHEAD], P) == Approach(0.0, 0.0)
    assert onto_no_ground(None, BODY, [Twist2(P.rest_mps, 0.0, 0.3)], P) == FREE
    assert onto_no_ground(ends, BODY, [Twist2(0.5, 0.0, 0.1)], P).clearance_m < 1.1


@pytest.mark.parametrize("clearance_m", [0.0, P.ground_margin_m, P.ground_margin_m + 0.001])
def test_where_ground_ends_the_robot_stands(clearance_m: float) -> None:
    assert ground_limit_mps(clearance_m, P, RIDE) == 0.0


@given(st.floats(0.0, 20.0))
def test_the_robot_can_stop_before_ground_ends(clearance_m: float) -> None:
    """At 0.5 m/s2 with a passenger, which takes 0.5 s to build up."""
    speed = ground_limit_mps(clearance_m, P, RIDE)
    way_m = max(clearance_m - P.ground_margin_m, 0.0)
    assert speed * (P.reaction_s + 0.5) + speed * speed <= way_m + 1e-9
    faster = speed + 2.0 * P.step_mps
    assert faster * (P.reaction_s + 0.5) + faster * faster > way_m


def test_without_unseen_cloud_all_space_is_unseen() -> None:
    assert look(unseen=None, driven=AHEAD).unseen == Approach(0.0, 0.0)
    assert look(unseen=None).unseen == FREE


@pytest.mark.parametrize(
    ("clearance_m", "speed_mps"),
    # 0.5 m/s2, 0.3 s + 0.5 s, 0.05 m of margin: sqrt(0.16 + clearance - 0.05) - 0.4
    [(0.0, 0.3), (0.05, 0.3), (0.38, 0.3), (1.05, 0.67), (1.85, 0.99), (4.5, 1.74)],
)
def test_the_speed_that_can_be_stopped_within_the_seen_part(clearance_m: float, speed_mps: float) -> None:
    assert seen_limit_mps(clearance_m, P, RIDE) == pytest.approx(speed_mps)


# --- commands --------------------------------------------------------------------------------------------------------


def test_no_commands() -> None:
    commands = CommandWatch(0.2)
    assert (commands.driven(1.0), commands.requested(1.0)) == (None, ZERO_TWIST)


def test_commands_grow_stale() -> None:
    commands = CommandWatch(0.25)
    commands.limited(AHEAD, 1.0)
    commands.request("/cmd_vel", BACK, 1.0)
    assert (commands.driven(1.25), commands.requested(1.25)) == (AHEAD, BACK)
    assert (commands.driven(1.26), commands.requested(1.26)) == (None, ZERO_TWIST)
    assert (commands.driven(0.9), commands.requested(0.9)) == (None, ZERO_TWIST)  # the clock jumped backwards


def test_request_of_the_highest_source_is_used() -> None:
    commands = CommandWatch(0.25)
    commands.request("/cmd_vel", AHEAD, 1.1)
    commands.request("/docking/cmd_vel", BACK, 1.1)
    assert commands.requested(1.1) == BACK
    commands.request("/teleop/cmd_vel", TURN, 1.0)
    assert commands.requested(1.1) == TURN
    assert commands.requested(1.3) == BACK


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_commands_that_are_no_numbers(bad: float) -> None:
    """The drive's motion is then unknown. A source with invalid commands stops the robot, as in the drive."""
    commands = CommandWatch(0.2)
    commands.limited(AHEAD, 1.0)
    commands.limited(Twist2(bad, 0.0, 0.0), 1.1)
    assert commands.driven(1.2) == AHEAD
    assert commands.driven(1.25) is None
    commands.request("/cmd_vel", AHEAD, 1.0)
    commands.request("/teleop/cmd_vel", Twist2(0.0, bad, 0.0), 1.0)
    assert commands.requested(1.0) == ZERO_TWIST


# --- lidar -----------------------------------------------------------------------------------------------------------

L = PARAMS.lidar


def test_a_sweep_that_shows_the_world() -> None:
    watch = LidarWatch(L)
    assert (watch.age_s(1.0), watch.problem) == (math.inf, "never received")
    watch.received(SWEEP, 50 * len(SWEEP), 1.0)
    assert (watch.age_s(1.5), watch.problem) == (0.5, "")
    assert watch.age_s(0.9) == math.inf


def test_a_frozen_sweep_is_an_old_one() -> None:
    watch = LidarWatch(L)
    broken = np.concatenate([SWEEP, np.full((9, 3), math.nan, np.float32)])
    watch.received(broken, 50 * len(SWEEP), 1.0)
    watch.received(broken.copy(), 50 * len(SWEEP), 1.1)
    assert (watch.age_s(1.1), watch.problem) == (pytest.approx(0.1), "frozen")
    moved = broken.copy()
    moved[17, 2] += 0.001
    watch.received(moved, 50 * len(SWEEP), 1.2)
    assert (watch.age_s(1.2), watch.problem) == (0.0, "")
    watch.received(moved[:-1], 50 * len(SWEEP), 1.3)
    assert watch.problem == ""


@pytest.mark.parametrize("cover", [0.0, 0.1, 0.49, 61.0, math.nan, math.inf])
def test_a_covered_sensor_is_a_silent_one(cover: float) -> None:
    watch = LidarWatch(L)
    watch.received(np.full((100, 3), cover / math.sqrt(3.0), np.float32), 150_000, 1.0)
    assert watch.age_s(1.0) == math.inf
    assert watch.problem == "covered: 0 returns, at least 1000 needed"


def test_returns_are_counted_by_their_share_of_the_sample() -> None:
    sweep = SWEEP.copy()
    sweep[::2] = math.nan  # half of the directions: still all sectors
    watch = LidarWatch(L)
    watch.received(sweep, 2 * L.min_returns, 1.0)
    assert watch.problem == ""
    watch.received(sweep, 2 * L.min_returns - 4, 1.0)
    assert watch.problem == "covered: 998 returns, at least 1000 needed"
    watch.received(np.empty((0, 3), np.float32), 0, 1.0)
    assert watch.problem == "covered: 0 returns, at least 1000 needed"


def test_a_sensor_that_is_covered_on_one_side() -> None:
    bearings = np.linspace(-math.pi, math.pi, 3600, endpoint=False) + 1e-3
    around = np.stack([np.cos(bearings), np.sin(bearings), 0.1 * bearings], axis=1).astype(np.float32) * 5.0
    watch = LidarWatch(L)
    watch.received(around[: round(0.71 * 3600)], 100_000, 1.0)
    assert watch.problem == ""
    watch.received(around[: round(0.69 * 3600)], 100_000, 2.0)
    assert watch.problem == "covered: returns from 69% of all directions, at least 70% needed"
    assert watch.age_s(2.0) == 1.0


def test_a_message_that_is_no_sweep() -> None:
    watch = LidarWatch(L)
    watch.received(SWEEP, 50 * len(SWEEP), 1.0)
    watch.refused("field x is missing")
    assert (watch.age_s(2.0), watch.problem) == (1.0, "field x is missing")
