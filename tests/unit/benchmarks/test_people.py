"""The benchmark ``people``: its bodies, its judgement, and their dependence on the safety monitor."""

from __future__ import annotations

import itertools
import json
import math

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.robot import load_robot
from robot_stack.safety.collision import outline_of
from robot_stack.safety.params import SafetyParams
from tests.benchmarks import people
from tests.benchmarks.support import people_cases
from tests.benchmarks.support.people_bodies import FAST, KINDS, Body, Walker, contact, drawn_body
from tests.benchmarks.support.people_cases import Case, drawn
from tests.benchmarks.support.people_rides import ride
from tests.benchmarks.support.people_run import Moment, avoidable, play

ROBOT = load_robot()
OUTLINE = outline_of(ROBOT.footprint)
COLLISION = load(SafetyParams, "safety_monitor").collision


def adult() -> Body:
    return drawn_body("adult", np.random.default_rng(1))


def case(walker: Walker, requested: Twist2, run_s: float = 3.5) -> Case:
    return Case(7, "drive", 0, False, adult(), walker, requested, 1.0, run_s)


def standing(x_m: float, y_m: float) -> Walker:
    """Returns a person standing at the target position."""
    return Walker(Pose2(x_m, y_m, 0.0), (x_m, y_m), 1.0, through=False, remaining_m=0.0)


# --- whole runs ------------------------------------------------------------------------------------------------------


def test_standing_person_ahead_is_touched_only_without_safety_monitor() -> None:
    one = case(standing(1.6, 0.0), Twist2(1.0, 0.0, 0.0))
    guarded, free = play(one), play(one, guarded=False)
    assert guarded.touch is None
    assert 0.0 < guarded.near_m < 0.5
    assert guarded.distance_m > 0.3
    assert free.touch.stood
    assert free.touch.avoidable
    assert free.touch.speed_mps > 0.8
    assert free.touch.closing_mps > 0.8
    assert free.touch.x == pytest.approx(0.5)
    figures = people._figures([free, guarded, free], [])
    assert (figures["runs"], figures["touched"], figures["touched_standing"]) == (3, 2, 2)
    assert figures["speed_at_touch_max_mps"] > 0.3
    conditions = people._conditions([free, guarded], [], 1)
    assert "adult" in str(conditions["touched_cases"])
    assert "touched" in json.dumps([dict(figures), dict(conditions)]), "numpy's numbers are converted"


def test_a_push_counts_with_its_greatest_closing_speed_and_its_way() -> None:
    """A robot that starts right next to a person closes slowly only at the first contact."""
    beside = OUTLINE.front + 0.03 + adult().radius_m
    touch = play(case(standing(beside, 0.0), Twist2(1.0, 0.0, 0.0), 2.5), guarded=False).touch
    assert touch.closing_mps > 0.4
    assert touch.pushed_m > 0.1


def test_person_running_into_standing_robot_is_not_counted_as_touch() -> None:
    outcome = play(case(Walker(Pose2(3.0, 0.0, math.pi), (0.7, 0.0), 1.5, through=True), ZERO_TWIST, 3.0))
    assert outcome.near_m <= 0.0
    assert outcome.touch is None


def test_a_ride_with_nothing_in_the_way_ends() -> None:
    ridden = ride(3, 1.0, chair=False)
    assert ridden.distance_m >= 1.0
    assert ridden.stops == ()
    assert ridden.justified == 0


@pytest.mark.parametrize("bearing_deg", [90.0, 180.0])
def test_robot_stands_when_a_cyclist_arrives_on_a_collision_course(bearing_deg: float) -> None:
    """At 6 m/s, from the side and from behind; the heading is fixed for the last 0.6 s."""
    bearing = math.radians(bearing_deg)
    there = Pose2(1.5, 0.0, 0.0)
    begin = Pose2(there.x + 15.0 * math.cos(bearing), 15.0 * math.sin(bearing), bearing + math.pi)
    cyclist = drawn_body("cyclist", np.random.default_rng(1))
    walker = Walker(begin, (0.0, 0.0), 6.0, through=True)
    drives = Case(7, "drive", 2, False, cyclist, walker, Twist2(1.0, 0.0, 0.0), 1.0, 3.5)
    assert play(drives, guarded=False).touch is not None
    assert play(drives).touch is None


# --- its judgement ---------------------------------------------------------------------------------------------------


def moments_until_contact(walker: Walker, twist: Twist2, from_m: float) -> list[Moment]:
    """Returns the moments until contact: the robot keeps ``twist``, a person walks into it from the left."""
    moments, pose = [], Pose2(0.0, 0.0, 0.0)
    walker.pose = Pose2(0.0, from_m, -0.5 * math.pi)
    walker.remaining_m = from_m
    while contact(adult(), walker.pose.relative_to(pose), OUTLINE).gap_m > 0.0:
        walker.step(0.005, pose, twist)
        pose = pose.compose(Pose2(twist.vx * 0.005, 0.0, 0.0))
        moments.append(
            Moment(pose, twist, Walker(walker.pose, walker.target, walker.speed_mps, True, walker.remaining_m))
        )
    return moments


@pytest.mark.parametrize(("walks_mps", "drives_mps", "could"), [(0.5, 0.2, True), (2.0, 0.5, False)])
def test_contact_is_avoidable_only_at_low_speed(walks_mps: float, drives_mps: float, could: bool) -> None:
    walker = Walker(Pose2(0.0, 0.0, 0.0), (0.0, 0.0), walks_mps, through=True)
    twist = Twist2(drives_mps, 0.0, 0.0)
    moments = moments_until_contact(walker, twist, from_m=1.3)
    assert avoidable(case(walker, twist), moments, ROBOT, COLLISION) is could


def test_the_gap_is_that_of_the_nearest_part() -> None:
    body = adult()
    met = contact(body, Pose2(0.0, 1.0, 0.0), OUTLINE)
    parts = [(shape.centre_m, shape.half_m[0]) for shape in body.shapes]
    assert met.gap_m == pytest.approx(min(1.0 + y - radius for (_, y, _), radius in parts) - OUTLINE.half)
    assert met.closing_mps(Twist2(0.0, 0.3, 0.0)) == pytest.approx(0.3)
    assert met.closing_mps(Twist2(0.3, 0.0, 0.0)) == pytest.approx(0.0)
    assert met.speed_mps(Twist2(0.3, 0.0, 0.0)) == pytest.approx(0.3)
    within = contact(body, Pose2(0.48, 0.0, 0.0), OUTLINE)
    assert within.gap_m < -0.1
    assert within.towards == (1.0, 0.0)


# --- its cases -------------------------------------------------------------------------------------------------------


def test_a_round_has_each_kind_manoeuvre_and_side_and_half_of_them_with_the_chair() -> None:
    round_ = [drawn(number, 500 + number, ROBOT) for number in range(people_cases.ROUND)]
    found = {(one.body.kind, one.manoeuvre, one.side) for one in round_}
    assert len(found) == people_cases.ROUND == len(KINDS) * len(people_cases.MANOEUVRES) * people_cases.SIDES
    assert sum(one.chair for one in round_) == people_cases.ROUND // 2
    assert {(one.chair, one.manoeuvre) for one in round_} == {
        (chair, manoeuvre) for chair in (True, False) for manoeuvre in people_cases.MANOEUVRES
    }
    for one in round_:
        outline = outline_of(ROBOT.footprint_with_chair if one.chair else ROBOT.footprint)
        assert contact(one.body, one.walker.pose, outline).gap_m >= 1.0
        assert contact(one.body, Pose2(*one.walker.target, 0.0), outline).gap_m < 0.8


def test_a_round_of_fast_bodies_has_each_manoeuvre_and_side_with_and_without_the_chair() -> None:
    round_ = [drawn(number, 700 + number, ROBOT, FAST) for number in range(64)]
    assert {(one.body.kind, one.manoeuvre, one.side) for one in round_} == set(
        itertools.product(FAST, people_cases.MANOEUVRES, range(people_cases.SIDES))
    )
    assert {(one.chair, one.side) for one in round_} == set(itertools.product((True, False), range(people_cases.SIDES)))
    assert all(4.0 <= one.walker.speed_mps <= 7.0 for one in round_)
