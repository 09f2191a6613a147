"""Moving and apparently moving objects: the tracker alone, and with the simulated LiDARs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.space.kernels import FREE, OCCUPIED
from robot_stack.perception.space.moving_objects import MovingObjects
from tests.unit.space.test_space import HIGH, LOW, PARAMS, SEEN, Scanner
from tests.unit.space.yard import ADULT, CHILD, POLE, Block, Post, Yard, near, state_at

P = PARAMS.moving_objects
FAST = load(PerceptionParams, "perception_pipeline").fast_bodies.moving_objects
SLOW = load(PerceptionParams, "perception_pipeline").slow_bodies
LOOK_S = 0.1


def body(x: float, y: float, noise: np.random.Generator | None = None, points: int = 12) -> NDArray[np.float64]:
    """Returns the points of a post with a radius of 0.15 m."""
    angles = np.linspace(-1.2, 1.2, points)
    heights, came = np.linspace(0.1, 1.6, points), np.ones(points)
    rows = np.stack([x - 0.15 * np.cos(angles), y + 0.15 * np.sin(angles), heights, came, came], axis=1)
    if noise is not None:
        rows[:, :2] += noise.normal(0.0, 0.02, (points, 2))
    return rows


def blind(x_m: float, y_m: float, top_m: float) -> bool:
    """A visibility function: no ray passes anywhere."""
    return False


def follow(movers: MovingObjects, seconds: float, speed_mps: float, at_s: float = 10.0, noise: bool = True) -> float:
    """Feeds a body that walks from x = 4 m towards the robot. Returns the time of the last look."""
    random = np.random.default_rng(1) if noise else None
    for number in range(round(seconds / LOOK_S) + 1):
        movers.look(body(4.0 - speed_mps * number * LOOK_S, 0.5, random), at_s + number * LOOK_S, blind)
    return at_s + number * LOOK_S


@pytest.mark.parametrize("speed_mps", [0.3, 0.6, 1.2, 2.0])
def test_walking_person_is_tracked_with_velocity(speed_mps: float) -> None:
    movers = MovingObjects(P)
    now_s = follow(movers, 1.5, speed_mps)
    found = movers.at(now_s, IDENTITY)
    assert len(found) == 12
    assert found[:, 3].mean() == pytest.approx(-speed_mps, abs=0.12 * speed_mps + 0.05)
    assert abs(found[:, 4].mean()) < 0.15
    assert found[:, 0].mean() == pytest.approx(4.0 - 1.5 * speed_mps - 0.1, abs=0.06)
    turned = movers.at(now_s, Pose2(1.0, 0.0, math.pi / 2))
    assert turned[:, 4].mean() == pytest.approx(-found[:, 3].mean())
    assert turned[:, 1].mean() == pytest.approx(1.0 - found[:, 0].mean(), abs=1e-5)


def test_appearing_static_objects_are_not_moving() -> None:
    movers, random = MovingObjects(P), np.random.default_rng(2)
    for number in range(100):
        movers.look(np.concatenate([body(3.0, y, random) for y in (-2.0, 0.0, 2.0)]), 10.0 + number * LOOK_S, blind)
        assert len(movers.at(10.0 + number * LOOK_S, IDENTITY)) == 0


def test_specks_and_walls_are_not_tracked() -> None:
    movers = MovingObjects(P)
    for number in range(20):
        x = 4.0 - 0.1 * number
        wall = np.stack([np.full(40, x), np.linspace(-1.5, 1.5, 40), np.ones(40), np.ones(40), np.ones(40)], axis=1)
        movers.look(np.concatenate([wall, body(x, 3.0, points=P.points_min - 1)]), 10.0 + number * LOOK_S, blind)
    assert len(movers.at(12.0, IDENTITY)) == 0


def test_lost_person_coasts_then_is_returned_with_last_position_and_velocity() -> None:
    movers = MovingObjects(P)
    now_s = follow(movers, 1.5, 1.0, noise=False)
    gone = np.empty((0, 5))
    assert movers.look(gone, now_s + 0.4, blind) == []
    assert movers.at(now_s + 0.4, IDENTITY)[:, 0].mean() == pytest.approx(2.5 - 0.4 - 0.1, abs=0.06)
    ((where, vx_mps, vy_mps),) = movers.look(gone, now_s + P.coast_s + 0.05, blind)
    assert where[:, 0].mean() == pytest.approx(2.5 - 0.1, abs=0.06)
    assert (vx_mps, vy_mps) == pytest.approx((-1.0, 0.0), abs=0.1)
    assert len(movers.at(now_s + P.coast_s + 0.05, IDENTITY)) == 0
    now_s = follow(movers, 1.5, 1.0, at_s=20.0)
    assert len(movers.at(now_s + P.coast_s + 0.05, IDENTITY)) == 0
    movers.forget()
    assert len(movers.at(now_s, IDENTITY)) == 0


def test_person_missing_in_visible_area_is_dropped() -> None:
    movers = MovingObjects(P)
    now_s = follow(movers, 1.5, 1.0)
    gone = np.empty((0, 5))
    assert movers.look(gone, now_s + P.missed_s - 0.01, lambda x, y, top: True) == []
    assert len(movers.at(now_s + P.missed_s - 0.01, IDENTITY)) > 0
    assert movers.look(gone, now_s + P.missed_s + 0.01, lambda x, y, top: x > 2.0) == []
    assert len(movers.at(now_s + P.missed_s + 0.01, IDENTITY)) == 0


def test_person_not_reappearing_from_hidden_area_is_returned_as_lost() -> None:
    movers = MovingObjects(P)
    now_s, gone = follow(movers, 1.5, 1.0), np.empty((0, 5))
    for after_s in (0.3, 0.6):
        assert movers.look(gone, now_s + after_s, lambda x, y, top: x < 1.6) == []
        assert len(movers.at(now_s + after_s, IDENTITY)) > 0
    assert len(movers.look(gone, now_s + 0.9, lambda x, y, top: x < 1.6)) == 1
    assert len(movers.at(now_s + 0.9, IDENTITY)) == 0


def test_partly_hidden_person_keeps_velocity() -> None:
    """The centre of the visible part differs from that of the whole body."""
    movers = MovingObjects(P)
    now_s = follow(movers, 1.5, 1.0, noise=False)
    for number in range(1, 5):
        movers.look(body(2.5 - 0.1 * number, 0.5)[8:], now_s + number * LOOK_S, blind)
    assert movers.at(now_s + 0.4, IDENTITY)[:, 3].mean() == pytest.approx(-1.0, abs=0.1)


def cart(rear: float, front: float) -> NDArray[np.float64]:
    """Returns the visible top of a low cart, from its front (the lower x) to its rear."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(front, rear + 0.01, 0.06), np.arange(-0.2, 0.21, 0.08)))
    return np.stack([x, y, np.full_like(x, 0.25), *np.ones((2, len(x)))], axis=1)


def test_cart_with_hidden_front_keeps_velocity_of_rear() -> None:
    """The cart is 0.8 m long at 1 m/s. Beyond the edge of a strip, rays pass only above it."""
    movers, edge_m = MovingObjects(P), 2.8

    def above(x_m: float, y_m: float, top_m: float) -> bool:
        return top_m > 0.3 or x_m > edge_m

    for number in range(24):
        front = 4.0 - 0.1 * number
        shown = cart(front + 0.8, max(front, edge_m)) if front + 0.8 > edge_m else np.empty((0, 5))
        movers.look(shown, 10.0 + number * LOOK_S, above)
        if number > 7:
            found = movers.at(10.0 + number * LOOK_S, IDENTITY)
            assert found[:, 3].mean() == pytest.approx(-1.0, abs=0.15), number
            assert found[:, 0].min() == pytest.approx(front, abs=0.15), number


def test_cart_with_rear_classified_static_is_tracked_by_its_front() -> None:
    """Points in place for 1 s count as static: the visible length of a cart varies, and a piece is separate."""
    movers = MovingObjects(P)
    for number in range(24):
        front = 5.0 - 0.08 * number
        shown = [cart(front + (0.36 if number % 5 < 3 else 0.6), front)]
        if number % 5 < 2 and number > 8:
            shown.insert(0, cart(front + 0.7, front + 0.6))
        movers.look(np.concatenate(shown), 10.0 + number * LOOK_S, lambda x, y, top: True)
        if number > 12:
            found = movers.at(10.0 + number * LOOK_S, IDENTITY)
            assert len(found) > 0, number
            assert found[:, 3].mean() == pytest.approx(-0.8, abs=0.25), number


def test_a_slow_cart_keeps_its_speed_while_more_and_more_of_it_is_seen() -> None:
    """At 0.48 m/s the front approaches while the visible part grows at the rear, so its centre lags behind."""
    movers = MovingObjects(P)
    for number in range(24):
        front = 4.0 - 0.048 * number
        length = 0.3 + max(0.0, 0.06 * min(number - 12, 6))
        movers.look(cart(front + length, front), 10.0 + number * LOOK_S, lambda x, y, top: True)
        if number > 8:
            found = movers.at(10.0 + number * LOOK_S, IDENTITY)
            assert len(found) > 0, number
            assert found[:, 3].mean() == pytest.approx(-0.48, abs=0.12), number


def test_long_body_overlapping_its_previous_place_stays_moving() -> None:
    """At 1 m long and 0.6 m/s, it still covers two thirds of where it was 0.6 s ago."""
    movers = MovingObjects(P)
    for number in range(20):  # the front appears first
        rear = 5.0 if number < 8 else 4.4 - 0.06 * (number - 8)
        movers.look(cart(rear, 4.4 - 0.06 * number - 0.1), 10.0 + number * LOOK_S, lambda x, y, top: True)
    assert len(movers.at(11.9, IDENTITY)) > 0


@pytest.mark.parametrize("speed_mps", [0.08, 0.15, 0.3])
def test_a_slow_cart_is_lost_at_the_last_rays_with_its_velocity(speed_mps: float) -> None:
    """Its front is new for some seconds; beyond the edge of a strip rays pass only above it."""
    movers, edge_m, lost = MovingObjects(SLOW), 3.0, list[tuple[NDArray[np.float64], float, float]]()
    from_m = edge_m + speed_mps * (SLOW.new_s + 2.0)
    for number in range(round((from_m - edge_m + 1.6) / (speed_mps * LOOK_S))):
        front = from_m - speed_mps * number * LOOK_S
        new_m = speed_mps * min(number * LOOK_S, SLOW.new_s) - SLOW.apart_m
        shown = cart(front + new_m, max(front, edge_m)) if front + new_m > edge_m else np.empty((0, 5))
        lost += movers.look(shown, 10.0 + number * LOOK_S, lambda x, y, top: top > 0.3 or x > edge_m)
    assert len(lost) > 0
    body, vx, vy = lost[0]
    assert vx == pytest.approx(-speed_mps, abs=0.3 * speed_mps)
    assert abs(vy) < 0.1 * speed_mps
    assert edge_m - 0.4 < body[:, 0].min() < edge_m + 0.2


def test_what_stays_or_stops_in_view_is_no_slow_body_that_got_lost() -> None:
    movers, random = MovingObjects(SLOW), np.random.default_rng(5)
    for number in range(200):
        came = 0.2 * min(number * LOOK_S, 5.0)
        shown = [cart(4.4 - came, 4.0 - came)] if number < 90 else []
        if number % 3:
            shown.append(body(2.0, 1.0, random))
        points = np.concatenate(shown) if shown else np.empty((0, 5))
        assert movers.look(points, 10.0 + number * LOOK_S, lambda x, y, top: x > 2.5) == []


def test_body_in_unobserved_area_starts_no_track_but_continues_existing_one() -> None:
    found = np.array([1.0, 1.0, 1.0, 0.0, 1.0])
    movers = MovingObjects(P)
    for number in range(15):
        movers.look(body(4.0 - 0.1 * number, 0.5) * found, 10.0 + number * LOOK_S, blind)
    assert len(movers.at(11.4, IDENTITY)) == 0
    now_s = follow(movers, 1.0, 1.0, at_s=20.0)
    for number in range(1, 15):
        movers.look(body(3.0 - 0.1 * number, 0.5) * found, now_s + number * LOOK_S, blind)
    assert movers.at(now_s + 1.4, IDENTITY)[:, 0].mean() == pytest.approx(1.5, abs=0.06)


def test_a_walls_end_that_comes_into_view_bit_by_bit_stays() -> None:
    movers, random = MovingObjects(P), np.random.default_rng(3)
    for number in range(2, 14):
        along = np.arange(0.0, 0.1 * number, 0.05)
        end = np.stack([np.full_like(along, 2.0), 1.0 + along, *np.ones((3, len(along)))], axis=1)
        end[:, :2] += random.normal(0.0, 0.01, (len(end), 2))
        movers.look(end, 10.0 + number * LOOK_S, blind)
        assert len(movers.at(10.0 + number * LOOK_S, IDENTITY)) == 0, number


def test_two_meeting_people_keep_their_velocities() -> None:
    """They walk one behind the other, 0.5 m apart sideways, until both merge into one body with another centre."""
    movers = MovingObjects(P)
    for number in range(30):
        x = 4.0 - 0.1 * number
        behind = body(x + 0.1, 0.9 if number < 15 else 0.7)
        movers.look(np.concatenate([body(x, 0.5), behind]), 10.0 + number * LOOK_S, blind)
        if number > 8:
            found = movers.at(10.0 + number * LOOK_S, IDENTITY)
            assert np.abs(found[:, 4]).max() < 0.4, number
            assert found[:, 3].mean() == pytest.approx(-1.0, abs=0.2)


def test_object_faster_than_limit_is_not_tracked() -> None:
    movers = MovingObjects(P)
    now_s = follow(movers, 0.6, P.fastest_mps + 0.6, noise=False)
    assert len(movers.at(now_s, IDENTITY)) == 0


@pytest.mark.parametrize("speed_mps", [3.5, 4.0, 5.5, 7.0])
def test_a_fast_body_is_tracked_with_its_velocity_within_three_turns(speed_mps: float) -> None:
    movers, random = MovingObjects(FAST), np.random.default_rng(4)
    for number in range(8):
        movers.look(body(12.0 - speed_mps * number * LOOK_S, 0.5, random), 10.0 + number * LOOK_S, blind)
        found = movers.at(10.0 + number * LOOK_S, IDENTITY)
        assert (len(found) > 0) is (number >= 3), number
        if number >= 3:
            assert found[:, 3].mean() == pytest.approx(-speed_mps, rel=0.05)
            assert abs(found[:, 4].mean()) < 0.3


def test_walking_people_and_appearing_objects_are_no_fast_bodies() -> None:
    movers, random = MovingObjects(FAST), np.random.default_rng(5)
    for number in range(60):
        now_s = 10.0 + number * LOOK_S
        walks = body(8.0 - 0.2 * number, 0.5, random)
        appears = body(*random.uniform(-10.0, 10.0, 2), random)
        movers.look(np.concatenate([walks, appears]), now_s, blind)
        assert len(movers.at(now_s, IDENTITY)) == 0, number


def test_a_body_at_the_seam_is_followed_by_the_times_at_which_it_was_seen() -> None:
    """Both halves of a turn see it: one at its end, the next one at its begin, which is the same time."""
    movers = MovingObjects(FAST)
    for half in range(16):
        stamp_s = 10.0 + 0.05 * half
        seen_s = stamp_s - 0.05 * (half % 2)
        movers.look(body(12.0 - 6.0 * (seen_s - 10.0), 0.0), stamp_s, blind, lambda x, y, at_s=seen_s: at_s)
    found = movers.at(stamp_s, IDENTITY)
    assert found[:, 3].mean() == pytest.approx(-6.0, rel=0.02)
    assert found[:, 0].mean() == pytest.approx(12.0 - 6.0 * 0.75 - 0.1, abs=0.1)  # at the stamp


def come(scanner: Scanner, *walls: tuple[float, float, float]) -> int:
    scanner.now_s += LOOK_S
    view = scanner.view(*walls)
    scanner.space.observe(view, IDENTITY)
    return int(scanner.space.appeared(view, IDENTITY)[:, 3].sum())


NEAR, FAR = (-3.0, 3.0, 1.52), (-3.0, 3.0, 1.72)


def test_arrival_requires_previously_free_place() -> None:
    assert come(Scanner(), NEAR) == 0  # it may have been there before
    assert come(Scanner().look(), NEAR) > 0
    assert come(Scanner().look(FAR), NEAR) > 0
    wall = (-3.0, 3.0, 1.52 + 0.5 * P.apart_m)
    assert come(Scanner().look(wall, times=12), NEAR) == 0  # range noise
    scanner = Scanner().look()
    for _ in range(round(P.new_s / LOOK_S)):
        assert come(scanner, NEAR) > 0
    come(scanner, NEAR)
    assert come(scanner, NEAR) == 0  # static by now


def test_while_the_robot_moves_nothing_is_new_to_the_tracker_of_slow_bodies() -> None:
    def slow_returns(scanner: Scanner, x_m: float) -> int:
        scanner.now_s += LOOK_S
        view, pose = scanner.view(NEAR), Pose2(x_m, 0.0, 0.0)
        scanner.space.observe(view, pose)
        return len(scanner.space.appeared_while_standing(view, pose, SLOW))

    stood = round(SLOW.follow_s / LOOK_S) + 1
    standing = Scanner()
    for number in range(stood):
        standing.look(pose=Pose2(0.015 * (number % 2), 0.0, 0.0))  # noise of odometry
    assert slow_returns(standing, 0.0) > 0
    creeping = Scanner()
    for number in range(stood):
        creeping.look(pose=Pose2(0.004 * number, 0.0, 0.0))  # 0.04 m/s
    assert slow_returns(creeping, 0.004 * stood) == 0
    wall = (NEAR[0], NEAR[1], NEAR[2] + 0.1)  # the same, from 0.1 m farther back
    known = (
        Scanner().look(pose=Pose2(-0.3, 0.0, 0.0)).look(wall, pose=Pose2(-0.1, 0.0, 0.0)).look(NEAR, times=stood + 1)
    )
    assert slow_returns(known, 0.0) == 0


def test_a_slow_hidden_body_is_kept_on_its_course_and_straight_before_the_robot() -> None:
    """The course of a slow one that gets hidden is known to some 20 deg."""
    scanner = Scanner()
    scanner.look(vouch=False)
    body_there = np.array([[2.0, 0.2, 0.5]])
    scanner.space.mark_slow_hidden_body(body_there, -0.2, 0.1, IDENTITY)
    scanner.now_s += LOOK_S
    places = scanner.remembered()[:, :2]
    straight, course = (0.58, 0.2), (0.57, 0.92)
    for place in (straight, course):
        assert np.hypot(*(places - place).T).min() < 0.15, place
    scanner = Scanner()
    scanner.look(vouch=False)
    scanner.space.mark_slow_hidden_body(body_there, 0.2, 0.0, IDENTITY)
    scanner.now_s += LOOK_S
    assert scanner.remembered()[:, 0].min() > 1.95  # it leaves


def test_lost_person_is_remembered_only_in_hidden_area() -> None:
    someone = np.array([[SEEN[0], SEEN[1], 1.2]])
    scanner = Scanner().look(NEAR)
    behind = (2.62, 0.02)  # in the shadow of the wall
    scanner.space.mark_hidden_body(np.array([[2.22, 0.02, 1.2]]), 0.4 / P.coast_s, 0.0, IDENTITY)
    assert scanner.at(*behind) == OCCUPIED
    scanner.look(times=PARAMS.passes)
    assert scanner.at(*behind) == FREE
    scanner.space.mark_hidden_body(someone, -0.4 / P.coast_s, 0.0, IDENTITY)
    assert scanner.at(SEEN[0] - 0.4, SEEN[1]) == FREE  # in view: a person there would be visible
    blind = Scanner()
    blind.look(vouch=False)
    blind.space.mark_hidden_body(np.array([[1.2, 0.0, 1.2]]), -3.0, 0.0, IDENTITY)
    found = blind.remembered()
    assert len(found) == 0 or found[:, 0].min() > 0.5  # never inside the robot


def test_a_person_who_is_still_returned_has_stopped_in_view() -> None:
    scanner = Scanner().look(times=3).look(NEAR, times=3)
    there = np.array([[SEEN[0], y, 1.2] for y in (-0.1, 0.0, 0.1)])
    assert scanner.space.stands_in_view(there, -0.5, 0.0)
    assert not scanner.space.stands_in_view(there, 0.5, 0.0)  # hidden by itself
    assert not scanner.space.stands_in_view(there + np.array([-0.5, 0.0, 0.0]), -0.5, 0.0)  # went on from there
    assert not scanner.space.stands_in_view(
        there * np.array([1.0, 1.0, 0.1]), -0.5, 0.0
    )  # lower than the rays ahead of it
    scanner.look()
    scanner.now_s += PARAMS.fade_s
    scanner.look()
    assert not scanner.space.stands_in_view(there, -0.5, 0.0)  # no longer returned


def test_a_moving_object_is_followed_to_its_predicted_place() -> None:
    movers = MovingObjects(P)
    now_s = follow(movers, 1.5, 1.0, noise=False)
    movers.look(np.empty((0, 5)), now_s + 0.5, blind)
    assert movers.follows(2.0, 0.5, now_s + 0.5)
    assert not movers.follows(3.0, 0.5, now_s + 0.5)
    standing = MovingObjects(P)
    for number in range(10):
        standing.look(body(2.0, 0.5), 10.0 + number * LOOK_S, blind)
    assert not standing.follows(2.0, 0.5, 11.0)


def test_visibility_requires_object_above_lowest_ray_and_outside_robot() -> None:
    scanner = Scanner(HIGH).look(vouch=True)
    assert not scanner.space.is_visible(*SEEN, 1.7)  # a child fits below rays at 1.2 m
    assert scanner.space.is_visible_upright(*SEEN, 1.7)
    assert not scanner.space.is_visible_upright(*SEEN, 1.2)
    scanner.origin_m = (0.45, 0.0, 0.40)
    scanner.look()
    assert scanner.space.is_visible(*SEEN, 1.7)
    assert scanner.space.is_visible(*SEEN, 0.5)
    assert not scanner.space.is_visible(*SEEN, 0.25)
    assert not scanner.space.is_visible(0.3, 0.0, 1.7)
    assert not scanner.space.is_visible(-2.0, 0.0, 1.7)
    scanner.origin_m = LOW
    scanner.look()
    scanner.origin_m = (0.45, 0.0, 0.40)
    scanner.look()
    assert scanner.space.is_visible(*SEEN, 0.25)  # covered by a lower ray just now
    scanner.look(times=round(PARAMS.fade_s / LOOK_S))
    assert not scanner.space.is_visible(*SEEN, 0.25)


def test_a_child_that_walks_up_is_known_to_come_and_walls_stay_where_they_are() -> None:
    """The robot drives, with an odometry error of 0.5 %."""
    yard = Yard(child=CHILD)
    yard.pipeline.motion.on_odometry(100.0, IDENTITY, Twist2(0.0, 0.0, 0.0))
    yard.run(1.0, Twist2(0.5, 0.1, 0.2))
    scenes = [yard.step() for _ in range(40)]
    assert all(len(scene.moving) == 0 for scene in scenes)
    x, y = yard.pose.x, yard.pose.y
    yard.at["child"] = (x + 3.5, y + 1.0)
    yard.twist = Twist2(0.0, 0.0, 0.0)
    yard.walk("child", (x + 1.6, y + 0.4))
    assert yard.scene is not None
    moving = yard.scene.moving
    assert len(moving) > 3
    assert np.hypot(moving[:, 3], moving[:, 4]).mean() == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("chair", [False, True])
@pytest.mark.parametrize("bearing_deg", [0.0, 80.0, 180.0])
def test_a_fast_body_is_known_eight_metres_away(chair: bool, bearing_deg: float) -> None:
    """At 6 m/s from 11.5 m, on both seams of the main LiDAR, and where the attached chair hides it from that."""
    yard = Yard(chair=chair, who=ADULT)
    yard.run(1.5)
    c, s = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    yard.at["who"] = (11.5 * c, 11.5 * s)
    moving = yard.walk("who", (8.0 * c, 8.0 * s), 6.0).step().moving
    assert len(moving) > 0
    assert moving[:, 3].mean() == pytest.approx(-6.0 * c, abs=0.8)
    assert moving[:, 4].mean() == pytest.approx(-6.0 * s, abs=0.8)


def test_a_drive_among_walls_shows_no_fast_bodies() -> None:
    yard = Yard(post=POLE, block=Block(1.5, 0.2, 0.0, 0.5), other=ADULT)
    yard.at.update(post=(4.0, 1.5), block=(6.0, -2.0), other=(8.0, 1.0))
    for twist in (Twist2(1.5, 0.0, 0.0), Twist2(0.8, 0.3, 0.6), Twist2(0.0, 0.0, 1.0)):
        yard.twist = twist
        for _ in range(40):
            moving = yard.step().moving
            assert np.hypot(moving[:, 3], moving[:, 4]).max(initial=0.0) < FAST.slowest_mps


def test_person_entering_blind_strip_before_knees_is_remembered() -> None:
    """The person ends in the strip that neither LiDAR sees."""
    yard = Yard(chair=True, who=ADULT)
    yard.run(0.5)
    yard.at["who"] = (4.0, 0.0)
    yard.walk("who", (1.75, 0.0))
    yard.run(1.0)
    assert any(state_at(yard, x, 0.02) == OCCUPIED for x in np.arange(1.45, 1.75, 0.05))


@pytest.mark.parametrize("speed_mps", [0.5, 1.0])
def test_a_low_cart_that_goes_before_the_knees_is_remembered_right_before_them(speed_mps: float) -> None:
    """The strip in which neither LiDAR sees an object 0.25 m high is 1.5 m long."""
    yard = Yard(chair=True, who=Post(0.30, 0.25))
    yard.run(1.0)
    yard.at["who"] = (4.5, 0.0)
    yard.walk("who", (1.75, 0.0), speed_mps).run(2.5)
    assert yard.scene is not None
    assert near(yard.scene.obstacles, 1.4, 0.0, 0.35) > 0


@pytest.mark.parametrize(("speed_mps", "from_m"), [(0.3, 5.0), (0.48, 4.3), (1.0, 6.5)])
def test_a_slow_long_cart_that_goes_before_the_knees_is_remembered_right_before_them(
    speed_mps: float, from_m: float
) -> None:
    """At 0.3 m/s the cart takes 3 s to leave a place, longer than a point counts as new. It is an obstacle until its
    rear passes the last rays that are low enough."""
    yard = Yard(chair=True, who=Block(0.45, 0.25, 0.05, 0.25))
    yard.run(1.0)
    yard.at["who"] = (from_m, 0.0)
    for to_m in (3.3, 2.9, 2.6):
        scene = yard.walk("who", (to_m, 0.0), speed_mps).scene
        assert scene is not None
        assert near(scene.obstacles, max(to_m - 0.45, 2.95), 0.0, 0.3) > 10, to_m
    yard.walk("who", (1.91, 0.0), speed_mps).run(2.5)
    assert yard.scene is not None
    assert near(yard.scene.obstacles, 1.46, 0.0, 0.3) > 0
