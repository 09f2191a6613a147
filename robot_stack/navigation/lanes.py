"""Routes over the site's route graph: which lanes lead from a start to a goal, and the guide that the planner follows.

Start and goal are connected to the nearest lanes within ``access_m``, at their nearest point; metres beside the lanes
cost ``off_lane_cost`` times as much. A lane's cost is its length over its share of the cruise speed, or the fixed cost
of its file. The planner keeps to ``band_m`` beside the lanes, and to the surroundings of start and goal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from robot_stack.core.config import ConfigError
from robot_stack.core.distance_field import clearance_field
from robot_stack.core.route_graph import GRAPH_FILE, RouteGraph
from robot_stack.core.zones import SLOWEST_MPS, Zone, ZoneType
from robot_stack.navigation.params import GraphParams
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import FAR_M, PlanningGrid

Array = npt.NDArray[np.float64]
# Cost per metre more, besides 1: at the edge of the band, and around start and goal.
_AT_BAND_EDGE, _AROUND_ENDS = 2.0, 1.0
# The surroundings of start and goal reach farther than the lane by this share and this distance.
_WIDER, _WIDER_M = 1.5, 2.0


@dataclass(frozen=True, slots=True)
class LaneRoute:
    """lanes: (m,) indices of the graph's edges, in order. points: (m + 1, 2) m, map, entry, nodes and exit."""

    lanes: npt.NDArray[np.int64]
    points: Array

    def pieces(self) -> list[tuple[int, Array]]:
        """(edge, (2, 2) start and end of the part that is driven) of each lane."""
        return [(int(lane), self.points[i : i + 2]) for i, lane in enumerate(self.lanes)]


@dataclass(frozen=True, slots=True)
class _Access:
    """How a point is connected to each edge, all (e,): share along it of its nearest point, distance, m, connected."""

    share: Array
    away_m: Array
    near: npt.NDArray[np.bool_]


class Lanes:
    """The lanes of a graph. cruise_mps: the speed that shares refer to.

    Raises ConfigError if a share is less than the slowest useful speed.
    """

    def __init__(self, graph: RouteGraph, params: GraphParams, cruise_mps: float) -> None:
        self._params = params
        self.graph = graph
        self.starts, self.ends = graph.points[graph.ends[:, 0]], graph.points[graph.ends[:, 1]]
        self.length_m = np.hypot(*(self.ends - self.starts).T)
        self.speed_mps = np.minimum(graph.speed_mps, graph.speed_share * cruise_mps)
        slow = np.flatnonzero(self.speed_mps < SLOWEST_MPS)
        if len(slow):
            edge, mps = graph.edge_ids[slow[0]], self.speed_mps[slow[0]]
            text = f"{mps:.2g} m/s of {cruise_mps:g} m/s, must be at least {SLOWEST_MPS} m/s"
            raise ConfigError(f"{GRAPH_FILE}: edge {edge}: speed_limit is {text}")
        travel = self.length_m * np.maximum(cruise_mps / self.speed_mps, 1.0)
        self.cost_m = np.where(np.isnan(graph.cost_m), travel, graph.cost_m)
        self._cruise_mps = cruise_mps

    @property
    def tries(self) -> int:
        """Routes to try at most."""
        return self._params.tries

    def speed_zones(self) -> tuple[Zone, ...]:
        """A speed zone around each lane with a limit, ``band_m`` to either side."""
        zones = []
        for lane in np.flatnonzero(self.speed_mps < self._cruise_mps):
            along = (self.ends[lane] - self.starts[lane]) / self.length_m[lane]
            side = self._params.band_m * np.array((-along[1], along[0]))
            a, b = self.starts[lane], self.ends[lane]
            ring = np.array([a + side, b + side, b - side, a - side, a + side])
            name = f"edge {self.graph.edge_ids[lane]}"
            zones.append(Zone(name, ZoneType.SPEED, (ring,), float(self.speed_mps[lane])))
        return tuple(zones)

    def route(self, start: Array, goal: Array, closed: frozenset[int]) -> LaneRoute | None:
        """The cheapest route from ``start`` to ``goal``, (2,) m, map, without the closed edges; None without one.

        None too where start and goal are nearer to each other than ``from_m``, or than to their lanes.
        """
        p = self._params
        if math.dist(start, goal) < p.from_m:
            return None
        edges = np.array([lane for lane in range(len(self.ends)) if lane not in closed], np.int64)
        # The nearest lanes, or, if they are not connected, any.
        for farther_m in (p.band_m, math.inf):
            ends = [self._access(point, edges, farther_m) for point in (start, goal)]
            route = self._cheapest(edges, *ends)
            if route is not None:
                off_m = ends[0].away_m[route.lanes[0]] + ends[1].away_m[route.lanes[-1]]
                return route if off_m < math.dist(start, goal) else None
        return None

    def _cheapest(self, edges: npt.NDArray[np.int64], start: _Access, goal: _Access) -> LaneRoute | None:
        """The cheapest route over ``edges``; None without one."""
        count = len(self.graph.points)
        source, sink = count, count + 1
        best: dict[tuple[int, int], tuple[float, int]] = {}

        def offer(a: int, b: int, cost: float, lane: int) -> None:
            # A cost of 0 would be no entry of the sparse matrix.
            if (a, b) not in best or cost < best[a, b][0]:
                best[a, b] = max(cost, 1e-9), lane

        off_lane = self._params.off_lane_cost
        for lane in map(int, edges):
            a, b = (int(node) for node in self.graph.ends[lane])
            cost = float(self.cost_m[lane])
            offer(a, b, cost, lane)
            enter, leave = float(start.share[lane]), float(goal.share[lane])
            into, out = off_lane * float(start.away_m[lane]), off_lane * float(goal.away_m[lane])
            if start.near[lane]:
                offer(source, b, into + (1.0 - enter) * cost, lane)
            if goal.near[lane]:
                offer(a, sink, leave * cost + out, lane)
            if start.near[lane] and goal.near[lane] and leave > enter:
                offer(source, sink, into + (leave - enter) * cost + out, lane)
        if not best:
            return None
        rows, columns = np.array(list(best)).T
        costs = np.array([cost for cost, _ in best.values()])
        matrix = csr_array((costs, (rows, columns)), shape=(count + 2, count + 2))
        total, before = dijkstra(matrix, indices=source, return_predecessors=True)
        if not math.isfinite(total[sink]):
            return None
        nodes = [sink]
        while nodes[-1] != source:
            nodes.append(int(before[nodes[-1]]))
        nodes.reverse()
        lanes = np.array([best[a, b][1] for a, b in pairwise(nodes)], np.int64)
        first, last = int(lanes[0]), int(lanes[-1])
        points = [self._at(first, float(start.share[first]))]
        points += [self.graph.points[node] for node in nodes[1:-1]]
        points.append(self._at(last, float(goal.share[last])))
        return LaneRoute(lanes, np.array(points))

    def guide(self, grid: PlanningGrid, route: LaneRoute, start: Array, goal: Array) -> npt.NDArray[np.float32]:
        """(rows, columns) cost per metre besides 1 for a planner that keeps to a route; negative: not to be entered."""
        away_m = _away_m(grid, [piece for _, piece in route.pieces()])
        band_m = self._params.band_m
        guide = np.where(away_m <= band_m, _AT_BAND_EDGE * np.square(away_m / band_m), -1.0)
        for end, access in ((start, route.points[0]), (goal, route.points[-1])):
            around = _disc(grid, end, _WIDER * math.dist(end, access) + _WIDER_M)
            guide[around & (guide < 0.0)] = _AROUND_ENDS
        return guide.astype(np.float32)

    def piece_guide(self, grid: PlanningGrid, piece: Array) -> npt.NDArray[np.float32]:
        """As ``guide``, of one lane alone, with its ends' surroundings."""
        away_m = _away_m(grid, [piece])
        return np.where(away_m <= self._params.band_m, 0.0, -1.0).astype(np.float32)

    def entered(self, route: LaneRoute, at: tuple[float, float]) -> set[int]:
        """The lane of a route that a robot drives on, or turns into, at a point: the last whose band contains it."""
        near = [lane for lane, piece in route.pieces() if abs(Path(piece).project(*at)[1]) <= self._params.band_m]
        return set(near[-1:])

    def _at(self, lane: int, share: float) -> Array:
        return np.asarray(self.starts[lane] + share * (self.ends[lane] - self.starts[lane]))

    def _access(self, point: Array, edges: npt.NDArray[np.int64], farther_m: float) -> _Access:
        """farther_m: than the nearest of ``edges``, at most."""
        along = self.ends - self.starts
        share = np.clip(np.sum((point - self.starts) * along, axis=1) / np.square(self.length_m), 0.0, 1.0)
        off = self.starts + share[:, None] * along - point
        away_m = np.hypot(off[:, 0], off[:, 1])
        most_m = min(self._params.access_m, float(away_m[edges].min(initial=math.inf)) + farther_m)
        return _Access(share, away_m, away_m <= most_m)


def _away_m(grid: PlanningGrid, pieces: list[Array]) -> Array:
    """(rows, columns) distance of the cells from the lines (2, 2), up to FAR_M; computed around the lines only."""
    rows, columns = grid.field.shape
    on = np.zeros((rows, columns), np.bool_)
    for a, b in pieces:
        count = math.ceil(2.0 * math.dist(a, b) / grid.resolution_m) + 1
        at = (np.linspace(a, b, count) - (grid.x_m, grid.y_m)) / grid.resolution_m
        column, row = np.floor(at).astype(np.int64).T
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        on[row[inside], column[inside]] = True
    away_m = np.full((rows, columns), FAR_M)
    marked_rows, marked_columns = np.flatnonzero(on.any(axis=1)), np.flatnonzero(on.any(axis=0))
    if len(marked_rows):
        reach = math.ceil(FAR_M / grid.resolution_m)
        marked = marked_rows, marked_columns
        around = tuple(slice(max(0, int(at[0]) - reach), int(at[-1]) + reach + 1) for at in marked)
        away_m[around] = clearance_field(on[around], grid.resolution_m, FAR_M)
    return away_m


def _disc(grid: PlanningGrid, middle: Array, radius_m: float) -> npt.NDArray[np.bool_]:
    rows, columns = grid.field.shape
    x = grid.x_m + (np.arange(columns) + 0.5) * grid.resolution_m - middle[0]
    y = grid.y_m + (np.arange(rows) + 0.5) * grid.resolution_m - middle[1]
    across, up = np.meshgrid(x, y)
    return np.asarray(np.hypot(across, up) <= radius_m)
