"""The file of a site's levels and lifts: what it accepts, and the level of a pose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from robot_stack.core.config import ConfigError, config_dir
from robot_stack.core.geometry import Pose2
from robot_stack.core.levels import LEVELS_FILE, load_levels
from robot_stack.core.zones import ZoneType, load_zones


def site(tmp_path: Path, **changes: Any) -> str:
    content = {
        "levels": {
            "ground": {"min_x_m": 0.0, "max_x_m": 20.0, "min_y_m": 0.0, "max_y_m": 10.0},
            "first": {"min_x_m": 0.0, "max_x_m": 20.0, "min_y_m": 100.0, "max_y_m": 110.0},
        },
        "lifts": {
            "a": {
                "radius_m": 0.3,
                "stops": {
                    "ground": {"door": "a ground", "x_m": 10.0, "y_m": 5.0, "yaw_rad": 0.0},
                    "first": {"door": "a first", "x_m": 10.0, "y_m": 105.0, "yaw_rad": 0.0},
                },
            }
        },
    }
    for path, value in changes.items():
        *keys, last = path.split("__")
        part: Any = content
        for key in keys:
            part = part[key]
        part[last] = value
    (tmp_path / "map.yaml").write_text("{}")
    (tmp_path / LEVELS_FILE).write_text(yaml.safe_dump(content))
    return str(tmp_path)


def test_a_pose_has_the_level_of_its_coordinates(tmp_path: Path) -> None:
    levels = load_levels(site(tmp_path))
    assert levels.level_at(Pose2(1.0, 1.0, 0.0)) == "ground"
    assert levels.level_at(Pose2(1.0, 101.0, 0.0)) == "first"
    assert levels.level_at(Pose2(1.0, 50.0, 0.0)) is None
    area = levels.area_at(Pose2(1.0, 101.0, 0.0))
    assert area is not None
    assert not area.has(1.0, 1.0)
    assert levels.doors == {"a ground": "a", "a first": "a"}


def test_a_map_without_the_file_has_one_level(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text("{}")
    levels = load_levels(str(tmp_path))
    assert (levels.levels, levels.lifts, levels.area_at(Pose2(0.0, 0.0, 0.0))) == ({}, {}, None)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"levels__first__min_y_m": 9.0}, "overlap"),
        ({"levels__first__max_y_m": 100.0}, "must be above"),
        ({"lifts__a__stops__first__y_m": 5.0}, "is not on level 'first'"),
        ({"lifts__a__stops__second": {"door": "b", "x_m": 1.0, "y_m": 1.0, "yaw_rad": 0.0}}, "not on level 'second'"),
        ({"lifts__a__stops__first__door": "a ground"}, "belongs to another stop"),
        ({"lifts__a__stops": {"ground": {"door": "a", "x_m": 1.0, "y_m": 1.0, "yaw_rad": 0.0}}}, "stops"),
        ({"lifts__a__radius_m": 0.0}, "radius_m"),
    ],
)
def test_a_wrong_file_is_refused_with_its_reason(tmp_path: Path, changes: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        load_levels(site(tmp_path, **changes))


def test_the_doors_of_the_lifts_of_a_site_are_zones_of_its_map() -> None:
    for path in (config_dir() / "maps").glob(f"*/{LEVELS_FILE}"):
        doors = {zone.name for zone in load_zones(path.parent.name) if zone.type is ZoneType.DOOR}
        assert set(load_levels(path.parent.name).doors) <= doors
