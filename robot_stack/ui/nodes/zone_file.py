"""The zones and lanes of the site for the map page."""

from __future__ import annotations

import math
from typing import Any

from robot_stack.core.config import ConfigError
from robot_stack.core.own_missions import revision_of
from robot_stack.core.route_graph import load_graph
from robot_stack.core.site_map import map_folder
from robot_stack.core.zones import ZONES_FILE, Zone, read_zones


class ZoneFile:
    """map_name: of the site, empty for none. The zones are read again when their file has changed.

    Raises ConfigError.
    """

    def __init__(self, map_name: str) -> None:
        self._path = map_folder(map_name) / ZONES_FILE if map_name else None
        graph = load_graph(map_name) if map_name else None
        self._lanes = [] if graph is None else graph.points[graph.ends].reshape(-1, 4).tolist()
        self._begun = self._revision()
        self._seen: tuple[str, list[dict[str, Any]], str] | None = None

    def section(self) -> dict[str, Any]:
        """lanes: x, y of start and end, m, map. problem: of a wrong file. changed: since the node started."""
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
        }

    def _read(self) -> tuple[list[dict[str, Any]], str]:
        if self._path is None or not self._path.exists():
            return [], ""
        try:
            return [_shown(zone) for zone in read_zones(self._path)], ""
        except ConfigError as error:
            return [], str(error)

    def _revision(self) -> str:
        return "" if self._path is None else revision_of(self._path)


def _shown(zone: Zone) -> dict[str, Any]:
    return {
        "name": zone.name,
        "type": zone.type.value,
        "rings": [ring.tolist() for ring in zone.rings],
        "speed": zone.speed_mps if math.isfinite(zone.speed_mps) else None,
        "yaw": None if math.isnan(zone.heading_rad) else zone.heading_rad,
    }
