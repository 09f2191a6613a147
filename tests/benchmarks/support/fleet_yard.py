"""A yard of one-lane ways in a square grid, and a fleet driven through it in simulated time, without a broker."""

from __future__ import annotations

import random
from itertools import product
from typing import Final

from robot_stack.core.geometry import Pose2
from tests.benchmarks.support.dispatcher import Dispatcher, Rules, Site, Transport
from tests.benchmarks.support.fleet_vehicle import FleetVehicle

_STEP_S: Final = 0.5
_UNIX_S: Final = 1.7e9
_WAITING: Final = 2  # transports for each robot that wait at any time


def yard(size: int, robots: int, chargers: int = 0, spacing_m: float = 6.0) -> Site:
    """size x size crossings, around which at most 4 size homes and chargers lie; the middle is at the origin."""
    places: dict[str, tuple[float, float]] = {}
    edges: set[tuple[str, str]] = set()
    middle = 0.5 * (size - 1)
    for column, row in product(range(size), repeat=2):
        places[f"{column},{row}"] = (spacing_m * (column - middle), spacing_m * (row - middle))
        edges |= {(f"{column},{row}", f"{column + 1},{row}")} if column + 1 < size else set()
        edges |= {(f"{column},{row}", f"{column},{row + 1}")} if row + 1 < size else set()
    sides = [side for i in range(size) for side in ((-1, i), (size, i), (i, -1), (i, size))]
    ends = [*(f"charger {i}" for i in range(chargers)), *(f"home {i}" for i in range(robots))]
    for name, (column, row) in zip(ends, sides[: len(ends)], strict=True):
        places[name] = (spacing_m * (column - middle), spacing_m * (row - middle))
        edges.add((name, f"{min(max(column, 0), size - 1)},{min(max(row, 0), size - 1)}"))
    homes = {f"robot_{i}": f"home {i}" for i in range(robots)}
    return Site(places, frozenset(edges), homes, {f"charger {i}": f"charger_{i}" for i in range(chargers)})


class YardFleet:
    """A fleet, its dispatcher and random transports. charge: of the batteries at the beginning, each a little less."""

    def __init__(self, site: Site, seed: int = 0, rules: Rules | None = None, charge: float = 1.0) -> None:
        self._site, self._random = site, random.Random(seed)
        docks = dict.fromkeys(site.chargers.values(), "charger")
        self.dispatcher = Dispatcher(site, rules)
        self.vehicles = {
            serial: FleetVehicle(serial, Pose2(*site.places[home], 0.0), docks=docks)
            for serial, home in site.homes.items()
        }
        for vehicle in self.vehicles.values():
            vehicle.charge = charge - 0.1 * self._random.random()
            vehicle.connected()
        self._stations = [node for node in site.places if "," in node]
        self.given = 0
        self.now_s = 0.0

    def give(self, count: int) -> None:
        for _ in range(count):
            source, destination = self._random.sample(self._stations, 2)
            self.dispatcher.add(Transport(f"transport {self.given}", source, destination))
            self.given += 1

    def step(self) -> None:
        self.now_s += _STEP_S
        for serial, vehicle in self.vehicles.items():
            for topic, payload in vehicle.tick(self.now_s, _UNIX_S + self.now_s).items():
                self.dispatcher.receive(serial, topic, payload)
        for serial, topic, payload in self.dispatcher.tick(self.now_s):
            self.vehicles[serial].agent.receive(topic, payload)

    def work(self, duration_s: float) -> None:
        """With transports always waiting."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.give(_WAITING * len(self.vehicles) - len(self.dispatcher.waiting))
            self.step()

    def finish(self, limit_s: float) -> None:
        """Drives all given transports, and then home. Raises TimeoutError."""
        end_s = self.now_s + limit_s
        while len(self.dispatcher.done) < self.given or not self.dispatcher.at_home:
            if self.now_s >= end_s:
                raise TimeoutError(f"{len(self.dispatcher.done)} of {self.given} transports in {limit_s:.0f} s")
            self.step()


def transports_per_robot_h(size: int, robots: int, duration_s: float, warm_up_s: float = 300.0) -> float:
    """Transports for each robot and hour of simulated time, after a warm-up."""
    fleet = YardFleet(yard(size, robots))
    fleet.work(warm_up_s)
    before = len(fleet.dispatcher.done)
    fleet.work(duration_s)
    return (len(fleet.dispatcher.done) - before) / robots / (duration_s / 3600.0)
