"""Share of the surroundings seen: the robot with its sensors, the band around it, and objects in the band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.range_sensor import RangeSensor
from robot_stack.core.robot import Footprint
from robot_stack.core.robot_shape import Placed
from robot_stack.coverage.contact import sensed
from robot_stack.coverage.params import CoverageParams
from robot_stack.coverage.rays import count_on_things, own_ranges

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Body:
    """The robot's body: its solids occlude beams, its footprint excludes objects. All in base_link.

    strips: of the safety edge.
    """

    solids: Sequence[Placed]
    footprint: Footprint
    strips: Sequence[Placed] = ()


@dataclass(frozen=True, slots=True)
class Grid:
    """cells: (m, 2) middles, m, base_link; index: (rows, columns) their numbers, -1 outside; origin: corner."""

    cells: F64
    index: I64
    origin_m: tuple[float, float]
    cell_m: float


@dataclass(frozen=True, slots=True)
class Seen:
    """points: (m,) per cell, on an object of each height (things) or at each height (maps), by height in m.

    contacts: (k,) per point of the outline, whether the safety edge senses an object of each height.
    """

    grid: Grid
    things: Mapping[float, I64]
    maps: Mapping[float, I64]
    by_sensor: Mapping[str, Mapping[float, I64]]
    contacts: Mapping[float, NDArray[np.bool_]]


class View:
    """One sensor's beams, shortened by the robot's own parts."""

    def __init__(self, sensor: RangeSensor, body: Body, edge_columns: int) -> None:
        """edge_columns: number of columns beside the robot's own parts that count as hidden, too."""
        beams = sensor.beams()
        azimuths = np.arctan2(beams[:, 1], beams[:, 0])
        order = np.argsort(azimuths)
        self._beams, self._azimuths = np.ascontiguousarray(beams[order]), azimuths[order]
        self._origin, self._least_m = np.array(sensor.xyz_m, float), sensor.min_m
        own = own_ranges(self._origin, beams, body.solids).reshape(sensor.columns, sensor.rings)
        steps = range(-edge_columns, edge_columns + 1)
        beside = np.min([np.roll(own, step, axis=0) for step in steps], axis=0).ravel()
        self._reach = np.minimum(beside, sensor.max_m)[order]

    def count(self, cells: F64, width_m: float, foot_m: float, top_m: float) -> I64:
        """(m,) number of beams of one period that hit an upright cylinder at each cell."""
        counts = np.zeros(len(cells), np.int64)
        count_on_things(
            self._origin,
            self._beams,
            self._reach,
            self._azimuths,
            self._least_m,
            cells,
            0.5 * width_m,
            foot_m,
            top_m,
            counts,
        )
        return counts


def band(footprint: Footprint, params: CoverageParams) -> Grid:
    """Possible centres of objects within ``band_m`` of the footprint that do not touch it."""
    half = 0.5 * footprint.width_m
    cell, reach = params.cell_m, params.band_m
    low = (footprint.rear_m - reach, -half - reach)
    size = (footprint.front_m - footprint.rear_m + 2.0 * reach, 2.0 * (half + reach))
    columns, rows = (int(np.ceil(length / cell)) for length in size)
    x = low[0] + (np.arange(columns) + 0.5) * cell
    y = low[1] + (np.arange(rows) + 0.5) * cell
    beside_x = np.maximum(0.0, np.maximum(footprint.rear_m - x, x - footprint.front_m))[None, :]
    beside_y = np.maximum(0.0, np.abs(y) - half)[:, None]
    away = np.hypot(beside_x, beside_y)
    inside = (away >= 0.5 * params.thing_width_m) & (away <= reach)
    index = np.full((rows, columns), -1, np.int64)
    index[inside] = np.arange(int(inside.sum()))
    found = np.argwhere(inside)
    return Grid(np.stack([x[found[:, 1]], y[found[:, 0]]], axis=1), index, low, cell)


def look(sensors: Mapping[str, RangeSensor], body: Body, params: CoverageParams) -> Seen:
    """Joint coverage of the sensors within one period of each, and of the safety edge."""
    grid = band(body.footprint, params)
    things = {height: np.zeros(len(grid.cells), np.int64) for height in params.thing_heights_m}
    maps = {height: np.zeros(len(grid.cells), np.int64) for height in params.map_heights_m}
    by_sensor: dict[str, dict[float, I64]] = {}
    for name, sensor in sensors.items():
        view = View(sensor, body, params.edge_columns)
        own = by_sensor.setdefault(name, {})
        for height, total in things.items():
            own[height] = view.count(grid.cells, params.thing_width_m, params.lowest_point_m, height)
            total += own[height]
        for height, total in maps.items():
            half = 0.5 * params.slab_m
            total += view.count(grid.cells, params.thing_width_m, height - half, height + half)
    contacts = {
        height: sensed(body.strips, body.solids, body.footprint, params.thing_width_m, height, params.cell_m)
        for height in params.thing_heights_m
    }
    return Seen(grid, things, maps, by_sensor, contacts)


def seen_pct(points: I64, points_min: int) -> float:
    """Share of the cells that have enough points, %."""
    return 100.0 * float((points >= points_min).mean())
