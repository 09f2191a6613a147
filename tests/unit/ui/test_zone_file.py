"""Zones and lanes of the site on the map page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from robot_stack.core.route_graph import GRAPH_FILE
from robot_stack.core.site_map import map_folder
from robot_stack.core.zones import ZONES_FILE
from robot_stack.ui.nodes.zone_file import ZoneFile

SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]]
LAWN = {
    "type": "Feature",
    "id": 7,
    "properties": {"name": "lawn", "type": "keepout"},
    "geometry": {"type": "Polygon", "coordinates": [SQUARE]},
}


def write(folder: Path, *features: Any) -> None:
    (folder / ZONES_FILE).write_text(json.dumps({"type": "FeatureCollection", "features": features}))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(map_folder("yard"), tmp_path / "yard"))


def test_zones_and_lanes_are_shown(folder: Path) -> None:
    points = [{"type": "Point", "coordinates": [0.0, 0.0]}, {"type": "Point", "coordinates": [2.0, 1.0]}]
    nodes = [{"type": "Feature", "properties": {"id": i}, "geometry": point} for i, point in enumerate(points)]
    edge = {"type": "Feature", "properties": {"id": 2, "startid": 1, "endid": 0}, "geometry": {"type": "LineString"}}
    (folder / GRAPH_FILE).write_text(json.dumps({"type": "FeatureCollection", "features": [*nodes, edge]}))
    write(folder, LAWN)
    section = ZoneFile(str(folder)).section()
    assert section["zones"] == [{"name": "lawn", "type": "keepout", "rings": [SQUARE], "speed": None, "yaw": None}]
    assert section["lanes"] == [[2.0, 1.0, 0.0, 0.0]]
    assert (section["problem"], section["changed"]) == ("", False)
    json.dumps(section, allow_nan=False)


def test_a_file_that_changes_is_read_again(folder: Path) -> None:
    zones = ZoneFile(str(folder))
    assert zones.section()["zones"] == []
    write(folder, LAWN)
    section = zones.section()
    assert [zone["name"] for zone in section["zones"]] == ["lawn"]
    assert section["changed"]
    (folder / ZONES_FILE).write_text("{}")
    section = zones.section()
    assert section["zones"] == []
    assert "zones.geojson" in section["problem"]
    (folder / ZONES_FILE).unlink()
    assert not zones.section()["changed"]


def test_a_site_without_a_map() -> None:
    assert ZoneFile("").section() == {"zones": [], "lanes": [], "problem": "", "revision": "", "changed": False}
