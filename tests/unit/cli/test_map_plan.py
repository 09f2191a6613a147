"""robot-stack map plan: pictures and map_server's files, their scale, and input that is refused."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import yaml
from PIL import Image
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.errors import CommandError
from robot_stack.cli.map_build import problems_of
from robot_stack.cli.map_plan import PlanOptions, build_from_plan, read_plan
from robot_stack.core.config import ConfigError, config_dir
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.levels import LEVELS_FILE
from robot_stack.core.site_map import FREE, load_map
from sim.mapping.floor_plan import main as draw
from sim.mapping.floor_plan import walls_of
from sim.worldfile import load_world

GRID = {
    "image": "plan.pgm",
    "resolution": 0.05,
    "origin": [-1.0, 2.0, 0.5],
    "occupied_thresh": 0.65,
    "free_thresh": 0.25,
}


def write_grid(folder, **changes):
    """A grid of three columns: white, grey, black."""
    Image.fromarray(np.array([[254, 205, 0]] * 3, np.uint8)).save(folder / "plan.pgm")
    path = folder / "plan.yaml"
    path.write_text(yaml.safe_dump({**GRID, **changes}), encoding="utf-8")
    return path


def test_the_hospital_map_is_what_the_plan_of_its_world_makes(tmp_path):
    assert draw(["hospital", str(tmp_path / "plan.png")]) == 0
    plan = config_dir() / "maps" / "hospital" / "plan.png"
    assert (np.asarray(Image.open(plan)) == np.asarray(Image.open(tmp_path / "plan.png"))).all()
    floor = load_world("hospital").floor
    (tmp_path / "again").mkdir()
    shutil.copy(plan.parent / LEVELS_FILE, tmp_path / "again")
    words = ["map", "plan", str(plan), "--name", "again", "--resolution", "0.05", "--output", str(tmp_path)]
    result = CliRunner().invoke(app, [*words, "--origin", f"{floor.min_x_m}", f"{floor.min_y_m}", "0"])
    assert result.exit_code == 0, result.output
    assert "no furniture" in result.output
    made, committed = load_map(str(tmp_path / "again")), load_map("hospital")
    assert problems_of(made) == []
    assert (made.grid.occupancy[-100:] == FREE).any(), "the floor of the other level"
    assert np.allclose(made.cells.mean, committed.cells.mean)
    assert (made.grid.occupancy == committed.grid.occupancy).all()
    assert (tmp_path / "again" / "map.png").is_file()
    shown = CliRunner().invoke(app, ["map", "show", str(tmp_path / "again")])
    assert "floor plan: plan.png at 0.05 m a pixel, walls of 2.5 m" in shown.output


def test_the_floor_of_each_level_is_reached_from_the_stops_of_lifts(tmp_path):
    walls = np.full((200, 100), 0, np.uint8)
    walls[10:90, 10:90] = walls[110:190, 10:90] = 255  # two rooms of 4 m
    Image.fromarray(walls[::-1]).save(tmp_path / "rooms.png")
    area = {"min_x_m": 0.0, "max_x_m": 5.0}
    stops = {name: {"door": name, "x_m": 2.5, "y_m": y, "yaw_rad": 0.0} for name, y in (("a", 2.5), ("b", 7.5))}
    areas = {"a": {**area, "min_y_m": 0.0, "max_y_m": 5.0}, "b": {**area, "min_y_m": 5.0, "max_y_m": 10.0}}
    for levels, free_m2 in ({}, 16.0), ({"levels": areas, "lifts": {"x": {"radius_m": 0.3, "stops": stops}}}, 32.0):
        (tmp_path / "site").mkdir(exist_ok=True)
        (tmp_path / "site" / LEVELS_FILE).write_text(yaml.safe_dump(levels))
        options = PlanOptions(0.05, start=(2.5, 2.5))
        build_from_plan(tmp_path / "rooms.png", "site", tmp_path, options, plot=False)
        grid = load_map(str(tmp_path / "site")).grid
        assert (grid.occupancy == FREE).sum() * grid.resolution_m**2 == pytest.approx(free_m2, abs=1.5)


def test_dark_pixels_are_walls_and_transparent_ones_floor(tmp_path):
    walls = walls_of(load_world("hospital"))
    grey = np.where(walls, 40, 200).astype(np.uint8)[::-1]
    Image.fromarray(
        np.stack([grey * 0, grey * 0, grey * 0, np.where(grey < 100, 255, 0)], axis=2).astype(np.uint8)
    ).save(tmp_path / "clear.png")
    Image.fromarray(grey).save(tmp_path / "grey.png")
    for name in ("clear.png", "grey.png"):
        plan = read_plan(tmp_path / name, 0.05, None)
        assert (plan.walls == walls).all()
        assert (plan.floor == ~walls).all()
        assert plan.origin == IDENTITY


def test_a_file_of_map_server_has_its_thresholds_scale_and_origin(tmp_path):
    plan = read_plan(write_grid(tmp_path), None, None)
    assert plan.walls[0].tolist() == [False, False, True]
    assert plan.floor[0].tolist() == [True, True, False]
    assert (plan.resolution_m, plan.origin) == (0.05, Pose2(-1.0, 2.0, 0.5))
    between = read_plan(write_grid(tmp_path, free_thresh=0.19), 0.1, IDENTITY)
    assert between.floor[0].tolist() == [True, False, False]
    assert (between.resolution_m, between.origin) == (0.1, IDENTITY)
    negated = read_plan(write_grid(tmp_path, negate=1), None, None)
    assert negated.walls[0].tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("resolution", "words"),
    [(None, "scale is missing: give --resolution"), (5.0, "0.005 to 0.25 m"), (float("nan"), "0.005 to 0.25 m")],
)
def test_a_picture_needs_a_scale(tmp_path, resolution, words):
    Image.new("L", (50, 50), 255).save(tmp_path / "plan.png")
    with pytest.raises(CommandError, match=words):
        read_plan(tmp_path / "plan.png", resolution, None)


def test_input_that_is_no_plan_is_refused(tmp_path):
    with pytest.raises(CommandError, match="No such file"):
        read_plan(tmp_path / "nowhere.png", 0.05, None)
    (tmp_path / "text.png").write_text("no picture", encoding="utf-8")
    with pytest.raises(CommandError, match="no picture that can be read"):
        read_plan(tmp_path / "text.png", 0.05, None)
    Image.new("L", (2500, 10), 255).save(tmp_path / "long.png")
    with pytest.raises(CommandError, match="too large"):
        read_plan(tmp_path / "long.png", 0.25, None)
    Image.fromarray(np.zeros((9, 9), np.uint16)).save(tmp_path / "deep.png")
    with pytest.raises(CommandError, match="8 bits"):
        read_plan(tmp_path / "deep.png", 0.05, None)
    with pytest.raises(ConfigError, match="occupied_thresh"):
        read_plan(write_grid(tmp_path, occupied_thresh=7), None, None)
    with pytest.raises(ConfigError, match="mode"):
        read_plan(write_grid(tmp_path, mode="raw"), None, None)


@pytest.mark.parametrize(
    ("shade", "options", "words"),
    [
        (255, PlanOptions(0.05), "no walls"),
        (0, PlanOptions(0.05), "no floor"),
        (255, PlanOptions(0.05, wall_height_m=0.5), "wall-height"),
    ],
)
def test_a_refused_plan_writes_no_map(tmp_path, shade, options, words):
    Image.new("L", (50, 50), shade).save(tmp_path / "plan.png")
    with pytest.raises(CommandError, match=words):
        build_from_plan(tmp_path / "plan.png", "site", tmp_path, options)
    assert not (tmp_path / "site").exists()
