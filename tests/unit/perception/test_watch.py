"""Detection of unreliable sweeps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.robot_shape import planar
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.watch import DIRECTIONS, Watch, too_near
from sim.lidar.views import sweep_at
from sim.worldfile import load_world
from tests.unit.perception.scenes import sweep

LATCHED = load_docks().latched_wheelchair()
WATCH = load(PerceptionParams, "perception_pipeline").watch
HEIGHT_M = load_robot().lidar_xyz_m[2]


def halves(seed: int = 0) -> tuple[Points, Points]:
    points = sweep(columns=1800, seed=seed)
    return points[points["y"] >= 0.0], points[points["y"] < 0.0]


def test_the_same_points_again_are_frozen_even_half_by_half() -> None:
    watch, (left, right) = Watch(WATCH, HEIGHT_M), halves()
    assert not watch.frozen(left)
    assert not watch.frozen(right)
    assert watch.frozen(left.copy())
    assert watch.frozen(right)
    assert not watch.frozen(halves(1)[0])


def test_too_few_returns_are_a_cover() -> None:
    left, _ = halves()
    assert Watch(WATCH, HEIGHT_M).blind(left[::20], 0.0).startswith("covered")
    assert Watch(WATCH, HEIGHT_M).blind(left[:0], 0.0).startswith("covered: 0 returns")


def dark_deg(watch: Watch) -> list[int]:
    """Returns the start of the blind directions, deg."""
    return [-180 + 10 * int(i) for i in np.flatnonzero(watch.blind_sectors)]


def test_a_direction_without_returns_is_blind_soon() -> None:
    watch, told_s = Watch(WATCH, HEIGHT_M), math.nan
    for step in range(20):
        half = halves(step)[step % 2]
        angle = np.degrees(np.arctan2(half["y"], half["x"]))
        assert watch.blind(half[~((angle > 40.0) & (angle < 70.0))], 0.05 * step) == ""
        if watch.blind_sectors.any():
            told_s = 0.05 * step
            break
    assert dark_deg(watch) == [50, 60]
    assert told_s <= 0.25


def test_many_blind_directions_are_a_covered_sensor() -> None:
    for width_deg, blind in ((90.0, False), (110.0, True)):
        watch, problem = Watch(WATCH, HEIGHT_M), ""
        for step in range(8):
            half = halves(step)[step % 2]
            angle = np.degrees(np.arctan2(half["y"], half["x"]))
            problem = watch.blind(half[np.abs(angle) > 0.5 * width_deg], 0.05 * step)
        assert problem.startswith("blind in") == blind


def test_near_returns_cover_a_direction() -> None:
    watch, problem = Watch(WATCH, HEIGHT_M), ""
    for step in range(8):
        half = halves(step)[step % 2].copy()
        angle = np.degrees(np.arctan2(half["y"], half["x"]))
        hidden = np.abs(angle + 90.0) < 15.0
        share = 0.5 / np.linalg.norm([half[name][hidden] for name in "xyz"], axis=0)
        for name in "xyz":
            half[name][hidden] *= share
        problem = watch.blind(half, 0.05 * step)
    assert problem == ""
    assert dark_deg(watch) == [-100, -90]


def test_a_blind_direction_is_an_obstacle_beside_the_robot(robot: Robot) -> None:
    """Directly in front of a wall nothing is seen ahead: the robot must not drive there, but elsewhere it may."""
    params = load(PerceptionParams, "perception_pipeline")
    pipeline = Pipeline(robot, params)
    obstructed = np.zeros(DIRECTIONS, np.bool_)
    obstructed[170:190] = True  # 10 deg to either side of ahead
    points = halves(0)[0]
    seen, blind = pipeline.scene(points, 0.0).obstacles, pipeline.scene(points, 10.0, obstructed).obstacles
    added = blind[np.abs(blind[:, 0] - robot.footprint.front_m) < 0.1]
    assert len(added) >= 2
    assert not len(seen[np.abs(seen[:, 0] - robot.footprint.front_m) < 0.1])
    assert np.all(added[:, 0] - robot.footprint.front_m == pytest.approx(0.06, abs=0.03))
    assert np.all(np.abs(added[:, 1]) < 0.1)


def test_one_lost_half_sweep_causes_no_blind_sector() -> None:
    watch = Watch(WATCH, HEIGHT_M)
    for step in (0, 1, 2, 4, 5, 6):
        half = halves(step)[step % 2]
        assert not watch.frozen(half)
        assert watch.blind(half, 0.05 * step) == ""
        assert not watch.blind_sectors.any()


def test_chair_excuses_only_directions_below_the_minimum_range(robot: Robot) -> None:
    """The board is 0.75 m from the LiDAR, which measures from 0.6 m on: dirt is detected there as elsewhere."""
    assert not too_near(robot, LATCHED, WATCH).any()
    assert not too_near(robot, None, WATCH).any()
    lidar = robot.range_sensors["lidar"].model_copy(update={"xyz_m": (0.45, 0.0, 0.70)})
    nearer = robot.model_copy(update={"range_sensors": {"lidar": lidar}})
    excused = too_near(nearer, LATCHED, WATCH)
    # At 0.5 m to the board, 0.6 m are reached 34 deg to either side of ahead.
    assert [int(i) for i in np.flatnonzero(excused)] == list(range(14, 22))
    watch = Watch(WATCH, HEIGHT_M)
    for step in range(10):
        half = halves(step)[step % 2]
        angle = np.degrees(np.arctan2(half["y"], half["x"]))
        assert watch.blind(half[np.abs(angle) > 35.0], 0.05 * step, excused) == ""
    assert not watch.blind_sectors.any()
    assert not watch.obstructed.any()


def test_with_a_chair_every_direction_still_shows_something() -> None:
    assert LATCHED is not None
    watch = Watch(WATCH, HEIGHT_M)
    for step in range(6):
        points, _ = sweep_at(load_world("flat"), np.eye(4), seed=step, chair=planar(LATCHED))
        left = points["y"] >= 0.0
        assert watch.blind(points[left if step % 2 else ~left], 0.05 * step) == ""
        assert not watch.blind_sectors.any()
        assert not watch.obstructed.any()


def hidden_low(step: int, from_deg: float, width_deg: float) -> Points:
    """Returns a half sweep without the steep downward beams in some directions."""
    half = halves(step)[step % 2]
    angle = np.degrees(np.arctan2(half["y"], half["x"]))
    low = half["z"] < -0.28 * np.hypot(half["x"], half["y"])
    return half[~(low & (angle > from_deg) & (angle < from_deg + width_deg))]


@pytest.mark.parametrize(("width_deg", "least", "most"), [(3.0, 0, 0), (6.0, 4, 7), (30.0, 28, 31)])
def test_object_below_the_minimum_range_hides_the_ground_behind_it(width_deg: float, least: int, most: int) -> None:
    """The background is visible above a child's head, but the ground in front is not."""
    watch = Watch(WATCH, HEIGHT_M)
    for step in range(10):
        assert watch.blind(hidden_low(step, 20.0, width_deg), 0.05 * step) == ""
    found = np.flatnonzero(watch.obstructed) - DIRECTIONS // 2
    assert not watch.blind_sectors.any()
    assert least <= len(found) <= most
    assert np.all((found >= 19) & (found <= 20 + width_deg))
    for step in range(10, 14):
        watch.blind(halves(step)[step % 2], 0.05 * step)
    assert not watch.obstructed.any()


def test_a_direction_behind_is_missed_across_the_circles_end() -> None:
    watch = Watch(WATCH, HEIGHT_M)
    for step in range(10):
        half = hidden_low(step, 176.0, 5.0)
        angle = np.degrees(np.arctan2(half["y"], half["x"]))
        watch.blind(half[np.abs(angle) < 176.0], 0.05 * step)
    assert watch.obstructed[[0, 1, 2, 3, 356, 357, 358, 359]].all()


@pytest.mark.parametrize(
    ("stamp_s", "problem"), [(10.2, "in the future"), (9.0, "1.00 s old"), (math.nan, "future"), (9.99, "")]
)
def test_stamps_must_be_of_now(stamp_s: float, problem: str) -> None:
    found = Watch(WATCH, HEIGHT_M).stamp_problem(stamp_s, 10.0)
    assert problem in found
    assert bool(found) == bool(problem)


def test_stamps_must_increase_and_may_restart_with_the_clock() -> None:
    watch = Watch(WATCH, HEIGHT_M)
    assert watch.stamp_problem(10.0, 10.01) == ""
    assert "does not increase" in watch.stamp_problem(10.0, 10.02)
    assert watch.stamp_problem(3.0, 3.01) == ""
