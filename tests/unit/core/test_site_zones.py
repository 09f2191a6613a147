"""Zones of a site: reading them, and which points they contain."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_stack.core.config import ConfigError
from robot_stack.core.site_map import FREE, Grid, map_folder
from robot_stack.core.zones import ZONES_FILE, Zone, ZoneType, load_zones, read_zones, zone_files

_SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]]
_HOLE = [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0], [1.0, 1.0]]


def feature(properties: Any, *rings: Any, kind: str = "Polygon") -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": rings or (_SQUARE,)}
    return {"type": "Feature", "properties": properties, "geometry": geometry, "id": 7}


def written(folder: Path, *features: Any, **members: Any) -> Path:
    path = folder / ZONES_FILE
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features, **members}))
    return path


def test_zones_are_read(tmp_path: Path) -> None:
    lawn = feature({"name": "lawn", "type": "keepout"}, _SQUARE, _HOLE)
    ward = feature({"name": "ward", "type": "speed", "speed_limit_mps": 0.4})
    keepout, slow = read_zones(written(tmp_path, lawn, ward, name="exported by an editor"))
    assert (keepout.name, keepout.type, keepout.speed_mps) == ("lawn", ZoneType.KEEPOUT, np.inf)
    assert (slow.name, slow.type, slow.speed_mps) == ("ward", ZoneType.SPEED, 0.4)
    x, y = np.array([0.5, 2.0, 5.0, -0.1, 3.5]), np.array([0.5, 2.0, 2.0, 2.0, 2.0])
    assert keepout.contains(x, y).tolist() == [True, False, False, False, True]
    assert slow.contains(x, y).tolist() == [True, True, False, False, True]


def test_a_one_way_zone_has_a_heading(tmp_path: Path) -> None:
    lane = feature({"name": "lane", "type": "one_way", "heading_deg": 90.0})
    with pytest.raises(ConfigError, match="unique name"):
        read_zones(written(tmp_path, lane, lane))
    (zone,) = read_zones(written(tmp_path, lane))
    assert (zone.type, zone.heading_rad, zone.speed_mps) == (ZoneType.ONE_WAY, pytest.approx(np.pi / 2.0), np.inf)
    with pytest.raises(ConfigError, match="'lane' properties: Value error, heading_deg belongs"):
        read_zones(written(tmp_path, feature({"name": "lane", "type": "one_way"})))
    with pytest.raises(ConfigError, match="heading_deg belongs"):
        read_zones(written(tmp_path, feature({"name": "lane", "type": "keepout", "heading_deg": 0.0})))


def test_the_cells_of_a_zone() -> None:
    triangle = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 0.0]])
    zone = Zone("corner", ZoneType.KEEPOUT, (triangle,), np.inf)
    cells = zone.cells(Grid(0.5, -0.5, 0.0, np.full((4, 6), FREE, np.int8)))
    assert cells.astype(int).tolist() == [
        [0, 1, 1, 1, 0, 0],
        [0, 1, 1, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 0],
    ]


def test_a_zone_narrower_than_a_cell_touches_the_cells_that_its_outline_passes() -> None:
    chain = np.array([[-2.0, 0.6], [1.4, 0.6], [1.4, 0.7], [-2.0, 0.7], [-2.0, 0.6]])
    zone = Zone("chain", ZoneType.KEEPOUT, (chain,), np.inf)
    grid = Grid(0.5, -0.5, 0.0, np.full((3, 5), FREE, np.int8))
    assert not zone.cells(grid).any()
    assert zone.touched(grid).astype(int).tolist() == [[0, 0, 0, 0, 0], [1, 1, 1, 1, 0], [0, 0, 0, 0, 0]]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (feature({"name": "lawn", "type": "forbidden"}), "features.0 'lawn' properties.type"),
        (feature({"name": "lawn", "type": "speed"}), "speed_limit_mps belongs to zones of type speed"),
        (feature({"name": "lawn", "type": "keepout", "speed_limit_mps": 0.5}), "speed_limit_mps belongs"),
        (feature({"name": "lawn", "type": "speed", "speed_limit_mps": 0.01}), "properties.speed_limit_mps"),
        (feature({"name": "lawn", "type": "keepout"}, _SQUARE[:3]), "coordinates"),
        (feature({"name": "lawn", "type": "keepout"}, _SQUARE[:4]), "each ring must end with its first position"),
        (feature({"name": "lawn", "type": "keepout"}, [[135.5, 34.7, 1.0]] * 4), "coordinates"),
        (feature({"name": "lawn", "type": "keepout"}, [[math.nan, 0.0]] * 4), "coordinates"),
        (feature({"name": "lawn", "type": "keepout"}, [[1e6, 0.0]] * 4), "coordinates"),
        (feature({"name": "lawn", "type": "keepout"}, kind="LineString"), "geometry.type"),
        (feature(None), "features.0 properties"),
        ("lawn", "features.0"),
    ],
)
def test_a_wrong_zone_is_named(tmp_path: Path, wrong: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read_zones(written(tmp_path, wrong))


@pytest.mark.parametrize(
    "text",
    ["{", "[]", "1" * 5000, "[" * 200_000, '{"type": "Topology", "features": []}', '{"type": "FeatureCollection"}'],
)
def test_a_file_that_is_no_geojson(tmp_path: Path, text: str) -> None:
    path = tmp_path / ZONES_FILE
    path.write_text(text)
    with pytest.raises(ConfigError, match=ZONES_FILE):
        read_zones(path)


def test_zones_edited_on_the_robot_take_precedence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    folder = shutil.copytree(map_folder("yard"), tmp_path / "yard")
    files = zone_files(str(folder))
    assert files.in_force == written(folder, feature({"name": "lawn", "type": "keepout"}))
    files.own.parent.mkdir(parents=True)
    written(folder, feature({"name": "ward", "type": "keepout"})).rename(files.own)
    assert files.in_force == files.own
    assert [zone.name for zone in load_zones(str(folder))] == ["ward"]
    assert load_zones("yard") == (), "another map of this name"
    files.own.write_text("{")
    with pytest.raises(ConfigError, match=str(files.own)):
        load_zones(str(folder))


def test_own_zones_that_cannot_be_reached_are_not_taken_for_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = tmp_path / "data"
    loop.symlink_to(loop)
    monkeypatch.setenv("XDG_DATA_HOME", str(loop))
    with pytest.raises(ConfigError, match="cannot be read"):
        load_zones("yard")
