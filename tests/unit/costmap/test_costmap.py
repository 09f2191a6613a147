"""What the costmap shows of a place, as it is seen over time."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.costmap.costmap import FreeSpace, LocalCostmap
from robot_stack.costmap.params import CostmapParams
from tests.unit.costmap.scene import PARAMS, ROBOT, Place, box, picture, value_at


def test_nothing_seen_is_unknown_but_where_the_robot_stands() -> None:
    place = Place()
    place.ground_seen = False
    place.look()
    assert (place.at(0.0, 0.0), place.at(0.49, 0.34), place.at(-0.49, -0.34)) == (0, 0, 0)
    assert (place.at(0.6, 0.0), place.at(0.0, 0.4), place.at(4.0, 4.0)) == (-1, -1, -1)


def test_a_box_its_inflation_and_its_shadow() -> None:
    place = Place(box(2.0, 2.5, -0.5, 0.5)).look()
    assert place.at(2.02, 0.0) == 100
    assert place.at(1.80, 0.0) == 99
    assert 0 < place.at(1.40, 0.0) < 99
    assert place.at(1.0, 0.0) == 0
    assert place.at(4.0, 0.0) == -1  # behind it
    assert place.at(2.02, -2.0) == 0  # beside it


def test_size_corner_and_stamp() -> None:
    place = Place()
    place.pose = Pose2(1.26, -3.01, 1.0)
    costs = place.look().costmap.costs()
    assert costs.values.shape == (200, 200)
    assert costs.values.dtype == np.int8
    # floor(1.26 / 0.05) = 25 and floor(-3.01 / 0.05) = -61, each less half of 200 cells
    assert costs.corner_m == pytest.approx((-75 * 0.05, -161 * 0.05))
    assert (costs.resolution_m, costs.stamp_s) == (0.05, place.now_s)


def test_things_stay_in_place_while_the_robot_drives_and_turns() -> None:
    place = Place(box(2.0, 2.5, 1.0, 1.5))
    place.twist = Twist2(1.0, 0.0, 0.5)
    for _ in range(30):
        place.pose = place.pose.compose(exp_se2(place.twist, 0.05))
        place.look()
        assert place.at(2.02, 1.02) == 100
        assert place.at(1.0, 2.5) == 0


@pytest.mark.parametrize("ground_seen", [True, False])
def test_who_walks_on_leaves_no_trail(ground_seen: bool) -> None:
    place = Place(box(4.0, 4.1, -4.0, 4.0, 2.0), box(0.0, 0.1, 0.0, 0.1))
    place.ground_seen = ground_seen
    y = -1.5
    for _ in range(60):
        y += 0.05
        place.things[1] = box(2.0, 2.3, y, y + 0.3, 1.7)
        place.look()
    assert place.at(2.02, y + 0.02) == 100
    marks = np.argwhere(place.costmap.costs().values == 100)
    ys = marks[:, 0] * 0.05 + place.costmap.costs().corner_m[1]
    xs = marks[:, 1] * 0.05 + place.costmap.costs().corner_m[0]
    trail = ys[(xs > 1.9) & (xs < 2.4)]
    # 1 m/s: what was seen up to 0.25 s ago is kept, and one cloud more
    assert trail.min() > y - 0.25 - 0.05 - 0.10


def test_a_mark_that_nobody_sees_again_fades() -> None:
    """No ground, nothing behind it: neither seen through nor hidden."""
    place = Place(box(2.0, 2.2, 0.0, 0.2))
    place.ground_seen = False
    place.look(0.5)
    place.things.clear()
    place.look(PARAMS.marking.in_view_s - 0.1)
    assert place.at(2.02, 0.02) == 100
    place.look(0.2)
    assert place.at(2.02, 0.02) == 0


def test_what_is_hidden_is_kept_longer() -> None:
    place = Place(box(3.0, 3.2, -0.2, 0.2))
    place.look(1.0)
    place.things[0] = box(1.5, 1.6, -0.6, 0.6)  # steps before it
    place.look(PARAMS.marking.in_view_s + 1.0)
    assert place.at(3.02, 0.0) == 100
    place.look(PARAMS.marking.out_of_view_s)
    assert place.at(3.02, 0.0) < 100


def test_what_was_there_only_for_a_moment_is_not_remembered_when_hidden() -> None:
    place = Place(box(3.0, 3.2, -0.2, 0.2))
    place.look(0.2)
    place.things[0] = box(1.5, 1.6, -0.6, 0.6)
    place.look(PARAMS.marking.in_view_s + 0.5)
    assert place.at(3.02, 0.0) < 100


def test_a_low_box_is_not_forgotten_when_the_robot_is_too_near_to_see_it() -> None:
    """0.3 m high: hidden below the lowest ray from 0.7 m of the sensor on. The ground behind it is seen over it."""
    place = Place(box(2.0, 2.3, -0.3, 0.3, top_m=0.3))
    place.look(0.5)
    for x in np.arange(0.1, 1.21, 0.1):
        place.pose = Pose2(float(x), 0.0, 0.0)
        if x > 0.9:
            place.things.clear()
        place.look()
    place.look(3.0)
    assert place.at(2.02, 0.0) == 100
    for x in np.arange(1.2, -1.0, -0.2):  # from there it would be in view, and is not there
        place.pose = Pose2(float(x), 0.0, 0.0)
        place.look()
    place.look(0.5)
    assert place.at(2.02, 0.0) == 0


def test_who_stood_before_the_robot_and_left_is_gone() -> None:
    place = Place(box(0.8, 1.0, -0.2, 0.2, top_m=1.7)).look(0.5)
    assert place.at(0.82, 0.0) == 100
    place.things.clear()
    place.look(0.5)
    assert place.at(0.82, 0.0) == 0


def test_the_footprint_in_force_inflates_and_frees() -> None:
    place = Place(box(2.5, 3.0, -2.0, 2.0)).look()
    assert place.at(2.5 - 0.385, 0.0) != 99
    assert place.at(1.2, 0.0) == 0
    place.costmap.chair = True
    assert place.at(2.5 - 0.385, 0.0) == 99
    assert place.at(1.2, 0.0) > 0
    place.look()
    assert 0 < place.at(1.35, 0.0) < 99


def test_points_that_are_no_numbers_and_an_empty_cloud() -> None:
    place = Place(box(2.0, 2.2, 0.0, 0.2)).look()
    nonsense = np.full((3, 3), [math.nan, math.inf, 1.0], np.float32)
    place.now_s += 0.05
    place.costmap.on_odometry(place.now_s, IDENTITY, ZERO_TWIST)
    assert place.costmap.on_obstacles(place.now_s, nonsense) == ""
    assert place.costmap.on_obstacles(place.now_s, np.empty((0, 3), np.float32)) == ""
    assert place.at(2.02, 0.02) == 100


def test_without_odometry_there_is_no_costmap() -> None:
    costmap = LocalCostmap(PARAMS, ROBOT)
    points = np.ones((1, 3), np.float32)
    assert costmap.on_obstacles(1.0, points) == "no odometry at the stamp of the obstacles"
    costmap.on_odometry(1.0, IDENTITY, ZERO_TWIST)
    assert costmap.on_obstacles(1.0 + PARAMS.odometry.ahead_s - 0.01, points) == ""
    assert costmap.on_obstacles(1.0 + PARAMS.odometry.ahead_s + 0.01, points) != ""
    assert costmap.on_obstacles(0.9, points) != ""
    for bad in (Pose2(math.nan, 0.0, 0.0), Pose2(0.0, math.inf, 0.0)):
        assert costmap.on_odometry(2.0, bad, ZERO_TWIST) == "odometry is not finite"
    assert costmap.on_odometry(2.0, IDENTITY, Twist2(math.nan, 0.0, 0.0)) == "odometry is not finite"


def test_a_cloud_between_two_odometry_messages_is_placed_between_them() -> None:
    costmap = LocalCostmap(PARAMS, ROBOT)
    costmap.on_odometry(1.0, IDENTITY, ZERO_TWIST)
    costmap.on_odometry(1.1, Pose2(0.2, 0.0, 0.0), ZERO_TWIST)
    costmap.on_obstacles(1.05, np.array([[1.01, 0.01, 0.5]], np.float32))
    assert value_at(costmap.costs(), 1.11, 0.01) == 100
    costmap.on_odometry(1.2, Pose2(0.3, 0.0, 0.0), Twist2(1.0, 0.0, 0.0))
    costmap.on_obstacles(1.25, np.array([[1.01, 1.01, 0.5]], np.float32))
    assert value_at(costmap.costs(), 1.36, 1.01) == 100


@pytest.mark.parametrize(("stamp_s", "x_m"), [(100.10, 2.0), (50.0, 0.0)])
def test_odometry_that_begins_anew_forgets_everything(stamp_s: float, x_m: float) -> None:
    place = Place(box(2.0, 2.2, 0.0, 0.2)).look()
    place.costmap.on_odometry(stamp_s, Pose2(x_m, 0.0, 0.0), ZERO_TWIST)
    assert place.costmap.on_obstacles(stamp_s, np.empty((0, 3), np.float32)) == ""
    values = place.costmap.costs().values
    assert not (values == 100).any()
    assert (values == -1).sum() > 35000


def test_free_space_must_go_around_once() -> None:
    costmap = LocalCostmap(PARAMS, ROBOT)
    half = FreeSpace(np.ones(360, np.float32), -math.pi, math.pi / 360, 1.0)
    assert costmap.on_free_space(half) == "free space does not go once around: 180 deg"
    bad = FreeSpace(np.ones(360, np.float32), math.nan, math.pi / 180, 1.0)
    assert costmap.on_free_space(bad) != ""
    good = FreeSpace(np.ones(360, np.float32), -math.pi, math.pi / 180, 1.0)
    assert costmap.on_free_space(good) == "no odometry at the stamp of the free space"
    costmap.on_odometry(1.0, IDENTITY, ZERO_TWIST)
    assert costmap.on_free_space(good) == ""


def test_free_space_before_or_after_its_obstacles_makes_the_same_map() -> None:
    point = np.array([[3.0, 0.0, 0.5]], np.float32)
    ranges = np.full(360, 2.0, np.float32)
    ranges[:90] = math.nan
    maps = []
    for order in ("before", "after"):
        costmap = LocalCostmap(PARAMS, ROBOT)
        costmap.on_odometry(1.0, IDENTITY, ZERO_TWIST)
        costmap.on_obstacles(1.0, np.empty((0, 3), np.float32))
        free = FreeSpace(ranges, -math.pi, math.pi / 180, 1.0)
        if order == "before":
            costmap.on_free_space(free)
        costmap.on_obstacles(1.0, point)
        if order == "after":
            costmap.on_free_space(free)
        maps.append(costmap.costs())
    np.testing.assert_array_equal(maps[0].values, maps[1].values)
    assert value_at(maps[0], 0.0, 1.9) == 0
    assert value_at(maps[0], 0.0, -1.9) == 0
    assert value_at(maps[0], -0.9, -1.0) == -1  # not seen: the first quarter begins at -180 deg
    assert value_at(maps[0], 0.0, 2.1) == -1


def test_warming_up_leaves_no_trace() -> None:
    costmap = LocalCostmap(PARAMS, ROBOT)
    costmap.warm_up()
    assert costmap.on_obstacles(0.0, np.empty((0, 3), np.float32)) != ""
    assert (costmap.costs().values == -1).all()


def test_rolling_far_forgets_and_rolling_by_a_cell_does_not() -> None:
    place = Place(box(2.0, 2.2, 0.0, 0.2)).look()
    place.pose = Pose2(0.051, 0.101, 0.0)
    place.ground_seen = False
    place.things.clear()
    place.look()
    assert place.at(2.02, 0.02) == 100
    for x in np.arange(0.4, 12.0, 0.4):
        place.pose = Pose2(float(x), 0.1, 0.0)
        place.look()
    place.pose = Pose2(0.0, 0.1, 0.0)
    place.costmap.on_odometry(place.now_s, place.pose, ZERO_TWIST)
    place.look()
    assert place.at(2.02, 0.02) == -1


@pytest.mark.parametrize(
    ("field", "value"),
    [("size_m", math.nan), ("resolution_m", 0.0), ("directions", 4), ("size_m", None)],
)
def test_bad_parameters_are_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(ValidationError, match=field):
        CostmapParams.model_validate({**PARAMS.model_dump(), field: value})


def test_lives_must_grow() -> None:
    values = PARAMS.model_dump()
    values["marking"]["in_view_s"] = 100.0
    with pytest.raises(ValidationError, match="must grow in this order"):
        CostmapParams.model_validate(values)


def test_a_picture_can_be_drawn(tmp_path: Path) -> None:
    place = Place(box(2.0, 2.5, -0.5, 0.5)).look()
    picture(place.costmap.costs(), place.pose, tmp_path / "costmap.png")
    assert (tmp_path / "costmap.png").stat().st_size > 5000
