"""Automatic sliding doors, lifts, and the building's controller of them, which answers the requests of robots.

A door opens for the sessions that request it and closes once none is left; a session without a request for
``SESSION_S`` has ended. It closes regardless of what is in its way: the panel pushes nothing, as people's bodies do.

The doors of a lift open where its cabin is. It stays while its door there is not closed, or requested, and then goes to
the door with the oldest session.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robot_stack.contract.states import DoorMode
from robot_stack.core.geometry import Pose2
from sim.worldfile import Door, LiftCar, LiftStop

SESSION_S = 5.0
PREFIX = "door_"  # of the body's name


@dataclass(frozen=True, slots=True)
class DoorReport:
    name: str
    mode: DoorMode
    sessions: tuple[str, ...]


class SlidingDoor:
    def __init__(self, door: Door) -> None:
        self.door, self.name = door, f"{PREFIX}{door.name}"
        self._sessions: dict[str, tuple[float, float]] = {}  # begin and newest request, s
        self._open = 0.0  # share of the way

    def pose(self) -> Pose2:
        """Of the panel's middle on the ground, in map; x along the panel, the way it opens."""
        door = self.door
        return Pose2(door.x_m, door.y_m, door.yaw_rad).compose(Pose2(self._open * door.length_m, 0.0, 0.0))

    def request(self, requester: str, wants_open: bool, time_s: float) -> None:
        if wants_open:
            begun_s, _ = self._sessions.get(requester, (time_s, time_s))
            self._sessions[requester] = begun_s, time_s
        else:
            self._sessions.pop(requester, None)

    def step(self, time_s: float, dt_s: float, *, stuck: bool, closes: bool) -> None:
        self._sessions = {name: one for name, one in self._sessions.items() if time_s - one[1] <= SESSION_S}
        wanted = any(time_s - begun_s >= self.door.delay_s for begun_s, _ in self._sessions.values())
        way = dt_s / self.door.travel_s
        if wanted and not closes:
            self._open = self._open if stuck else min(1.0, self._open + way)
        else:
            self._open = max(0.0, self._open - way)

    @property
    def closed(self) -> bool:
        return self._open == 0.0

    @property
    def begun_s(self) -> float | None:
        """Begin of the oldest session; None without one."""
        return min((begun_s for begun_s, _ in self._sessions.values()), default=None)

    def report(self) -> DoorReport:
        mode = {0.0: DoorMode.CLOSED, 1.0: DoorMode.OPEN}.get(self._open, DoorMode.MOVING)
        return DoorReport(self.door.name, mode, tuple(self._sessions))


@dataclass(frozen=True, slots=True)
class Transfer:
    """What is in the cabin at ``start``, within half_m, is now at ``end``."""

    start: LiftStop
    end: LiftStop
    half_m: float

    def moves(self, x_m: float, y_m: float) -> bool:
        return max(abs(x_m - self.start.x_m), abs(y_m - self.start.y_m)) <= self.half_m


class Elevator:
    """doors: of the stops, in their order. The cabin begins at the first one."""

    def __init__(self, lift: LiftCar, doors: list[SlidingDoor]) -> None:
        self._lift, self._doors = lift, doors
        self._at, self._to, self._left_s = 0, 0, 0.0

    def is_at(self, door: SlidingDoor) -> bool:
        return self._to == self._at and door is self._doors[self._at]

    def step(self, dt_s: float) -> Transfer | None:
        """The transfer in the moment of an arrival."""
        if self._to == self._at:
            if all(door.closed for door in self._doors) and self._doors[self._at].begun_s is None:
                called = [(door.begun_s, at) for at, door in enumerate(self._doors) if door.begun_s is not None]
                _, self._to = min(called, default=(0.0, self._at))
                self._left_s = self._lift.travel_s * abs(self._to - self._at)
            return None
        self._left_s -= dt_s
        if self._left_s > 0.0:
            return None
        stops, start, self._at = self._lift.stops, self._at, self._to
        return Transfer(stops[start], stops[self._at], self._lift.half_m)


class Building:
    """dead: its interface takes no requests and reports nothing. stuck: no door opens. closes: each closes at once."""

    def __init__(self, doors: Iterable[Door], lifts: Sequence[LiftCar] = ()) -> None:
        self.doors = [SlidingDoor(door) for door in doors]
        by_name = {one.door.name: one for one in self.doors}
        self._lifts = [Elevator(lift, [by_name[stop.door] for stop in lift.stops]) for lift in lifts]
        self._lift_of = {stop.door: one for lift, one in zip(lifts, self._lifts, strict=True) for stop in lift.stops}
        self.dead = self.stuck = self.closes = False
        # Requests may arrive in another thread than the physics.
        self._requests: deque[tuple[str, str, bool]] = deque()

    def request(self, name: str, requester: str, wants_open: bool) -> None:
        self._requests.append((name, requester, wants_open))

    def step(self, time_s: float, dt_s: float) -> list[Transfer]:
        """The transfers of lifts that have arrived."""
        while self._requests:
            name, requester, wants_open = self._requests.popleft()
            for one in self.doors:
                if one.door.name == name and not self.dead:
                    one.request(requester, wants_open, time_s)
        for one in self.doors:
            lift = self._lift_of.get(one.door.name)
            away = lift is not None and not lift.is_at(one)
            one.step(time_s, dt_s, stuck=self.stuck, closes=self.closes or away)
        arrived = (lift.step(dt_s) for lift in self._lifts)
        return [transfer for transfer in arrived if transfer is not None]

    def reports(self) -> list[DoorReport]:
        return [] if self.dead else [one.report() for one in self.doors]
