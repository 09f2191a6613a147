"""A complete map from a short ride: the drift is removed, the visitor is not mapped, walls are in place."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.cli.map_build import recognition
from robot_stack.core.robot import load_robot
from robot_stack.core.site_map import FREE, OCCUPIED
from robot_stack.mapping.build import build_map
from robot_stack.mapping.report import drift, lengths
from tests.unit.mapping import site


@pytest.fixture(scope="module")
def built():
    ride = site.collected(site.recorded())
    return build_map({"ride": ride}, site.params(), load_robot(), site.START, recognition(), lambda *_: None)


def true_places(built) -> np.ndarray:
    poses = [site.true_pose(stamp - site.EPOCH_S) for stamp in built.course.stamps_s]
    return np.array([[pose.x, pose.y] for pose in poses])


def test_the_drift_of_the_wheels_is_gone(built):
    truth = true_places(built)
    wheels = np.linalg.norm(built.course.wheels[:, :2, 3] - truth, axis=1)
    mapped = np.linalg.norm(built.course.poses[:, :2, 3] - truth, axis=1)
    assert wheels.max() > 0.5, "or there is nothing to remove"
    assert mapped.max() < 0.05
    assert np.abs(built.course.poses[:, 2, 3]).max() < 0.05


def test_the_round_is_closed_and_reported(built):
    report = drift(built)
    assert report["loops_closed"] == len(built.course.loops) >= 1
    assert report["wheel_odometry_end_error_m"] > 0.5
    assert report["map_worst_loop_m"] < 0.03 < report["wheel_odometry_worst_loop_m"]
    assert lengths(built.course)[0] == pytest.approx(site.SPEED_MPS * (site.DURATION_S - site.STAND_S), abs=1.0)


def test_cells_lie_on_walls(built):
    assert np.isfinite(built.cells.covariance).all()
    flat = np.linalg.eigvalsh(built.cells.covariance[:, :2, :2])[:, 0] < 0.03**2
    mean = built.cells.mean[flat]
    east = mean[(mean[:, 0] > 5.5) & (np.abs(mean[:, 1]) < 2.5) & (mean[:, 2] > 0.4)]
    north = mean[(mean[:, 1] > 4.5) & (np.abs(mean[:, 0]) < 3.0) & (mean[:, 2] > 0.4)]
    assert len(east) >= 3
    assert len(north) >= 3
    assert np.abs(east[:, 0] - 6.0).max() < 0.04
    assert np.abs(north[:, 1] - 5.0).max() < 0.04


def value_at(grid, x: float, y: float) -> int:
    row, column = int((y - grid.origin_y_m) / grid.resolution_m), int((x - grid.origin_x_m) / grid.resolution_m)
    return int(grid.occupancy[row, column])


def test_grid_marks_walls_and_boxes_occupied_and_ground_free(built):
    grid = built.grid
    for x, y in ((3.0, 0.0), (0.0, 3.0), (-3.0, 0.1), (0.1, -3.0)):
        assert value_at(grid, x, y) == FREE
    for x, y in ((-4.1, 3.7), (4.7, -3.1), (6.05, 0.05), (0.45, 0.1)):
        assert value_at(grid, x, y) == OCCUPIED


def test_temporary_visitor_is_removed_from_map(built):
    (x0, y0, _), (x1, y1, _) = site.VISITOR
    assert built.moved_share > 0.0
    m = built.cells.mean
    there = (m[:, 0] > x0 - 0.1) & (m[:, 0] < x1 + 0.1) & (m[:, 1] > y0 - 0.1) & (m[:, 1] < y1 + 0.1)
    assert not (there & (m[:, 2] > 0.4)).any()
    assert value_at(built.grid, 0.5 * (x0 + x1), 0.5 * (y0 + y1)) == FREE
