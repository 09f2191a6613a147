"""The zones of the site for the map page, and changes of them by staff."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from robot_stack.core.zones import Zone, zone_files, zones_of
from robot_stack.ui import protocol as p
from robot_stack.ui.nodes.geojson_file import GeoJsonFile
from robot_stack.ui.nodes.mission_files import EditAnswer

ZONE_INVALID, ZONE_CHANGED = "answer.zone_invalid", "answer.zone_changed"


class ZoneFile:
    """map_name: of the site, empty for none. Raises ConfigError."""

    def __init__(self, map_name: str) -> None:
        files = zone_files(map_name) if map_name else None
        nothing: tuple[Zone, ...] = ()
        self._file = GeoJsonFile(files, zones_of, nothing, invalid=ZONE_INVALID, changed=ZONE_CHANGED)

    def zones(self) -> tuple[Zone, ...]:
        """In force; none of a wrong file."""
        return self._file.read()[0]

    def section(self) -> dict[str, Any]:
        """The zones, and ``GeoJsonFile.state``."""
        return {"zones": [_shown(zone) for zone in self.zones()]} | self._file.state()

    def edit(self, message: p.SaveZone | p.DeleteZone) -> EditAnswer:
        return self._file.edit(message.revision, partial(_changed, message))


def _changed(message: p.SaveZone | p.DeleteZone, features: list[Any]) -> list[Any] | None:
    """Other features stay as they are, also their members that the robot does not use."""
    if isinstance(message, p.DeleteZone):
        name = message.name.strip()  # as names are read
        left = [feature for feature in features if feature["properties"]["name"].strip() != name]
        return left if len(left) < len(features) else None
    properties: dict[str, Any] = {"name": message.name, "type": message.type}
    if message.speed_limit_mps is not None:
        properties["speed_limit_mps"] = message.speed_limit_mps
    if message.heading_deg is not None:
        properties["heading_deg"] = message.heading_deg
    ring = [list(point) for point in (*message.points, message.points[0])]
    polygon = {"type": "Polygon", "coordinates": [ring]}
    return [*features, {"type": "Feature", "properties": properties, "geometry": polygon}]


def _shown(zone: Zone) -> dict[str, Any]:
    return {
        "name": zone.name,
        "type": zone.type.value,
        "rings": [ring.tolist() for ring in zone.rings],
        "speed": zone.speed_mps if math.isfinite(zone.speed_mps) else None,
        "yaw": None if math.isnan(zone.heading_rad) else zone.heading_rad,
    }
