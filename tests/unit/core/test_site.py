"""The chosen site: its files, its missions, and its map and world in the parameters of a profile."""

from __future__ import annotations

import pytest

from robot_stack.core.config import SITE_VARIABLE, ConfigError, config_dir, load, read_yaml, site_path
from robot_stack.core.docks import load_docks
from robot_stack.core.mission_library import MissionLibrary, judge, mission_library
from robot_stack.core.safe_places import SafePlaces
from robot_stack.core.site_map import FREE, chosen_map, load_map
from robot_stack.supervisor.profile import SITE_PARAMETERS, load_plan

SITES = sorted(path.name for path in (config_dir() / "sites").glob("*/"))


def test_without_a_site_the_files_of_config_are_in_force(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(SITE_VARIABLE, raising=False)
    assert site_path("docks.yaml") == config_dir() / "docks.yaml"
    assert chosen_map(None) == "yard"
    assert "yard_tour" in mission_library().ids()
    assert "map" not in load_plan("sim").parameters.get("mission_manager", {})


def test_a_site_replaces_the_files_that_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SITE_VARIABLE, "hospital")
    folder = config_dir() / "sites" / "hospital"
    assert site_path("docks.yaml") == folder / "docks.yaml"
    assert site_path("robot.yaml") == config_dir() / "robot.yaml"
    assert chosen_map(None) == "hospital"
    assert mission_library().folders[0] == folder / "missions"
    assert {place.name for place in load(SafePlaces, "safe_places").places} >= {"lobby"}


def test_a_site_names_map_and_world_in_every_node_that_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SITE_VARIABLE, "hospital")
    plan = load_plan("sim", fleet="mqtt://localhost:1883", settings=["black_box.map=other"])
    named = {node: plan.parameters[node][name] for node, name in SITE_PARAMETERS.items()}
    assert named == dict.fromkeys(SITE_PARAMETERS, "hospital") | {"black_box": "other"}


def test_an_unknown_site_is_refused_with_the_known_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SITE_VARIABLE, "moon")
    with pytest.raises(ConfigError, match=r"no site 'moon'.*hospital"):
        load_docks()


@pytest.mark.parametrize("site", SITES)
def test_places_and_missions_of_a_site_lie_on_the_floor_of_its_map(site: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SITE_VARIABLE, site)
    grid, kinds = load_map(site).grid, {name: dock.kind for name, dock in load_docks().docks.items()}
    judged = [judge(read_yaml(path), kinds) for path in MissionLibrary(site_path("missions")).paths()]
    assert len(judged) >= 2
    poses = [(place.name, place.pose) for place in load(SafePlaces, "safe_places").places]
    for mission, problems in judged:
        assert problems == []
        assert mission is not None
        poses += [(f"{mission.id}: {stop.name}", stop.pose) for stop in mission.waypoints]
    for name, pose in poses:
        row = int((pose.y - grid.origin_y_m) / grid.resolution_m)
        column = int((pose.x - grid.origin_x_m) / grid.resolution_m)
        around = grid.occupancy[row - 3 : row + 4, column - 3 : column + 4]
        assert (around == FREE).all(), name
