"""The lanes of the site for the map page, and changes of them by staff."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from robot_stack.core.robot import Robot
from robot_stack.core.route_graph import RouteGraph, graph_files, graph_of
from robot_stack.core.site_map import load_map
from robot_stack.core.zones import Zone
from robot_stack.ui import protocol as p
from robot_stack.ui.lanes import LaneCheck, LaneProblem, lanes_of, with_lane, without_lane
from robot_stack.ui.nodes.geojson_file import GeoJsonFile
from robot_stack.ui.nodes.mission_files import EditAnswer

LANE_INVALID, LANE_CHANGED, LANE_REFUSED = "answer.lane_invalid", "answer.lane_changed", "answer.lane_refused"


@dataclass(frozen=True, slots=True)
class LaneAnswer(EditAnswer):
    """faults: of the lane that is being drawn."""

    faults: tuple[LaneProblem, ...] = ()

    def fields(self) -> dict[str, Any]:
        return {"problems": [asdict(fault) for fault in self.faults]}


class LaneFile:
    """map_name: of the site, empty for none. zones: in force. Raises ConfigError."""

    def __init__(self, map_name: str, robot: Robot, zones: Callable[[], tuple[Zone, ...]]) -> None:
        files = graph_files(map_name) if map_name else None
        nothing: RouteGraph | None = None
        self._file = GeoJsonFile(files, graph_of, nothing, invalid=LANE_INVALID, changed=LANE_CHANGED)
        self._zones = zones
        self._check = LaneCheck(load_map(map_name).grid, robot.footprint_with_chair) if map_name else None
        self._seen: tuple[Any, dict[str, Any]] | None = None

    def section(self) -> dict[str, Any]:
        """list: lanes; ends: x, y of start and end, m, map. nodes: x, y. wrong: ``LaneProblem``.

        With ``GeoJsonFile.state``.
        """
        graph, _ = self._file.read()
        zones = self._zones()
        if self._seen is None or self._seen[0][0] is not graph or self._seen[0][1] is not zones:
            wrong = [] if self._check is None else self._check.of_graph(graph, zones)
            self._seen = (graph, zones), _shown(graph) | {"wrong": [asdict(item) for item in wrong]}
        return self._seen[1] | self._file.state()

    def edit(self, message: p.DrawLane | p.DeleteLane) -> EditAnswer:
        """A lane with faults is not saved."""
        graph, _ = self._file.read()
        if isinstance(message, p.DeleteLane):
            gone = _edge_ids(graph, int(message.lane))
            return self._file.edit(message.revision, lambda features: without_lane(features, gone) if gone else None)
        points, speed = message.points, message.speed_limit_mps
        faults = () if self._check is None else tuple(self._check.of_points(points, graph, self._zones()))
        if faults or message.t == "lane_check":
            return LaneAnswer("" if message.t == "lane_check" else LANE_REFUSED, faults=faults)
        return self._file.edit(
            message.revision, lambda features: with_lane(features, graph, points, speed, both=message.both)
        )


def _edge_ids(graph: RouteGraph | None, edge_id: int) -> set[int]:
    """Of the lane with this edge."""
    if graph is None:
        return set()
    lanes: Sequence[set[int]] = [{int(graph.edge_ids[edge]) for edge in lane.edges} for lane in lanes_of(graph)]
    return next((ids for ids in lanes if edge_id in ids), set())


def _shown(graph: RouteGraph | None) -> dict[str, Any]:
    if graph is None:
        return {"list": [], "nodes": []}
    lanes = [
        {
            "id": str(graph.edge_ids[lane.edges[0]]),  # JavaScript has no whole numbers of 64 bits
            "ends": graph.points[graph.ends[lane.edges[0]]].ravel().tolist(),
            "both": lane.both,
            "speed": speed if math.isfinite(speed := float(graph.speed_mps[lane.edges[0]])) else None,
        }
        for lane in lanes_of(graph)
    ]
    return {"list": lanes, "nodes": graph.points.tolist()}
