"""Lanes of the route graph as staff see and draw them: what a lane is, new ones from points, and what is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from robot_stack.core.distance_field import clearance_field
from robot_stack.core.robot import Footprint
from robot_stack.core.route_graph import RouteGraph
from robot_stack.core.site_map import OCCUPIED, Grid
from robot_stack.core.zones import Zone, ZoneType

Array = npt.NDArray[np.float64]
Point = tuple[float, float]
# A point this near to a node is the node.
SNAP_M = 0.05
SHORT_M = 0.3
# The robot leaves a lane's line a little where a wall is nearer on one side.
_ASIDE_M = 0.3
_PROBLEMS_MAX = 20


@dataclass(frozen=True, slots=True)
class Lane:
    """edges: indices in the graph, one, or two opposite ones with the same limit. both: driven in both directions."""

    edges: tuple[int, ...]

    @property
    def both(self) -> bool:
        return len(self.edges) == 2


class LaneFault(StrEnum):
    """Suffixes of the texts ``lane_fault.``."""

    OBSTACLE = "obstacle"
    KEEPOUT = "keepout"
    NARROW = "narrow"
    OFF_MAP = "off_map"
    SHORT = "short"
    UNCONNECTED = "unconnected"


@dataclass(frozen=True, slots=True)
class LaneProblem:
    """values: of the key's text. at: m, map."""

    key: LaneFault
    at: Point
    values: dict[str, str] = field(default_factory=dict)


def lanes_of(graph: RouteGraph | None) -> list[Lane]:
    """Every edge belongs to one lane."""
    waiting: dict[tuple[Any, ...], list[int]] = {}
    lanes: list[Lane] = []
    for edge, (start, end) in enumerate([] if graph is None else graph.ends.tolist()):
        assert graph is not None
        rules = graph.speed_mps[edge], graph.speed_share[edge], str(graph.cost_m[edge])
        opposite = waiting.get((end, start, *rules))
        if opposite:
            place = opposite.pop()
            lanes[place] = Lane((*lanes[place].edges, edge))
        else:
            waiting.setdefault((start, end, *rules), []).append(len(lanes))
            lanes.append(Lane((edge,)))
    return lanes


def node_at(graph: RouteGraph | None, point: Point) -> int | None:
    """Index of the node at a point."""
    if graph is None:
        return None
    away_m = np.hypot(*(graph.points - point).T)
    nearest = int(np.argmin(away_m))
    return nearest if away_m[nearest] <= SNAP_M else None


def with_lane(
    features: list[Any], graph: RouteGraph | None, points: Sequence[Point], speed_mps: float | None, *, both: bool
) -> list[Any]:
    """``features`` of ``graph`` with edges from point to point, which begin and end at the nodes that are there.

    A lane between the same two nodes is replaced. Other features stay as they are.
    """
    ids = [feature["properties"]["id"] for feature in features]
    free = max(ids, default=-1) + 1
    nodes: list[tuple[int, Point]] = []
    added: list[Any] = []
    known = [feature for feature in features if feature["geometry"]["type"] == "Point"]
    for point in points:
        index = node_at(graph, point)
        again = next((node for node in nodes if math.dist(node[1], point) <= SNAP_M), None)
        if index is not None:
            found = known[index]
            nodes.append((found["properties"]["id"], tuple(found["geometry"]["coordinates"])))
        elif again is not None:
            nodes.append(again)
        else:
            geometry = {"type": "Point", "coordinates": list(point)}
            added.append({"type": "Feature", "properties": {"id": free, "frame": "map"}, "geometry": geometry})
            nodes.append((free, point))
            free += 1
    for a, b in pairwise(nodes):
        features = [feature for feature in features if _ends(feature) not in ((a[0], b[0]), (b[0], a[0]))]
        for (start, here), (end, there) in ((a, b), (b, a))[: 1 + both]:
            properties: dict[str, Any] = {"id": free, "startid": start, "endid": end}
            if speed_mps is not None:
                properties["metadata"] = {"abs_speed_limit": speed_mps}
            line = {"type": "MultiLineString", "coordinates": [[list(here), list(there)]]}
            added.append({"type": "Feature", "properties": properties, "geometry": line})
            free += 1
    return [*features, *added]


def without_lane(features: list[Any], edge_ids: set[int]) -> list[Any]:
    """Without these edges, and without their nodes that no other edge has."""
    gone = [feature for feature in features if _ends(feature) and feature["properties"]["id"] in edge_ids]
    left = [feature for feature in features if feature not in gone]
    used = {end for feature in left for end in _ends(feature)}
    if not used:
        return []  # a graph of nodes alone is an error
    bare = {end for feature in gone for end in _ends(feature)} - used
    return [feature for feature in left if _ends(feature) or feature["properties"]["id"] not in bare]


def _ends(feature: Any) -> tuple[int, ...]:
    """Ids of the nodes of an edge; empty of a node."""
    if feature["geometry"]["type"] == "Point":
        return ()
    return feature["properties"]["startid"], feature["properties"]["endid"]


class LaneCheck:
    """What makes a lane useless, by the site's map, its zones and the robot with a wheelchair."""

    def __init__(self, grid: Grid, with_chair: Footprint) -> None:
        self._grid, self._half_m = grid, 0.5 * with_chair.width_m
        obstacles = np.pad(grid.occupancy == OCCUPIED, 1, constant_values=True)
        clear_m = clearance_field(obstacles, grid.resolution_m, 2.0 * self._half_m)[1:-1, 1:-1]
        self._free = clear_m > 0.0
        cells = 2 * math.floor(min(_ASIDE_M, self._half_m) / grid.resolution_m) + 1
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (cells, cells))
        # Obstacles extend to the edge of their cell.
        self._room_m = cv2.dilate(clear_m, disc) - 0.5 * grid.resolution_m

    def of_points(self, points: Sequence[Point], graph: RouteGraph | None, zones: Sequence[Zone]) -> list[LaneProblem]:
        """Of a lane that is being drawn."""
        found = []
        if graph is not None and all(node_at(graph, point) is None for point in points):
            found.append(LaneProblem(LaneFault.UNCONNECTED, points[0]))
        for a, b in pairwise(points):
            if math.dist(a, b) < SHORT_M:
                found.append(LaneProblem(LaneFault.SHORT, a))
            else:
                found += self._of_line(np.array(a), np.array(b), zones)
        return found[:_PROBLEMS_MAX]

    def of_graph(self, graph: RouteGraph | None, zones: Sequence[Zone]) -> list[LaneProblem]:
        """Of the site's lanes, and of each part of the graph that has no lane to the largest one."""
        if graph is None:
            return []
        found = [LaneProblem(LaneFault.UNCONNECTED, (x, y)) for x, y in _apart(graph).tolist()]
        for lane in lanes_of(graph):
            a, b = graph.points[graph.ends[lane.edges[0]]]
            found += self._of_line(a, b, zones)
        return found[:_PROBLEMS_MAX]

    def _of_line(self, a: Array, b: Array, zones: Sequence[Zone]) -> Iterator[LaneProblem]:
        grid = self._grid
        count = math.ceil(2.0 * math.dist(a, b) / grid.resolution_m) + 1
        points = np.linspace(a, b, count)
        column, row = np.floor((points - (grid.origin_x_m, grid.origin_y_m)) / grid.resolution_m).astype(np.int64).T
        rows, columns = grid.occupancy.shape
        off = (row < 0) | (row >= rows) | (column < 0) | (column >= columns)
        if off.any():
            yield _problem(LaneFault.OFF_MAP, points[int(np.argmax(off))])
            return
        blocked, room_m = ~self._free[row, column], self._room_m[row, column]
        if blocked.any():
            yield _problem(LaneFault.OBSTACLE, points[int(np.argmax(blocked))])
        elif room_m.min() < self._half_m:
            place = points[int(np.argmin(room_m))]
            free_m, needed_m = 2.0 * float(room_m.min()), 2.0 * self._half_m
            yield _problem(LaneFault.NARROW, place, free=f"{free_m:.2f}", needed=f"{needed_m:.2f}")
        along = (b - a) / math.dist(a, b)
        side = self._half_m * np.array((-along[1], along[0]))
        outline = np.array([a + side, b + side, b - side, a - side])
        for zone in zones:
            if zone.type is ZoneType.KEEPOUT and zone.overlaps(outline):
                inside = zone.contains(points[:, 0], points[:, 1])
                place = points[int(np.argmax(inside)) if inside.any() else count // 2]
                yield _problem(LaneFault.KEEPOUT, place, name=zone.name)


def _apart(graph: RouteGraph) -> Array:
    """(n, 2) a node of each part of the graph but the largest, m, map."""
    count = len(graph.points)
    matrix = csr_array((np.ones(len(graph.ends)), (graph.ends[:, 0], graph.ends[:, 1])), shape=(count, count))
    parts, part = connected_components(matrix, directed=False)
    largest = int(np.argmax(np.bincount(part)))
    return graph.points[[int(np.argmax(part == index)) for index in range(parts) if index != largest]]


def _problem(key: LaneFault, at: Array, **values: str) -> LaneProblem:
    return LaneProblem(key, (float(at[0]), float(at[1])), values)
