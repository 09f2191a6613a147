"""Automatic sliding doors and the building's controller of them, which answers the requests of robots.

A door opens for the sessions that request it and closes once none is left; a session without a request for
``SESSION_S`` has ended. It closes regardless of what is in its way: the panel pushes nothing, as people's bodies do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from robot_stack.contract.states import DoorMode
from robot_stack.core.geometry import Pose2
from sim.worldfile import Door

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

    def report(self) -> DoorReport:
        mode = {0.0: DoorMode.CLOSED, 1.0: DoorMode.OPEN}.get(self._open, DoorMode.MOVING)
        return DoorReport(self.door.name, mode, tuple(self._sessions))


class Building:
    """dead: its interface takes no requests and reports nothing. stuck: no door opens. closes: each closes at once."""

    def __init__(self, doors: Iterable[Door]) -> None:
        self.doors = [SlidingDoor(door) for door in doors]
        self.dead = self.stuck = self.closes = False
        # Requests may arrive in another thread than the physics.
        self._requests: deque[tuple[str, str, bool]] = deque()

    def request(self, name: str, requester: str, wants_open: bool) -> None:
        self._requests.append((name, requester, wants_open))

    def step(self, time_s: float, dt_s: float) -> None:
        while self._requests:
            name, requester, wants_open = self._requests.popleft()
            for one in self.doors:
                if one.door.name == name and not self.dead:
                    one.request(requester, wants_open, time_s)
        for one in self.doors:
            one.step(time_s, dt_s, stuck=self.stuck, closes=self.closes)

    def reports(self) -> list[DoorReport]:
        return [] if self.dead else [one.report() for one in self.doors]
