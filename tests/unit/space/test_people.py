"""People in the grid of the space: walking, standing, hidden, in a group, beside furniture, and what is none."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.people import Person, people_of, people_points
from robot_stack.core.robot import load_robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Scene as PerceptionScene
from robot_stack.perception.space.kernels import OCCUPIED
from robot_stack.perception.space.moving_objects import MovingBody
from robot_stack.perception.space.people import People
from robot_stack.perception.space.space import Space, SpaceGrid
from robot_stack.perception.space.view import view_of_beams
from tests.support.sweeps import SWEEP_S, Sweeps
from tests.unit.space.yard import ADULT, Yard

P = load(PerceptionParams, "perception_pipeline").people
CELL_M, SIZE_M, GRID_S, RADIUS_M = 0.05, 10.0, 0.2, 0.25
Mask = npt.NDArray[np.bool_]
Place = tuple[float, float]
Y, X = (np.mgrid[0 : round(SIZE_M / CELL_M), 0 : round(SIZE_M / CELL_M)] + 0.5) * CELL_M
NOTHING = np.zeros(X.shape, np.bool_)
ROBOT_AT = Pose2(5.0, 1.0, math.pi / 2.0)


def at(*places: Place) -> Mask:
    return np.asarray(np.any([np.hypot(X - x, Y - y) < RADIUS_M for x, y in places], axis=0))


class Scene:
    """Sweeps of a LiDAR at 10 Hz, and the people of every second one."""

    def __init__(self) -> None:
        self.sweeps, self.now_s = Sweeps(load_robot(), np.random.default_rng(1)), 0.0
        self.people: tuple[Person, ...] = ()

    def see(self, occupied: Mask, pose: Pose2 = ROBOT_AT) -> None:
        self.now_s += SWEEP_S
        self.sweeps.sweep(self.now_s, pose, occupied, CELL_M, 0.0, 0.0)
        if round(self.now_s / SWEEP_S) % 2 == 0:
            self.people = self.sweeps.people(self.now_s)

    def walk(self, begin: Place, end: Place, speed_mps: float, beside: Mask = NOTHING) -> None:
        for _ in range(5):
            self.see(beside)
        length_m = math.dist(begin, end)
        for way_m in np.arange(0.0, length_m, speed_mps * SWEEP_S):
            share = way_m / length_m
            x, y = (a + share * (b - a) for a, b in zip(begin, end, strict=True))
            self.see(beside | at((x, y)))

    def near(self, place: Place, within_m: float = 0.4) -> list[Person]:
        return [one for one in self.people if math.dist(one.at(self.now_s), place) < within_m]


class Grids:
    """Grids every 0.2 s, with given bodies."""

    def __init__(self) -> None:
        self.tracker, self.now_s = People(P), 0.0

    def see(self, occupied: Mask, bodies: Sequence[MovingBody] = (), kept: Mask = NOTHING) -> tuple[Person, ...]:
        """occupied: cells that return. kept: hidden ones."""
        self.now_s += GRID_S
        grid = SpaceGrid(
            np.where(occupied | kept, 100, 0).astype(np.int8),
            (0.0, 0.0),
            CELL_M,
            np.where(occupied, self.now_s, -np.inf),
            np.full(X.shape, -np.inf),
        )
        return self.tracker.look(self.now_s, grid, bodies)


def body(x: float, y: float, vx: float = 1.0, vy: float = 0.0, extent_m: Place = (0.4, 0.4)) -> MovingBody:
    return MovingBody(x, y, vx, vy, 0.03, 0.1, extent_m)


def test_a_walking_person_has_place_velocity_and_number() -> None:
    scene = Scene()
    scene.walk((2.5, 4.0), (7.5, 4.0), 1.0)
    (one,) = scene.near((7.4, 4.0))
    assert one.walks
    assert not one.in_group
    assert (one.vx, one.vy) == (pytest.approx(1.0, abs=0.2), pytest.approx(0.0, abs=0.2))
    number = one.number
    for x in np.arange(7.5, 8.2, 0.1):
        scene.see(at((float(x), 4.0)))
    assert [one.number for one in scene.near((8.2, 4.0))] == [number]


def test_who_has_stopped_remains_a_person_while_seen() -> None:
    scene = Scene()
    scene.walk((2.5, 4.0), (5.0, 4.0), 1.0)
    for _ in range(round(20.0 / SWEEP_S)):
        scene.see(at((5.0, 4.0)))
    (one,) = scene.near((5.0, 4.0))
    assert one.walked
    assert not one.walks
    assert one.velocity == (0.0, 0.0)
    for _ in range(round((P.memory_s + 2.0) / SWEEP_S)):
        scene.see(NOTHING)
    assert not scene.people


def test_who_is_hidden_while_walking_is_predicted_for_a_moment() -> None:
    grids = Grids()
    for step in range(6):
        x = 2.0 + GRID_S * step
        grids.see(at((x, 4.0)), [body(x, 4.0)])
    (one,) = grids.see(NOTHING)
    assert one.at(grids.now_s) == (pytest.approx(3.2), pytest.approx(4.0))
    for _ in range(round(P.memory_s / GRID_S)):
        people = grids.see(NOTHING)
    assert not people


def test_who_stands_hidden_is_kept_until_rays_pass() -> None:
    grids, place = Grids(), at((3.0, 4.0))
    for step in range(6):
        grids.see(at((2.0 + GRID_S * step, 4.0)), [body(2.0 + GRID_S * step, 4.0)])
    grids.see(place)
    for _ in range(50):
        (one,) = grids.see(NOTHING, kept=place)
        assert one.walked
    assert grids.see(NOTHING) == ()


def test_the_shadow_of_who_approaches_is_no_part_of_the_person() -> None:
    """The cells in a person's shadow stay occupied: no ray frees them."""
    scene = Scene()
    scene.walk((5.0, 7.0), (5.0, 3.0), 1.0)
    for _ in range(30):
        scene.see(at((5.0, 3.0)))
    (one,) = scene.near((5.0, 3.0))
    assert one.walked
    assert not one.in_group


def test_an_object_that_never_walked_is_no_person() -> None:
    scene = Scene()
    for _ in range(30):
        scene.see(at((5.0, 4.0)))
    (one,) = scene.near((5.0, 4.0))
    assert not one.walked


def test_walls_and_boxes_that_come_into_view_do_not_walk() -> None:
    """The robot passes boxes, whose shadows move along the wall behind them."""
    scene = Scene()
    boxes = (abs(Y - 7.0) < 0.2) | ((abs(Y - 4.5) < 0.3) & (X % 3.0 < 0.5))
    for step in range(100):
        scene.see(boxes, Pose2(1.5 + 0.06 * step, 2.0, 0.0))
        assert not any(one.walked for one in scene.people)


def test_a_person_who_walks_along_a_wall_leaves_it_an_obstacle() -> None:
    scene, wall = Scene(), abs(Y - 4.35) < 0.1
    scene.walk((2.0, 4.0), (7.0, 4.0), 1.0, wall)
    assert all(one.box is None or one.in_group for one in scene.people if one.walks)


def test_who_stops_in_a_gate_remains_a_person() -> None:
    """The gap to the gate's post is smaller than ``join_m``."""
    scene, gate = Scene(), (abs(Y - 4.0) < 0.1) & ((X < 4.3) | (X > 5.6))
    scene.walk((5.2, 7.0), (5.2, 4.05), 0.8, gate)
    for _ in range(round(10.0 / SWEEP_S)):
        scene.see(gate | at((5.2, 4.05)))
    (one,) = scene.near((5.2, 4.05), 0.45)
    assert one.walked
    assert not one.in_group
    for _ in range(30):
        scene.see(gate)
    assert not any(one.walked for one in scene.people), "the gate is none"


def test_larger_bodies_stay_obstacles() -> None:
    grids, cart = Grids(), (abs(X - 5.0) < 0.6) & (abs(Y - 5.0) < 0.3)
    assert grids.see(cart, [body(5.0, 5.0, extent_m=(1.2, 0.6))]) == ()


def converging(grids: Grids) -> tuple[Place, Place]:
    """Two walkers come together until one body covers both. Returns their places."""
    x, half_m = 1.5, 0.6
    for _ in range(12):
        x, half_m = x + 0.24, max(half_m - 0.06, 0.3)
        ends = (x, 5.0 - half_m), (x, 5.0 + half_m)
        large = [body(x, 5.0, 1.2, extent_m=(0.25, 2.0 * half_m + 0.4))]
        grids.see(at(*ends), large if half_m < 0.4 else [body(*end, 1.2) for end in ends])
    return (x, 5.0 - half_m), (x, 5.0 + half_m)


def test_walkers_who_come_together_go_on_walking() -> None:
    grids = Grids()
    ends = converging(grids)
    people = sorted(grids.tracker.people, key=lambda one: one.y)
    assert [(one.walks, one.in_group, one.velocity) for one in people] == [(True, False, (1.2, 0.0))] * 2
    assert np.array([(one.x, one.y) for one in people]) == pytest.approx(np.array(ends), abs=0.1)
    assert {one.number for one in people} == {1, 2}
    for _ in range(3):
        grids.see(at(*ends))
    assert [(one.walks, one.walked) for one in grids.tracker.people] == [(False, True)] * 2


def test_walkers_who_come_together_are_followed_by_sweeps() -> None:
    scene = Scene()
    for step in range(-5, 34):
        y, half_m = 5.9 - 0.12 * step, max(0.5 - 0.015 * step, 0.3)
        scene.see(NOTHING if step < 0 else at((5.0 - half_m, y), (5.0 + half_m, y)))
        if step < 10:
            continue
        walkers = [one for one in scene.people if one.walks and not one.in_group]
        assert [one.vy for one in walkers] == pytest.approx([-1.2, -1.2], abs=0.2)
        for x in (5.0 - half_m, 5.0 + half_m):
            assert min(math.dist(one.at(scene.now_s), (x, y)) for one in walkers) < RADIUS_M


def test_a_cart_takes_nobody_along_who_stands() -> None:
    grids = Grids()
    for step in range(6):
        grids.see(at((2.0 + GRID_S * step, 5.0)), [body(2.0 + GRID_S * step, 5.0)])
    for step in range(20):
        x = 1.5 + GRID_S * step
        cart = (abs(X - x) < 0.6) & (abs(Y - 4.4) < 0.25)
        people = grids.see(cart | at((3.0, 5.0)), [body(x, 4.4, extent_m=(1.2, 0.9))])
        assert not any(one.walks for one in people if one.stamp_s == grids.now_s)


def test_a_walker_beside_an_object_that_the_map_lacks_is_planned_with() -> None:
    """Its cells remain those of the object."""
    grids, table = Grids(), (abs(X - 5.0) < 0.8) & (abs(Y - 4.0) < 0.5)
    for step in range(16):
        place = 2.0 + GRID_S * step, 4.9
        grids.see(table | at(place), [body(*place)])
    (one,) = grids.tracker.people
    assert one.walks
    assert not one.in_group
    assert one.box is None


def test_a_stored_place_without_a_return_is_nobody() -> None:
    """Where a walker may be, who got hidden, the space is occupied, but nothing returns."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(2.0, 2.4, 0.05), np.arange(-0.2, 0.2, 0.05)))
    hidden = np.column_stack((x, y, np.full(x.size, 1.7)))
    space = Space(load(PerceptionParams, "perception_pipeline").space, load_robot())
    nothing = view_of_beams(1.0, (0.2, 0.0, 0.2), np.empty((0, 3), np.float32), *(np.empty(0, np.bool_),) * 2, 8.0)
    space.observe(nothing, IDENTITY)
    space.mark_hidden_body(hidden, -0.5, 0.0, IDENTITY)
    grid = space.grid()
    assert (grid.state == OCCUPIED).sum() > 20
    assert People(P).look(1.0, grid, ()) == ()


def test_one_person_seen_by_two_sensors_is_one() -> None:
    (one,) = Grids().see(at((5.0, 5.0)), [body(4.9, 5.0), body(5.1, 5.0)])
    assert one.walks


def test_cells_that_a_walker_has_just_left_belong_to_the_walker() -> None:
    (one,) = Grids().see(at((5.0, 5.0), (4.6, 5.0)), [body(5.0, 5.0, vx=1.4)])
    assert one.walks
    assert not one.in_group
    assert one.box == pytest.approx((4.35, 4.75, 5.25, 5.25), abs=CELL_M)


def row_that_stops(grids: Grids) -> list[Place]:
    """Four people come one after the other and stop side by side, nearer to each other than ``join_m``."""
    ends = [(4.0, 3.0 + 0.55 * k) for k in range(4)]
    for step in range(60):
        come = [(5.0 + 1.2 * k - 0.2 * step, y) for k, (_, y) in enumerate(ends)]
        places = [(max(x, 4.0), y) for x, y in come]
        grids.see(at(*places), [body(x, y, -1.0) for x, y in come if x > 4.0])
    return ends


def walked(grids: Grids) -> list[Place]:
    return sorted(((one.x, one.y) for one in grids.tracker.people if one.walked), key=lambda place: place[1])


def test_a_group_that_stops_side_by_side_remains_people() -> None:
    grids = Grids()
    ends = row_that_stops(grids)
    assert np.ptp([y for _, y in ends]) + 0.5 > P.max_size_m
    assert np.array(walked(grids)) == pytest.approx(np.array(ends), abs=0.15)
    assert not any(one.walks for one in grids.tracker.people)


def test_a_group_that_walks_on_separately_is_followed_at_once() -> None:
    grids = Grids()
    ends = row_that_stops(grids)
    assert all(one.in_group for one in grids.tracker.people)
    people = grids.see(at(ends[0], ends[2]))
    assert [one.walked for one in people if not one.in_group] == [True, True]


def test_a_group_is_followed_for_its_time() -> None:
    grids = Grids()
    ends = row_that_stops(grids)
    for _ in range(round((P.group_s + P.memory_s) / GRID_S) + 1):
        grids.see(at(*ends))
    assert not walked(grids)


def test_a_person_beside_furniture_is_not_found_in_it() -> None:
    grids, table = Grids(), (abs(X - 5.0) < 0.8) & (abs(Y - 5.0) < 0.5)
    for step in range(11):
        grids.see(table | at((2.0 + 0.2 * step, 5.0)), [body(2.0 + 0.2 * step, 5.0)])
    for _ in range(round(P.memory_s / GRID_S) + 1):
        grids.see(table)
    assert not grids.tracker.people


def test_a_clock_that_was_set_back_drops_all() -> None:
    grids = Grids()
    grids.see(at((5.0, 5.0)))
    grids.now_s -= 5.0
    assert grids.see(NOTHING) == ()


# --- behind the simulated LiDARs --------------------------------------------------------------------------------------


class PeopledYard(Yard):
    """people: of every fourth sweep, as the node publishes them."""

    people: tuple[Person, ...] = ()
    sweeps = 0

    def step(self) -> PerceptionScene:
        scene = super().step()
        self.sweeps += 1
        if self.sweeps % 4 == 0:
            self.people = self.pipeline.people(self.now_s)
        return scene

    def near(self, place: Place) -> list[Person]:
        return [one for one in self.people if math.dist(one.at(self.now_s), place) < 0.5]


@pytest.mark.parametrize("chair", [False, True], ids=["alone", "chair"])
def test_a_person_who_comes_and_stops_beside_the_robot_remains_one(chair: bool) -> None:
    yard = PeopledYard(chair=chair, who=ADULT)
    yard.at["who"] = (2.0, 4.5)
    yard.run(1.0)
    yard.walk("who", (2.0, 2.2))
    (one,) = yard.near((2.0, 2.2))
    assert one.walks
    assert not one.in_group
    assert (one.vx, one.vy) == (pytest.approx(0.0, abs=0.25), pytest.approx(-1.0, abs=0.25))
    yard.run(10.0)
    (one,) = yard.near((2.0, 2.2))
    assert one.walked
    assert not one.walks
    assert not one.in_group
    others = [other for other in yard.people if other is not one]
    assert not any(other.walked for other in others), "neither the robot nor its chair"


def test_a_restart_of_odometry_drops_people_and_moving_bodies() -> None:
    """Their places are those of the former frame."""
    yard = PeopledYard(who=ADULT)
    yard.at["who"] = (2.0, 4.5)
    yard.run(1.0)
    yard.walk("who", (2.0, 2.2))
    (one,) = yard.near((2.0, 2.2))
    assert yard.step().moving.size
    yard.pose = yard.pose.compose(Pose2(3.0, 1.0, 0.5))
    assert not yard.step().moving.size
    yard.run(0.2)
    assert one.number not in [other.number for other in yard.people]
    assert not any(other.walked for other in yard.people)


def test_a_post_that_the_robot_passes_does_not_walk() -> None:
    yard = PeopledYard(who=ADULT)
    yard.at["who"] = (2.5, 1.2)
    yard.run(1.0)
    for _ in range(20):
        yard.run(0.2, Twist2(0.8, 0.0, 0.0))
        assert not any(one.walked for one in yard.people)


# --- as a message -----------------------------------------------------------------------------------------------------


def test_people_pass_through_a_cloud_unchanged() -> None:
    box = (4.75, 4.75, 5.25, 5.25)
    walker = Person(
        9.5, 5.0, 5.0, 1.0, -0.5, 0.25, box, 0.0625, 0.125, 7, walks=True, walked=True, apart_s=9.5, number=3
    )
    post = Person(9.75, 2.0, 3.0, radius_m=0.5, number=4)
    assert people_of(people_points((walker, post), 10.0), 10.0) == (
        walker,
        post,
    )


def test_a_cloud_with_values_that_are_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        people_of(people_points((Person(1.0, math.nan, 0.0),), 1.0), 1.0)
