"""Complete scenes through all stages: which points are obstacles and which are not."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from robot_stack.core.point_cloud import Points
from robot_stack.perception import cells
from robot_stack.perception.deskew import Attitude
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.space.kernels import OCCUPIED
from tests.unit.perception.conftest import Look as Seen
from tests.unit.perception.conftest import inside
from tests.unit.perception.scenes import SENSOR_M, Slope, Solid, sweep

Look = Callable[[Points], Seen]
TEN_DEG = math.radians(10.0)


def free_at(seen: Seen, angle_rad: float) -> float:
    """Returns the distance of free ground in a direction of the sensor, m from base_link; 0 if no ground was seen."""
    count = len(seen.free_m)
    free_m = float(seen.free_m[int((angle_rad + math.pi) / (2.0 * math.pi) * count) % count])
    return free_m + SENSOR_M[0] * math.cos(angle_rad) if free_m > 0.0 else 0.0


def test_flat_ground_is_free_and_has_no_obstacles(look: Look) -> None:
    for lost, free in ((0.0, 20.0), (0.5, 5.0)):
        scene = look(sweep(lost=lost))
        assert len(scene.obstacles) == 0
        assert np.median(scene.free_m) > free


@pytest.mark.parametrize(("slope_rad", "foot_m"), [(TEN_DEG, 0.6), (TEN_DEG, 4.0), (-TEN_DEG, 0.6), (-TEN_DEG, 2.0)])
def test_a_ramp_is_ground(look: Look, slope_rad: float, foot_m: float) -> None:
    scene = look(sweep(slope=Slope(foot_m, slope_rad, 4.0)))
    assert len(inside(scene.obstacles, (0.3, 10.0), (-3.0, 3.0))) == 0
    assert free_at(scene, 0.0) > foot_m + 0.3


@pytest.mark.parametrize("slope_rad", [TEN_DEG, -TEN_DEG])
def test_a_robot_on_a_long_ramp_sees_ground_with_and_without_the_attitude(pipeline: Pipeline, slope_rad: float) -> None:
    """The plane under the robot is base_link's."""
    points = sweep()
    xyz = (np.stack([points["x"], points["y"], points["z"]], axis=1) + SENSOR_M).astype(np.float32)
    near = np.hypot(xyz[:, 0], xyz[:, 1]) < 8.0
    for attitude in (Attitude(0.0, slope_rad), Attitude(slope_rad, 0.0), None):
        seen = pipeline.segment(xyz, attitude)
        assert (seen.labels[near] == cells.GROUND).mean() > 0.995
        assert not np.isin(seen.labels[near], (cells.OBSTACLE, cells.KERB)).any()


def test_a_robot_on_a_ramp_sees_the_level_ground_behind_its_foot(pipeline: Pipeline) -> None:
    """In base_link the ground behind the foot rises by 10 deg; relative to gravity it is level."""
    points = sweep(slope=Slope(1.0, TEN_DEG, 30.0))
    xyz = (np.stack([points["x"], points["y"], points["z"]], axis=1) + SENSOR_M).astype(np.float32)
    near = np.hypot(xyz[:, 0], xyz[:, 1]) < 6.0
    raised = (cells.OBSTACLE, cells.KERB)
    assert not np.isin(pipeline.segment(xyz, Attitude(0.0, TEN_DEG)).labels[near], raised).any()
    # Without the attitude the foot is a bend of 10 deg in the robot's own plane: no worse than a ramp.
    assert np.isin(pipeline.segment(xyz, None).labels[near], raised).mean() < 1e-3


@pytest.mark.parametrize(("height_m", "distance_m"), [(0.05, 1.5), (0.05, 3.0), (0.12, 2.0)])
def test_a_kerb_is_an_obstacle(look: Look, height_m: float, distance_m: float) -> None:
    kerb = Solid((distance_m, -3.0, 0.0), (distance_m + 0.15, 3.0, height_m))
    scene = look(sweep([kerb], columns=2344))
    front = inside(scene.obstacles, (distance_m - 0.1, distance_m + 0.3), (-1.0, 1.0))
    assert len(np.unique(np.floor(front[:, 1] / 0.1))) >= 16, "80 % of 20 pieces of the front"
    assert free_at(scene, 0.0) < distance_m + 0.15
    assert len(inside(scene.obstacles, (0.5, distance_m - 0.2), (-1.0, 1.0))) == 0


def test_a_step_of_2_cm_is_no_obstacle(look: Look) -> None:
    assert len(look(sweep([Solid((2.0, -3.0, 0.0), (6.0, 3.0, 0.02))])).obstacles) == 0


@pytest.mark.parametrize("edge_m", [1.6, 2.5])
def test_a_drop_off_is_an_obstacle_at_its_edge(look: Look, edge_m: float) -> None:
    scene = look(sweep(hole=(edge_m, 40.0, 0.4)))
    edge = inside(scene.obstacles, (edge_m - 0.25, edge_m + 0.25), (-0.5, 0.5))
    assert len(np.unique(np.floor(edge[:, 1] / 0.1))) >= 9
    assert free_at(scene, 0.0) < edge_m + 0.25
    assert len(inside(scene.obstacles, (-5.0, 0.5), (-5.0, 5.0))) == 0


def test_ground_that_ends_without_any_return_behind_is_an_edge(look: Look) -> None:
    points = sweep()
    away = (points["x"] + SENSOR_M[0] > 2.0) & (np.abs(points["y"]) < points["x"])
    scene = look(points[~away])
    assert len(inside(scene.obstacles, (1.7, 2.1), (-0.5, 0.5))) >= 8


def test_an_edge_is_an_obstacle_at_once_and_stored_from_the_second_sweep_on(pipeline: Pipeline) -> None:
    points = sweep()
    ends = points[~((points["x"] + SENSOR_M[0] > 2.0) & (np.abs(points["y"]) < points["x"]))]

    def stored() -> int:
        known = pipeline.space.grid()
        rows, columns = np.nonzero(known.state == OCCUPIED)
        x, y = known.corner_m[0] + known.cell_m * columns, known.corner_m[1] + known.cell_m * rows
        return int(((x > 1.7) & (x < 2.1) & (np.abs(y) < 0.5)).sum())

    def shown(stamp_s: float) -> int:
        return len(inside(pipeline.scene(ends, stamp_s).obstacles, (1.7, 2.1), (-0.5, 0.5)))

    assert (shown(0.0) >= 8, stored()) == (True, 0)
    assert (shown(0.1) >= 8, stored() >= 8) == (True, True)
    pipeline.forget()
    assert (shown(0.2) >= 8, stored()) == (True, 0)
    for stamp_s in (0.3, 0.4, 0.5, 0.6):
        pipeline.scene(points, stamp_s)
    assert (shown(0.7) >= 8, stored()) == (True, 0), "an edge of long ago"


def test_a_wet_patch_that_loses_all_returns_is_neither_edge_nor_free(look: Look) -> None:
    points = sweep()
    x, y = points["x"] + SENSOR_M[0], points["y"]
    scene = look(points[~((x > 2.0) & (x < 5.0) & (np.abs(y) < 1.0))])
    assert len(scene.obstacles) == 0
    assert free_at(scene, 0.0) < 2.2


@pytest.mark.parametrize("distance_m", [2.0, 10.0])
def test_a_thin_pole_and_a_leg_survive(look: Look, distance_m: float) -> None:
    pole = Solid((distance_m, -0.05, 0.0), (distance_m + 0.1, 0.05, 1.2))
    scene = look(sweep([pole], columns=2344))
    assert len(inside(scene.obstacles, (distance_m - 0.1, distance_m + 0.2), (-0.2, 0.2))) >= 4


def test_a_person_is_seen_with_the_height_above_the_ground(look: Look) -> None:
    scene = look(sweep([Solid((4.0, 0.8, 0.0), (4.3, 1.3, 1.75))]))
    person = inside(scene.obstacles, (3.8, 4.5), (0.7, 1.4))
    assert len(person) > 100
    assert 0.0 < person[:, 2].min() < 0.2
    assert 1.5 < person[:, 2].max() < 1.85


def test_a_wall_ends_free_space(look: Look) -> None:
    scene = look(sweep([Solid((6.0, -10.0, 0.0), (6.3, 10.0, 2.5))]))
    assert free_at(scene, 0.0) == pytest.approx(6.0, abs=0.35)
    assert free_at(scene, 0.0) < 6.1


def test_a_bar_overhead_is_no_obstacle_and_one_at_1_5_m_is(look: Look) -> None:
    high = look(sweep([Solid((5.0, -2.0, 2.5), (5.1, 2.0, 2.6))], columns=2344))
    assert len(high.obstacles) == 0
    assert free_at(high, 0.0) > 10.0
    low = look(sweep([Solid((5.0, -2.0, 1.45), (5.1, 2.0, 1.6))], columns=2344))
    bar = inside(low.obstacles, (4.8, 5.3), (-2.0, 2.0))
    assert len(bar) > 20


def test_a_single_stray_point_is_removed(look: Look) -> None:
    points = sweep()
    points["x"][0], points["y"][0], points["z"][0] = 3.0, 3.0, 0.5
    assert len(look(points).obstacles) == 0


def test_points_that_are_not_finite_are_counted_and_left_out(look: Look) -> None:
    points = sweep()
    points["x"][::10] = np.nan
    points["z"][1::10] = np.inf
    scene = look(points)
    assert scene.broken == len(points[::10]) + len(points[1::10])
    assert len(scene.obstacles) == 0
    assert np.isfinite(scene.free_m).all()


def test_an_unseen_sector_is_not_free(look: Look) -> None:
    points = sweep()
    angle = np.arctan2(points["y"], points["x"])
    scene = look(points[np.abs(angle) > 0.3])
    assert free_at(scene, 0.0) == 0.0
    assert free_at(scene, math.pi / 2) > 20.0
    nothing = look(points[:0])
    assert (len(nothing.obstacles), nothing.free_m.max()) == (0, 0.0)
