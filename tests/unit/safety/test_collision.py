"""Time until the moving footprint touches a point, computed by hand and with small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_stack.core.geometry import Twist2, exp_se2
from robot_stack.core.robot import Footprint
from robot_stack.safety.collision import FREE, Approach, Outline, approach, contact_times, outline_of

BODY = Outline(front=0.5, rear=-0.4, half=0.3)
AHEAD = Twist2(1.0, 0.0, 0.0)


def points(*xy: tuple[float, float]) -> NDArray[np.float64]:
    return np.array([(x, y, 0.5) for x, y in xy]).reshape(-1, 3)


def time_to(x: float, y: float, vx: float, vy: float, omega: float, outline: Outline = BODY) -> float:
    return float(contact_times(points((x, y)), outline, Twist2(vx, vy, omega))[0])


def test_the_outline_of_a_footprint() -> None:
    footprint = Footprint(front_m=1.4, rear_m=-0.5, width_m=0.8)
    assert outline_of(footprint) == Outline(1.4, -0.5, 0.4, 0.0)
    widened = outline_of(footprint, 0.1)
    assert (widened.front, widened.rear, widened.half, widened.margin) == pytest.approx((1.5, -0.6, 0.5, 0.1))
    assert Outline(1.4, -0.5, 0.4).reach() == pytest.approx(math.hypot(1.4, 0.4))
    assert Outline(0.3, -0.5, 0.4).reach() == pytest.approx(math.hypot(0.5, 0.4))


def test_inside_and_how_far_outside() -> None:
    around = points((0.5, 0.3), (-0.4, -0.3), (0.51, 0.0), (-0.41, 0.0), (0.0, 0.31), (0.0, -0.31), (0.8, 0.7))
    assert BODY.contains(around).tolist() == [True, True, False, False, False, False, False]
    assert BODY.distances(around) == pytest.approx([0.0, 0.0, 0.01, 0.01, 0.01, 0.01, 0.5])


@pytest.mark.parametrize(
    ("x", "y", "vx", "vy", "seconds"),
    [
        (2.5, 0.0, 1.0, 0.0, 2.0),
        (2.5, 0.3, 0.5, 0.0, 4.0),
        (2.5, 0.31, 1.0, 0.0, math.inf),  # beside the path
        (2.5, 0.0, -1.0, 0.0, math.inf),  # behind the motion
        (-1.4, 0.1, -0.5, 0.0, 2.0),
        (0.0, 1.3, 0.0, 0.5, 2.0),  # sideways
        (0.2, -0.8, 0.0, -1.0, 0.5),
        (0.51, 1.0, 0.0, 1.0, math.inf),
        # diagonal: the corner (0.5, 0.3) meets (1.5, 1.3) head-on, the front edge passes under (1.5, 1.4)
        (1.5, 1.3, 1.0, 1.0, 1.0),
        (1.0, 1.3, 1.0, 1.0, 1.0),
        (1.0, 0.5, 1.0, 1.0, 0.5),
        (1.5, 0.3, 1.0, 1.0, math.inf),  # passes in front
        (1.5, 2.3, 1.0, 1.0, math.inf),
    ],
)
def test_along_a_line(x: float, y: float, vx: float, vy: float, seconds: float) -> None:
    assert time_to(x, y, vx, vy, 0.0) == pytest.approx(seconds)


@pytest.mark.parametrize(
    ("x", "y", "omega", "seconds"),
    [
        # the corner (0.5, 0.3) is 0.5831 m from the middle at 30.96 deg
        (0.0, math.hypot(0.5, 0.3), 1.0, math.pi / 2 - math.atan2(0.3, 0.5)),
        (0.0, 0.59, 1.0, math.inf),
        # at 0.4 m: the left edge at atan2(0.3, sqrt(0.07)) = 48.59 deg meets 90 deg by the corner behind as well
        (0.0, -0.4, -0.5, (math.pi / 2 - math.asin(0.75)) / 0.5),
        (0.0, -0.4, 0.5, (math.pi / 2 - math.asin(0.75)) / 0.5),
        # the rear corner (-0.4, 0.3) turning right
        (0.0, 0.5, -1.0, math.pi / 2 - math.atan2(0.3, 0.4)),
    ],
)
def test_on_the_spot(x: float, y: float, omega: float, seconds: float) -> None:
    assert time_to(x, y, 0.0, 0.0, omega) == pytest.approx(seconds)


def test_along_a_curve() -> None:
    """Centre of rotation at (0, 1): a point at (0.9, 1.0) is 0.9 m from it."""
    quarter = math.pi / 2
    expected = quarter - math.asin(0.5 / 0.9)  # the front edge is at that angle from straight below the centre
    assert time_to(0.9, 1.0, 1.0, 0.0, 1.0) == pytest.approx(expected)
    assert time_to(0.0, 3.0, 1.0, 0.0, 1.0) == math.inf  # 2 m from the centre, beyond the outer corner's 1.39 m
    assert time_to(0.0, 1.5, 1.0, 0.0, 1.0) == math.inf  # 0.5 m from it, within the inner edge's 0.7 m


def test_a_very_wide_curve_is_a_line() -> None:
    straight, wide = time_to(4.0, 0.1, 1.0, 0.0, 0.0), time_to(4.0, 0.1, 1.0, 0.0, 0.99e-3)
    assert wide == straight == pytest.approx(3.5)
    assert time_to(4.0, 0.1, 1.0, 0.0, 1.01e-3) == pytest.approx(straight, abs=1e-3)
    assert time_to(4.0, 0.3, 1.0, 0.0, -2e-3) == math.inf  # 3 mm beside the path


def test_a_point_at_the_centre_of_rotation_stays_there() -> None:
    outside = Outline(0.5, -0.4, 0.3)
    assert time_to(0.0, 1.0, 1.0, 0.0, 1.0, outside) == math.inf


TWISTS = st.builds(Twist2, *[st.floats(-1.5, 1.5)] * 3)
PLACES = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))


@settings(max_examples=60, deadline=None)
@given(TWISTS, PLACES)
@example(Twist2(0.5, 0.3, 0.0), (2.0, 1.2))
@example(Twist2(0.5, 0.3, 1e-3), (2.0, 1.2))
def test_the_same_as_in_small_steps(twist: Twist2, place: tuple[float, float]) -> None:
    """The first touch lies between the last step outside and the first step inside."""
    assume(twist.speed() > 0.05 or abs(twist.omega) > 0.05)
    assume(BODY.distances(points(place))[0] > 1e-3)
    exact = time_to(*place, twist.vx, twist.vy, twist.omega)
    times = np.linspace(0.0, 6.0, 1201)
    inside = np.array([_within(place, twist, at, shrunk=0.0) for at in times])
    if not inside.any():
        # the steps may miss a corner that is only grazed
        assert exact > 6.0 - 0.005 or not _within(place, twist, exact + 0.01, shrunk=0.01)
        return
    first = int(np.argmax(inside))
    assert exact <= times[first] + 1e-6
    assert exact >= times[first - 1] - 1e-6 or _within(place, twist, exact, shrunk=-1e-6)


def _within(place: tuple[float, float], twist: Twist2, at_s: float, shrunk: float) -> bool:
    """Returns whether the outline, smaller by ``shrunk``, covers a place after a time."""
    pose = exp_se2(twist, at_s)
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    dx, dy = place[0] - pose.x, place[1] - pose.y
    smaller = Outline(BODY.front - shrunk, BODY.rear + shrunk, BODY.half - shrunk)
    return bool(smaller.contains(points((c * dx + s * dy, -s * dx + c * dy)))[0])


@pytest.mark.parametrize(
    ("x", "y", "vx", "vy", "omega", "touched"),
    [
        (0.48, 0.0, 1.0, 0.0, 0.0, True),  # in the front margin
        (0.48, 0.0, -1.0, 0.0, 0.0, False),
        (0.48, 0.0, 0.0, 1.0, 0.0, False),  # along it
        (-0.38, 0.0, -1.0, 0.0, 0.0, True),
        (-0.38, 0.0, 1.0, 0.0, 0.0, False),
        (0.0, 0.28, 1.0, 0.0, 0.0, False),  # a wall beside: along it,
        (0.0, 0.28, 1.0, 0.1, 0.0, False),  # nearly along it,
        (0.0, 0.28, 1.0, 0.3, 0.0, True),  # into it,
        (0.0, 0.28, 0.0, -1.0, 0.0, False),  # away from it
        (0.0, -0.28, 0.0, -1.0, 0.0, True),
        (0.0, -0.28, 0.0, 1.0, 0.0, False),
        (0.4, 0.28, 0.0, 0.0, 1.0, True),  # the front corner turns into the wall,
        (0.4, 0.28, 0.0, 0.0, -1.0, False),  # and out of it
    ],
)
def test_point_already_inside_the_footprint(
    x: float, y: float, vx: float, vy: float, omega: float, touched: bool
) -> None:
    assert time_to(x, y, vx, vy, omega) == (0.0 if touched else math.inf)


def test_approach_is_the_soonest_and_the_nearest() -> None:
    assert approach(points(), BODY, AHEAD) == FREE
    assert approach(points((0.0, 2.0)), BODY, AHEAD) == FREE
    assert approach(points((2.5, 0.0), (1.5, 0.0), (0.0, 2.0)), BODY, Twist2(0.5, 0.0, 0.0)) == Approach(2.0, 1.0)


def test_clearance_is_the_distance_along_the_path_from_the_footprint() -> None:
    """Turning on the spot, the farther point travels a longer distance until it is touched at the same time."""
    found = approach(points((0.0, 0.5)), BODY, Twist2(0.0, 0.0, -0.5))
    turn = math.pi / 2 - math.atan2(0.3, 0.4)
    assert (found.time_s, found.clearance_m) == pytest.approx((turn / 0.5, turn * 0.5))
    widened = Outline(0.6, -0.5, 0.4, margin=0.1)
    ahead = approach(points((2.5, 0.0)), widened, AHEAD)
    assert (ahead.time_s, ahead.clearance_m) == pytest.approx((1.9, 2.0))


def test_clearance_of_a_robot_moving_sideways_and_turning() -> None:
    """The two motions of the point add up in front of the robot's centre and subtract behind it."""
    twist = Twist2(0.0, 0.5, 0.5)
    for x_m in (0.3, -0.3):
        place = points((x_m, BODY.half + 0.2))
        time_s = float(contact_times(place, BODY, twist)[0])
        speed_mps = math.hypot(0.5 * (BODY.half + 0.2), 0.5 + 0.5 * x_m)
        assert math.isfinite(time_s)
        assert approach(place, BODY, twist).clearance_m == pytest.approx(time_s * speed_mps + BODY.margin)


def test_in_a_curve_the_nearest_point_need_not_be_the_soonest() -> None:
    """At 1 rad/s around (0, 1) the outer point moves three times as fast as the inner one."""
    twist = Twist2(1.0, 0.0, 1.0)
    inner, outer = (0.75, 1.0), (1.3, 1.0)
    alone = [approach(points(place), BODY, twist) for place in (inner, outer)]
    both = approach(points(inner, outer), BODY, twist)
    assert both == Approach(min(a.time_s for a in alone), min(a.clearance_m for a in alone))
    assert alone[0].clearance_m == pytest.approx(alone[0].time_s * 0.75)
    assert alone[1].clearance_m == pytest.approx(alone[1].time_s * 1.3)


def test_the_worse_of_two() -> None:
    assert Approach(1.0, 3.0).worse(Approach(2.0, 0.5)) == Approach(1.0, 0.5)
    assert FREE.worse(Approach(2.0, 0.5)) == Approach(2.0, 0.5)


@settings(max_examples=40, deadline=None)
@given(TWISTS, st.floats(0.1, 5.0), PLACES)
def test_clearance_depends_on_the_direction_alone(twist: Twist2, factor: float, place: tuple[float, float]) -> None:
    assume(twist.speed() > 0.05)
    slow, fast = (approach(points(place), BODY, twist.scaled(f)) for f in (1.0, factor))
    assert fast.clearance_m == pytest.approx(slow.clearance_m, rel=1e-6, abs=1e-6)
    assert fast.time_s * factor == pytest.approx(slow.time_s, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_all_around_every_centre_of_rotation_as_in_small_steps(seed: int) -> None:
    """Centres of rotation in front of, behind, beside and within the robot, with points on all sides."""
    random = np.random.default_rng(seed)
    vx, vy = random.uniform(-1.0, 1.0, 2)
    twist = Twist2(float(vx), float(vy), float(random.choice([-1.0, -0.4, 0.4, 1.0])))
    places = random.uniform(-2.5, 2.5, (150, 2))
    places = places[BODY.distances(places) > 0.02]
    step_s, turn_s = 2e-3, 2.0 * math.pi / abs(twist.omega)
    cx, cy = -twist.vy / twist.omega, twist.vx / twist.omega
    times = np.arange(0.0, turn_s, step_s)
    angle = -twist.omega * times[:, None]
    x, y = places[:, 0] - cx, places[:, 1] - cy
    seen = np.stack([cx + np.cos(angle) * x - np.sin(angle) * y, cy + np.sin(angle) * x + np.cos(angle) * y], axis=-1)
    inside = BODY.contains(seen.reshape(-1, 2)).reshape(seen.shape[:2])
    well_inside = Outline(BODY.front - 0.02, BODY.rear + 0.02, BODY.half - 0.02)
    deep = well_inside.contains(seen.reshape(-1, 2)).reshape(seen.shape[:2]).any(axis=0)
    stepped = np.where(inside.any(axis=0), times[np.argmax(inside, axis=0)], math.inf)
    exact = contact_times(places, BODY, twist)
    assert deep.any()
    assert np.abs(exact[deep] - stepped[deep]).max() <= step_s + 1e-6
    assert np.isinf(exact[~inside.any(axis=0) & (_least_gap(seen) > 0.01)]).all()


def _least_gap(seen: NDArray[np.float64]) -> NDArray[np.float64]:
    return BODY.distances(seen.reshape(-1, 2)).reshape(seen.shape[:2]).min(axis=0)


def test_a_corner_that_is_just_met_is_touched() -> None:
    box = Outline(0.5, -0.5, 0.25)
    assert time_to(1.5, 0.75, 1.0, 1.0, 0.0, box) == 1.0


def test_deeper_is_a_matter_of_direction_not_of_speed() -> None:
    for speed in (0.01, 0.1, 1.0, 10.0):
        assert time_to(0.0, 0.25, speed, 0.5 * speed, 0.0) == 0.0
        assert time_to(0.0, 0.25, speed, 0.1 * speed, 0.0) == math.inf


WIDENED = Outline(front=0.55, rear=-0.45, half=0.35, margin=0.05)


@pytest.mark.parametrize(
    ("vx", "vy", "seconds"),
    [
        (0.9, 0.15, 0.04 / 0.15),  # too flat to get deeper into the margin, but the body touches it
        (0.4, 0.04, 1.0),
        (0.4, 0.01, math.inf),  # past the wall before that
        (0.9, 0.0, math.inf),
        (0.9, -0.15, math.inf),
        (0.5, 0.15, 0.0),
    ],
)
def test_a_wall_within_the_margin_is_met_by_the_body(vx: float, vy: float, seconds: float) -> None:
    wall = points(*((0.05 * column, 0.34) for column in range(-6, 5)))
    twist = Twist2(vx, vy, 0.0)
    found = approach(wall, WIDENED, twist)
    assert found.time_s == pytest.approx(seconds)
    if 0.0 < seconds < math.inf:
        assert found.clearance_m == pytest.approx(seconds * twist.speed(), abs=0.05)
    assert WIDENED.body() == Outline(*(pytest.approx(value) for value in (0.5, -0.4, 0.3)), 0.0)


def test_points_inside_the_footprint_collide_only_if_they_get_deeper() -> None:
    assert time_to(0.0, 0.29, 0.9, 0.1, 0.0, WIDENED) == math.inf
    assert time_to(0.0, 0.29, 0.0, 0.1, 0.0, WIDENED) == 0.0
