"""The zones and lanes of the site for the map page, and changes of the zones by staff."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.config import ConfigError
from robot_stack.core.own_missions import revision_of
from robot_stack.core.route_graph import load_graph
from robot_stack.core.zones import Zone, zone_files, zones_of
from robot_stack.ui import protocol as p
from robot_stack.ui.nodes.mission_files import NOT_SAVED, EditAnswer

ZONE_INVALID, ZONE_CHANGED = "answer.zone_invalid", "answer.zone_changed"


class ZoneFile:
    """map_name: of the site, empty for none. The zones are read again when their file has changed.

    Changes are saved in the robot's own data: the site's folder belongs to the software. Raises ConfigError.
    """

    def __init__(self, map_name: str) -> None:
        self._files = zone_files(map_name) if map_name else None
        graph = load_graph(map_name) if map_name else None
        self._lanes = [] if graph is None else graph.points[graph.ends].reshape(-1, 4).tolist()
        self._begun = self._revision()
        self._seen: tuple[str, list[dict[str, Any]], str] | None = None

    def section(self) -> dict[str, Any]:
        """lanes: x, y of start and end, m, map. problem: of a wrong file. changed: since the node started.

        file: in force, empty without zones.
        """
        revision = self._revision()
        if self._seen is None or self._seen[0] != revision:
            zones, problem = self._read()
            self._seen = revision, zones, problem
        _, zones, problem = self._seen
        return {
            "zones": zones,
            "lanes": self._lanes,
            "problem": problem,
            "revision": revision,
            "changed": revision != self._begun,
            "file": str(self._files.in_force) if self._files is not None and revision else "",
        }

    def edit(self, message: p.SaveZone | p.DeleteZone) -> EditAnswer:
        """Executes a change of staff: the robot's own file is replaced at once. The content that was in force is kept
        beside it, with the suffix ``.before``.
        """
        if message.revision != self._revision():
            return EditAnswer(ZONE_CHANGED)
        if self._files is None:
            return EditAnswer(ZONE_INVALID, "the site has no map")
        path = self._files.in_force
        try:
            before = path.read_bytes() if path.exists() else b""
            content: dict[str, Any] = {"type": "FeatureCollection", "features": []}
            if before:
                content = json.loads(before)
            zones_of(content, path.name)  # a file with errors is left to people
            features = _changed(content["features"], message)
            if len(features) == len(content["features"]):
                return EditAnswer(ZONE_CHANGED)  # no zone of this name is left to be deleted
            content["features"] = features
            zones_of(content, path.name)
        except (ConfigError, ValueError, RecursionError) as error:
            return EditAnswer(ZONE_INVALID, str(error))
        except OSError as error:
            return EditAnswer(NOT_SAVED, f"{error.filename}: {error.strerror}")
        return self._save(self._files.own, before, json.dumps(content, ensure_ascii=False, indent=1) + "\n")

    def _save(self, path: Path, before: bytes, content: str) -> EditAnswer:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if before:
                replace_file(before_path(path), before)
            replace_file(path, content)
        except OSError as error:
            return EditAnswer(NOT_SAVED, f"{error.filename}: {error.strerror}")
        return EditAnswer()

    def _read(self) -> tuple[list[dict[str, Any]], str]:
        if self._files is None:
            return [], ""
        try:
            return [_shown(zone) for zone in self._files.read()], ""
        except ConfigError as error:
            return [], str(error)

    def _revision(self) -> str:
        return "" if self._files is None else revision_of(self._files.in_force)


def before_path(own: Path) -> Path:
    """Where the content before the last change of the robot's own file is kept."""
    return own.with_name(f"{own.name}.before")


def _changed(features: list[Any], message: p.SaveZone | p.DeleteZone) -> list[Any]:
    """Other features stay as they are, also their members that the robot does not use."""
    if isinstance(message, p.DeleteZone):
        name = message.name.strip()  # as names are read
        return [feature for feature in features if feature["properties"]["name"].strip() != name]
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
