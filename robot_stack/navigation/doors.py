"""Doors of the site: requests to the building, and whether the robot may enter a door's zone.

A passage begins when the route ahead meets the zone, or the robot is in it, and ends when neither is the case. During
it OPEN is requested again and again, and then CLOSED once. The robot enters only while the building reports the door
open for it, or staff have confirmed that it is; in the zone it goes on, and what it senses stops it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.contract.states import DOOR_WAITS, DoorMode, DoorPhase
from robot_stack.core.config import ConfigError
from robot_stack.core.doors import wait_text
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.robot import Footprint
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.params import DoorParams

Array = npt.NDArray[np.float64]
_REPEAT_S = 1.0
# A state older than this at its reception, or received longer ago, is stale.
_STALE_S = 2.5
# The clocks of robot and building may differ by this.
_CLOCKS_S = 0.5
# The door must be reported open for this long without another report between: two sources that contradict each other
# never let the robot pass.
_SETTLED_S = 1.0
# A robot that stands farther from where it stops for the door waits for something else.
_NEAR_M = 0.5
_STEP_M = 0.05


_SHUT = (DoorMode.CLOSED, DoorMode.MOVING)


@dataclass(frozen=True, slots=True)
class DoorState:
    """A report of the building. held: for this robot's session. stamp_s: of the report."""

    name: str
    mode: int
    held: bool
    stamp_s: float


@dataclass(frozen=True, slots=True)
class DoorRequest:
    name: str
    passage: int
    mode: DoorMode
    phase: DoorPhase


@dataclass(slots=True)
class _Passage:
    number: int
    inside: bool = False
    entered: bool = False  # with permission, or the passage began inside
    confirmed: bool = False
    waiting_since_s: float = math.nan
    asked_s: float = -math.inf
    phase: DoorPhase = DoorPhase.APPROACHING

    @property
    def waits(self) -> bool:
        return self.phase in DOOR_WAITS


class _Door:
    def __init__(self, zone: Zone, params: DoorParams, *, lift: bool) -> None:
        self.zone, self.lift = zone, lift
        self.answer_s = params.lift_answer_s if lift else params.answer_s
        self._low, self._high = zone.rings[0].min(axis=0), zone.rings[0].max(axis=0)
        # The first and the last report of the present run of reports that the door is open.
        self._open_from_s = self._open_until_s = self._shut_s = math.nan
        self.passage: _Passage | None = None

    def on_state(self, state: DoorState, now_s: float) -> None:
        if state.mode in _SHUT:
            self._shut_s = now_s
            if self.passage is not None:
                self.passage.confirmed = False
        if state.mode != DoorMode.OPEN or not state.held:
            self.forget_open()
        elif -_CLOCKS_S <= now_s - state.stamp_s <= _STALE_S:
            if not self._is_open(now_s):
                self._open_from_s = now_s
            self._open_until_s = now_s

    def forget_open(self) -> None:
        """Ends the present run of reports that the door is open."""
        self._open_from_s = self._open_until_s = math.nan

    def is_shut(self, now_s: float) -> bool:
        """Reported closed or moving."""
        return 0.0 <= now_s - self._shut_s <= _STALE_S

    def _is_open(self, now_s: float) -> bool:
        return 0.0 <= now_s - self._open_until_s <= _STALE_S

    def permits(self, now_s: float) -> bool:
        passage = self.passage
        if passage is None:
            return False
        reported = self._is_open(now_s) and self._open_until_s - self._open_from_s >= _SETTLED_S
        return reported or passage.confirmed or passage.entered

    def meets(self, footprint: Footprint, poses: Array) -> npt.NDArray[np.bool_]:
        """(n,) whether the footprint at the (n, 3) poses in map overlaps the zone."""
        met = np.zeros(len(poses), np.bool_)
        reach = footprint.circumscribed_m()
        near = np.all((poses[:, :2] > self._low - reach) & (poses[:, :2] < self._high + reach), axis=1)
        if near.any():
            x, y, yaw = poses[near].T[:, :, None]
            edge = outline(footprint)
            c, s = np.cos(yaw), np.sin(yaw)
            at_x, at_y = x + c * edge[:, 0] - s * edge[:, 1], y + s * edge[:, 0] + c * edge[:, 1]
            met[near] = self.zone.contains(at_x, at_y).any(axis=1)
        return met


class Doors:
    """The doors among the zones of a site. Times are those of the node's clock, s; one that steps delays a passage.

    lifts: the lift of each door that belongs to one: it answers later than others, and its cabin may be elsewhere.
    Raises ConfigError if such a door is no zone.
    """

    def __init__(self, zones: Iterable[Zone], params: DoorParams, lifts: Mapping[str, str] | None = None) -> None:
        self._params, self._lifts = params, lifts or {}
        found = (zone for zone in zones if zone.type is ZoneType.DOOR)
        self._doors = {zone.name: _Door(zone, params, lift=zone.name in self._lifts) for zone in found}
        if unknown := sorted(set(self._lifts) - set(self._doors)):
            raise ConfigError(f"the site's lifts have doors that are no zones of type door: {', '.join(unknown)}")
        self._closed: tuple[_Door, ...] = tuple(self._doors.values())
        self._passages = 0

    @property
    def exist(self) -> bool:
        return bool(self._doors)

    @property
    def text(self) -> str:
        """What the robot waits for, for people; empty if it does not wait for a door."""
        waits = ((name, door.passage) for name, door in self._doors.items() if door.passage and door.passage.waits)
        return next((wait_text(name, passage.phase) for name, passage in waits), "")

    def on_state(self, state: DoorState, now_s: float) -> None:
        """Takes a report of the building; one of an unknown door is ignored."""
        door = self._doors.get(state.name)
        if door is None:
            return
        door.on_state(state, now_s)
        if door.lift and state.mode in (DoorMode.OPEN, DoorMode.MOVING):
            # A cabin is at one level: reports of two open doors contradict each other.
            lift = self._lifts[state.name]
            for name in (other for other, owner in self._lifts.items() if owner == lift and other != state.name):
                self._doors[name].forget_open()

    def confirm(self, name: str, now_s: float) -> str:
        """Staff see that the door is open: it counts for the present passage, until the building reports it closed or
        moving. Returns why it is refused, else an empty text.
        """
        door = self._doors.get(name)
        if door is None:
            return f"the site has no door {name!r}"
        if door.passage is None or not door.passage.waits:
            return f"the robot does not wait for door {name!r}"
        if door.is_shut(now_s):
            return f"the building reports door {name!r} as not open"
        door.passage.confirmed = True
        return ""

    def permits(self, name: str, now_s: float) -> bool:
        """Whether the door is open for the robot; False for an unknown one."""
        return name in self._doors and self._doors[name].permits(now_s)

    def clear(self, name: str, footprint: Footprint, pose: Pose2) -> bool:
        """Whether the footprint is outside of the door's zone."""
        return not self._doors[name].meets(footprint, _row(pose))[0]

    def update(
        self,
        ahead: Array | None,
        here: Pose2 | None,
        footprint: Footprint,
        now_s: float,
        *,
        stands: bool,
        kept: str = "",
        called: str = "",
    ) -> tuple[DoorRequest, ...]:
        """One tick. ahead: (n, 3) poses of the route from the robot on, map, evenly spaced; empty without a goal, None
        while no route is planned. here: None while unknown. Returns the requests to publish.

        kept: of the cabin into which the route leads: its passage does not end before the ride. called: the robot waits
        in the cabin of a lift until this door is open; ``ahead`` is then empty.
        """
        if ahead is not None:  # what lies behind a closed door is requested once it is open
            ahead = ahead[: self.closed_from(footprint, ahead) + 1]
        requests = []
        for door in self._doors.values():
            name = door.zone.name
            request = self._update(
                door, ahead, here, footprint, now_s, stands=stands, kept=name == kept, called=name == called
            )
            if request is not None:
                requests.append(request)
        # The building never finds a cabin without a session between two doors of a lift.
        requests.sort(key=lambda request: request.mode is DoorMode.CLOSED)
        self._closed = tuple(door for door in self._doors.values() if not door.permits(now_s))
        return tuple(requests)

    def _update(
        self,
        door: _Door,
        ahead: Array | None,
        here: Pose2 | None,
        footprint: Footprint,
        now_s: float,
        *,
        stands: bool,
        kept: bool,
        called: bool,
    ) -> DoorRequest | None:
        passage, name = door.passage, door.zone.name
        inside = passage is not None and passage.inside
        if here is not None:
            inside = bool(door.meets(footprint, _row(here))[0])
        met = None if ahead is None else door.meets(footprint, ahead)
        holds = called or (kept and passage is not None)
        if not inside and not holds and (passage is None if met is None else not met.any()):
            door.passage = None
            return None if passage is None else DoorRequest(name, passage.number, DoorMode.CLOSED, DoorPhase.LEFT)
        if passage is None:
            self._passages += 1
            # Only a report shows that the cabin of a lift is at this level of the map.
            passage = door.passage = _Passage(self._passages, entered=inside and not door.lift)
        passage.entered = inside and door.permits(now_s)
        passage.inside = inside
        behind = kept and not inside and met is not None and not met.any()
        phase = DoorPhase.PASSING if behind else self._phase(door, passage, ahead, met, now_s, stands=stands)
        if phase is passage.phase and 0.0 <= now_s - passage.asked_s < _REPEAT_S:
            return None
        passage.phase, passage.asked_s = phase, now_s
        return DoorRequest(name, passage.number, DoorMode.OPEN, phase)

    def _phase(
        self,
        door: _Door,
        passage: _Passage,
        ahead: Array | None,
        met: npt.NDArray[np.bool_] | None,
        now_s: float,
        *,
        stands: bool,
    ) -> DoorPhase:
        if door.permits(now_s):
            passage.waiting_since_s = math.nan
            return DoorPhase.PASSING if passage.inside else DoorPhase.APPROACHING
        if ahead is not None and met is not None:
            first = int(np.argmax(met)) if met.any() else 0
            left_m = float(np.hypot(*np.diff(ahead[: first + 1, :2], axis=0).T).sum())
            if left_m > self._params.stop_m + _NEAR_M or not (stands or passage.waits):
                passage.waiting_since_s = math.nan
                return DoorPhase.APPROACHING
        elif not passage.waits:
            return passage.phase
        if not now_s >= passage.waiting_since_s:  # also the first time, when it is NaN
            passage.waiting_since_s = now_s
        late = now_s - passage.waiting_since_s >= door.answer_s
        return DoorPhase.ASKING_STAFF if late else DoorPhase.WAITING

    # --- closed doors ------------------------------------------------------------------------------------------------

    def closed_from(self, footprint: Footprint, poses: Array) -> int:
        """Index of the first of the (n, 3) poses in map that enters a zone without permission; n without one."""
        entries = [door.meets(footprint, poses) for door in self._closed]
        met = np.any(entries, axis=0) if entries else np.zeros(0, np.bool_)
        return int(np.argmax(met)) if met.any() else len(poses)

    def stop_m(self, footprint: Footprint, poses: Array, spacing_m: float) -> float:
        """Arc length at which to stop before a closed door; infinite without one. spacing_m: of the poses."""
        first = self.closed_from(footprint, poses)
        return first * spacing_m - self._params.stop_m if first < len(poses) else math.inf

    def limit_mps(self, footprint: Footprint, pose: Pose2, twist: Twist2, deceleration_mps2: float) -> float:
        """Speed with which the robot can still stop before a closed door in its present course. twist: base_link."""
        if not self._closed:
            return math.inf
        stop_m, speed_mps = self._params.stop_m, twist.speed()
        along_m = np.arange(0.0, 0.5 * speed_mps**2 / deceleration_mps2 + stop_m + 2.0 * _STEP_M, _STEP_M)
        course = pose.yaw + math.atan2(twist.vy, twist.vx)
        x, y = pose.x + along_m * math.cos(course), pose.y + along_m * math.sin(course)
        first = self.closed_from(footprint, np.column_stack((x, y, np.full(len(x), pose.yaw))))
        # A robot that stands in the zone of a closed door may leave it.
        if first in (0, len(along_m)):
            return math.inf
        return math.sqrt(2.0 * deceleration_mps2 * max(0.0, float(along_m[first]) - _STEP_M - stop_m))

    def hide(self, points: Array) -> Array:
        """``points`` (n, 2), map, without those in closed doors: a route leads through them once they are open."""
        for door in self._closed:
            if len(points):
                points = points[~door.zone.contains(points[:, 0], points[:, 1])]
        return points


def _row(pose: Pose2) -> Array:
    return np.array([(pose.x, pose.y, pose.yaw)])
