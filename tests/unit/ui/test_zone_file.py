"""Zones of the site on the map page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from robot_stack.core.site_map import map_folder
from robot_stack.core.zones import ZONES_FILE, load_zones, zone_files
from robot_stack.ui import protocol as p
from robot_stack.ui.nodes.geojson_file import before_path
from robot_stack.ui.nodes.mission_files import NOT_SAVED
from robot_stack.ui.nodes.zone_file import ZONE_CHANGED, ZONE_INVALID, ZoneFile

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
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return Path(shutil.copytree(map_folder("yard"), tmp_path / "yard"))


def test_zones_are_shown(folder: Path) -> None:
    write(folder, LAWN)
    section = ZoneFile(str(folder)).section()
    assert section["zones"] == [{"name": "lawn", "type": "keepout", "rings": [SQUARE], "speed": None, "yaw": None}]
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
    nothing = {"zones": [], "problem": "", "revision": "", "changed": False, "file": ""}
    assert ZoneFile("").section() == nothing


def state(folder: Path) -> list[tuple[str, int]]:
    return sorted((path.name, path.stat().st_mtime_ns) for path in (folder, *folder.iterdir()))


def adding(zones: ZoneFile, name: str = "ward", **fields: Any) -> p.SaveZone:
    given = {"type": "speed", "speed_limit_mps": 0.4, "revision": zones.section()["revision"], **fields}
    message = {"t": "zone_save", "name": name, "points": [[0, 0], [2, 0], [2, 1.5]], **given}
    parsed = p.parse(json.dumps(message))
    assert isinstance(parsed, p.SaveZone)
    return parsed


def test_staff_add_and_delete_zones_and_the_file_before_is_kept(folder: Path) -> None:
    write(folder, LAWN)
    first, untouched = (folder / ZONES_FILE).read_bytes(), state(folder)
    zones = ZoneFile(str(folder))
    assert zones.section()["file"] == str(folder / ZONES_FILE)
    assert zones.edit(adding(zones)).why == ""
    own = zone_files(str(folder)).own
    assert before_path(own).read_bytes() == first
    added = adding(zones, "lane", type="one_way", speed_limit_mps=None, heading_deg=90)
    assert zones.edit(added).why == ""
    section = zones.section()
    assert [(zone["name"], zone["type"]) for zone in section["zones"]] == [
        ("lawn", "keepout"),
        ("ward", "speed"),
        ("lane", "one_way"),
    ]
    assert section["zones"][1]["rings"] == [[[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 0.0]]]
    assert section["changed"]
    gone = p.DeleteZone(t="zone_delete", name="ward", revision=section["revision"])
    assert zones.edit(gone).why == ""
    assert [zone["name"] for zone in zones.section()["zones"]] == ["lawn", "lane"]
    assert state(folder) == untouched, "the map's folder belongs to the software"
    assert section["file"] == str(own)
    assert [zone.name for zone in load_zones(str(folder))] == ["lawn", "lane"]
    written = json.loads(own.read_text())
    assert written["features"][0] == LAWN, "with the members of an editor"
    own.unlink()
    assert [zone.name for zone in load_zones(str(folder))] == ["lawn"], "those of the site again"


def test_the_first_zone_makes_the_file(folder: Path) -> None:
    zones = ZoneFile(str(folder))
    assert zones.edit(adding(zones)).why == ""
    assert not before_path(zone_files(str(folder)).own).exists()


def test_a_zone_whose_name_has_blanks_in_the_file_is_deleted(folder: Path) -> None:
    write(folder, LAWN, {**LAWN, "properties": {"name": " ward ", "type": "keepout"}})
    zones = ZoneFile(str(folder))
    revision = zones.section()["revision"]
    assert zones.edit(p.DeleteZone(t="zone_delete", name="gone", revision=revision)).why == ZONE_CHANGED
    assert zones.edit(p.DeleteZone(t="zone_delete", name="ward", revision=revision)).why == ""
    assert [zone["name"] for zone in zones.section()["zones"]] == ["lawn"]


def test_a_change_that_cannot_be_saved_leaves_the_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(folder, LAWN)
    zones = ZoneFile(str(folder))
    old = adding(zones)
    write(folder, LAWN, {**LAWN, "properties": {"name": "other", "type": "keepout"}})
    content = (folder / ZONES_FILE).read_bytes()
    assert zones.edit(old).why == ZONE_CHANGED
    assert zones.edit(adding(zones, "lawn")).why == ZONE_INVALID
    assert zones.edit(adding(zones, speed_limit_mps=None)).why == ZONE_INVALID

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device", "zones.geojson")

    monkeypatch.setattr("robot_stack.ui.nodes.geojson_file.replace_file", full)
    assert zones.edit(adding(zones)).why == NOT_SAVED
    assert (folder / ZONES_FILE).read_bytes() == content
    (folder / ZONES_FILE).write_text("{")
    assert zones.edit(adding(zones)).why == ZONE_INVALID
    assert (folder / ZONES_FILE).read_text() == "{"
