"""The coverage around the robot: the band, simple layouts with known results, and the robot's own layout."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.coverage_picture import colours, outline
from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.core.robot import Footprint, load_robot
from robot_stack.core.robot_shape import Placed, Solid, load_robot_shape
from robot_stack.coverage.coverage import Body, band, look, seen_pct
from robot_stack.coverage.params import load_coverage_params, load_layouts
from robot_stack.coverage.report import bodies, sensors_of
from robot_stack.perception.params import PerceptionParams
from tests.benchmarks import coverage as bench

PARAMS = load_coverage_params()
FOOTPRINT = Footprint(front_m=0.5, rear_m=-0.5, width_m=0.7)
BARE = Body([], FOOTPRINT)


def ring(**changed: object) -> RangeSensor:
    """Returns a planar scanner with a full field of view, 0.2 m above the ground."""
    values = {
        "device": "ring",
        "xyz_m": (0.0, 0.0, 0.2),
        "rpy_deg": (0.0, 0.0, 0.0),
        "rings": 1,
        "columns": 1440,
        "lowest_deg": 0.0,
        "highest_deg": 0.0,
        "first_azimuth_deg": 180.0,
        "span_deg": 360.0,
        "period_s": 0.1,
        "min_m": 0.05,
        "max_m": 20.0,
        "noise_m": 0.01,
        "range_bias_m": 0.0,
        "elevation_bias_deg": 0.0,
    }
    return RangeSensor.model_validate({**values, **changed})


def test_band_area_matches_formula() -> None:
    """Sides, ends and four quarters of a circle, without the strip where an object would touch the robot."""
    inner, outer = 0.5 * PARAMS.thing_width_m, PARAMS.band_m
    area = 2.0 * (1.0 + 0.7) * (outer - inner) + math.pi * (outer**2 - inner**2)
    grid = band(FOOTPRINT, PARAMS)
    assert len(grid.cells) * grid.cell_m**2 == pytest.approx(area, rel=0.01)
    rows, columns = np.nonzero(grid.index >= 0)
    first = grid.cells[grid.index[rows[0], columns[0]]]
    assert first == pytest.approx(
        (grid.origin_m[0] + (columns[0] + 0.5) * grid.cell_m, grid.origin_m[1] + (rows[0] + 0.5) * grid.cell_m)
    )


def test_an_unhidden_ring_sees_every_thing_and_nothing_above_itself() -> None:
    seen = look({"ring": ring()}, BARE, PARAMS)
    assert seen_pct(seen.things[0.3], PARAMS.points_min) == 100.0
    assert seen_pct(seen.maps[0.6], 1) == 0.0


def test_half_a_ring_sees_half_of_the_band_and_two_halves_all_of_it() -> None:
    ahead = ring(first_azimuth_deg=90.0, span_deg=180.0, columns=720)
    behind = ring(first_azimuth_deg=90.0, span_deg=180.0, columns=720, rpy_deg=(0.0, 0.0, 180.0))
    both = look({"ahead": ahead, "behind": behind}, BARE, PARAMS)
    seen, turned = both.by_sensor["ahead"][0.6], both.by_sensor["behind"][0.6]
    assert seen_pct(seen, PARAMS.points_min) == pytest.approx(50.0, abs=2.5)
    x = both.grid.cells[:, 0]
    assert not seen[x < -0.2].any()
    assert not turned[x > 0.2].any()
    assert seen_pct(both.things[0.6], PARAMS.points_min) == 100.0
    assert (seen + turned == both.things[0.6]).all()


def test_an_upside_down_sensor_looks_down() -> None:
    """A ring 45 deg above its own horizon, mounted upside down at 1.5 m, meets the ground 1.5 m away."""
    hung = ring(xyz_m=(0.0, 0.0, 1.5), rpy_deg=(180.0, 0.0, 0.0), lowest_deg=45.0, highest_deg=46.0, rings=2)
    assert hung.beams()[:, 2].max() < -0.7
    seen = look({"ring": hung}, BARE, PARAMS)
    away = np.hypot(*seen.grid.cells.T)
    assert (seen.things[0.6][(away > 0.9) & (away < 1.3)] >= PARAMS.points_min).all()
    assert not seen.things[0.6][away > 1.7].any()


def test_robot_body_hides_cells_behind_it() -> None:
    wall = Solid(kind="box", size_m=(0.05, 4.0, 1.0), at_m=(0.4, 0.0, 0.5), turn_deg=(0.0, 0.0, 0.0), colour="#000000")
    seen = look({"ring": ring()}, Body([Placed("wall", wall, wall.pose())], FOOTPRINT), PARAMS)
    ahead = (seen.grid.cells[:, 0] > 0.6) & (np.abs(seen.grid.cells[:, 1]) < 0.5)
    assert not seen.things[0.6][ahead].any()
    assert (seen.things[0.6][seen.grid.cells[:, 0] < -0.6] >= PARAMS.points_min).all()


def test_coverage_thresholds_equal_perception_parameters() -> None:
    perception = load(PerceptionParams, "perception_pipeline")
    assert perception.obstacles.neighbours_min == PARAMS.points_min
    assert perception.ground.obstacle_min_m == PARAMS.lowest_point_m


def test_coverage_figures_meet_their_aims() -> None:
    result = bench.run()
    for name, aim in bench.AIMS.items():
        assert aim.met(result.figures[name]), f"{name}: {result.figures[name]:.2f}"
    assert set(result.conditions["sensors"]) == set(load_robot().range_sensors)  # type: ignore[call-overload]


def test_the_lidar_alone_does_not_see_past_the_passenger() -> None:
    """Board and passenger hide 25 deg to either side of straight ahead."""
    robot = load_robot()
    standing = bodies(robot, load_robot_shape(), load_docks())
    seen = look({"lidar": robot.range_sensors["lidar"]}, standing["chair"], PARAMS)
    assert seen_pct(seen.things[0.6], PARAMS.points_min) < 90.0
    x, y = seen.grid.cells.T
    ahead = (x > 2.2) & (np.abs(np.degrees(np.arctan2(y, x - robot.lidar_xyz_m[0]))) < 12.0)
    assert ahead.any()
    assert not (seen.things[0.6][ahead] >= PARAMS.points_min).any()


def test_every_compared_layout_has_sensors() -> None:
    robot = load_robot()
    for layout in load_layouts().layouts.values():
        assert sensors_of(layout, robot)


def test_the_verb_writes_figures_and_maps(tmp_path: Path) -> None:
    assert CliRunner().invoke(app, ["coverage", "--layout", "nowhere"]).exit_code != 0
    file, folder = tmp_path / "a" / "coverage.json", tmp_path / "maps"
    done = CliRunner().invoke(app, ["coverage", "--json", str(file), "--pictures", str(folder)])
    assert done.exit_code == 0, done.output
    figures = json.loads(file.read_text(encoding="utf-8"))
    assert set(bench.AIMS) <= set(figures)
    drawn = {item.name for item in folder.iterdir()}
    assert {f"map_{height}_{name}.png" for height in ("01", "03", "06", "10") for name in ("empty", "chair")} <= drawn


def test_picture_colours_differ_by_number_of_points() -> None:
    grid = band(FOOTPRINT, PARAMS)
    points = np.zeros(len(grid.cells), np.int64)
    points[0], points[1] = PARAMS.points_min, 1
    shade = colours(grid, points, PARAMS.points_min)
    places = [tuple(np.argwhere(grid.index == number)[0]) for number in (0, 1, 2)]
    assert len({tuple(shade[place]) for place in places}) == 3
    box = Solid(kind="box", size_m=(2.0, 1.0, 1.0), at_m=(0.0, 0.0, 0.0), turn_deg=(0.0, 0.0, 0.0), colour="#000000")
    assert np.ptp(outline(Placed("x", box, box.pose())), axis=0) == pytest.approx((2.0, 1.0))
