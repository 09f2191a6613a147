"""Turns the state of the robot over time into records of its rides."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from robot_stack.contract.states import ACTIVE, DOCKING, ENDED, DockingState, MissionState
from robot_stack.core.comfort import ComfortMeter
from robot_stack.core.rides import (
    STANDING_MPS,
    STOP_S,
    RideCharge,
    RideComfort,
    RideDocking,
    RidePoint,
    RideRecord,
    RideStop,
    RideWaypoint,
    why_standing,
)

# The record of a ride under way is written again after this time.
_SAVE_S = 10.0
_PATH_S = 1.0
# A step longer than this is a gap in the data, in which the robot is not assumed to have driven.
_LONGEST_STEP_S = 1.0
# A ride that never ends must not fill the memory: five hours of path, and stops every few seconds.
_MOST_ITEMS = 20_000
# Of the causes of one stop: reasons contain numbers that change.
_MOST_CAUSES = 20
_CHARGE_STEP = 0.005
_KNOWN = ACTIVE | ENDED | {MissionState.IDLE}


@dataclass(frozen=True, slots=True)
class Observation:
    """The robot at one moment. Unknown numbers are NaN.

    id: for a ride that begins now. at_s: system clock, s since the epoch. time_s: steady clock, in a
    recording the ROS clock.
    state, waypoint, reason: of /mission/status, state empty while unknown. x, y: m, map. speed_mps: of the wheels.
    allowed_mps, limited_by: of /safety/velocity_limit. docking: state of /docking/status, with its errors in m and rad.
    battery: [0, 1].
    """

    id: str
    at_s: float
    time_s: float
    mission_id: str = ""
    mission_name: str = ""
    state: str = ""
    waypoint: str = ""
    reason: str = ""
    attached: bool = False
    x: float = math.nan
    y: float = math.nan
    speed_mps: float = math.nan
    allowed_mps: float = math.nan
    limited_by: str = ""
    docking: str = ""
    docking_error_m: float = math.nan
    docking_error_rad: float = math.nan
    battery: float = math.nan


class RideWatch:
    """Call ``step`` a few times a second. A recording's clock that is set back stands still in the record meanwhile."""

    def __init__(self, seat: tuple[float, float, float]) -> None:
        """seat: see ``ComfortMeter``."""
        self._seat = seat
        self._ride: _Ride | None = None
        self._saved_s = self._last_s = -math.inf
        self._back_s = 0.0  # by which the clock was set back

    def step(self, seen: Observation) -> RideRecord | None:
        """The record to be written now, if any: at the begin and end of a ride, and every 10 s of it."""
        self._back_s += max(self._last_s - seen.time_s, 0.0)
        self._last_s = seen.time_s
        seen = replace(seen, time_s=seen.time_s + self._back_s)
        ride = self._ride
        if seen.state not in _KNOWN:  # the mission manager is silent: the ride may go on
            return None
        if ride is not None and (seen.mission_id != ride.first.mission_id or seen.state == MissionState.IDLE):
            return self.end()
        if ride is None:
            if seen.state not in ACTIVE:
                return None
            ride = self._ride = _Ride(seen, ComfortMeter(self._seat))
            self._saved_s = -math.inf
        ride.step(seen)
        if seen.state in ENDED:
            return self.end()
        if seen.time_s - self._saved_s < _SAVE_S:
            return None
        self._saved_s = seen.time_s
        return ride.record()

    def add_motion(
        self,
        stamp_s: float,
        acceleration_mps2: tuple[float, float, float],
        rotation_radps: tuple[float, float, float],
    ) -> None:
        """A sample of the inertial unit, see ``ComfortMeter.add``."""
        if self._ride is not None:
            self._ride.add_motion(stamp_s, acceleration_mps2, rotation_radps)

    def end(self) -> RideRecord | None:
        """The ride under way as far as it is known, at the end of the data."""
        ride, self._ride = self._ride, None
        return None if ride is None else ride.record()


@dataclass(slots=True)
class _Standing:
    """The robot stands since ``first``. What may be the cause is collected, each once."""

    first: Observation
    limits: dict[str, None] = field(default_factory=dict)
    docking: dict[str, None] = field(default_factory=dict)
    mission: dict[tuple[str, str, str], None] = field(default_factory=dict)
    until_s: float = 0.0

    def step(self, seen: Observation) -> None:
        self.until_s = seen.time_s
        if seen.allowed_mps <= 0.0 and len(self.limits) < _MOST_CAUSES:
            self.limits[seen.limited_by] = None
        if seen.docking in DOCKING:
            self.docking[seen.docking] = None
        if len(self.mission) < _MOST_CAUSES:
            self.mission[(seen.state, seen.waypoint, seen.reason)] = None

    def stop(self, begin_s: float) -> RideStop:
        why = why_standing(tuple(self.limits), tuple(self.docking), tuple(self.mission))
        first, duration_s = self.first, self.until_s - self.first.time_s
        return RideStop(
            begin_s=_s(first.time_s - begin_s), duration_s=_s(duration_s), x=_cm(first.x), y=_cm(first.y), why=why
        )


class _Ride:
    def __init__(self, first: Observation, comfort: ComfortMeter) -> None:
        self.first = self._last = first
        self._comfort = comfort
        self._charges: list[RideCharge] = []
        self._standing: _Standing | None = None
        self._stops: list[RideStop] = []
        self._waypoints: list[RideWaypoint] = []
        self._dockings: list[RideDocking] = []
        self._path: list[RidePoint] = []
        self._battery = math.nan
        self._distance_m = self._carried_m = self._top_mps = 0.0

    def step(self, seen: Observation) -> None:
        before, self._last = self._last, seen
        after_s = seen.time_s - self.first.time_s
        dt_s = min(seen.time_s - before.time_s, _LONGEST_STEP_S)
        if dt_s > 0.0 and math.isfinite(seen.speed_mps):
            self._distance_m += seen.speed_mps * dt_s
            self._carried_m += seen.speed_mps * dt_s if seen.attached else 0.0
            self._top_mps = max(self._top_mps, seen.speed_mps)
        if math.isnan(self._battery):
            self._battery = seen.battery
        last = self._charges[-1].charge if self._charges else math.inf
        if abs(seen.battery - last) >= _CHARGE_STEP and len(self._charges) < _MOST_ITEMS:
            self._charges.append(RideCharge(at_s=_s(after_s), charge=round(seen.battery, 3)))
        if before.waypoint and seen.waypoint != before.waypoint:
            self._waypoints.append(RideWaypoint(name=before.waypoint, done_s=_s(after_s)))
        if seen.docking == DockingState.DOCKED and before.docking in DOCKING and not before.attached:
            # The error that decided is the one before the latch draws the robot in.
            error = RideDocking(
                at_s=_s(after_s),
                error_m=_known(before.docking_error_m, 5),
                error_deg=_known(abs(math.degrees(before.docking_error_rad)), 3),
            )
            self._dockings.append(error)
        self._stand(seen)
        self._walk(seen, after_s)

    def add_motion(
        self,
        stamp_s: float,
        acceleration_mps2: tuple[float, float, float],
        rotation_radps: tuple[float, float, float],
    ) -> None:
        moves = self._last.speed_mps >= STANDING_MPS
        self._comfort.add(stamp_s, acceleration_mps2, rotation_radps, moves=moves)

    def _ride_comfort(self) -> RideComfort | None:
        found = self._comfort.comfort()
        if found is None:
            return None
        x, y, z = (round(value, 4) for value in found.weighted_mps2)
        return RideComfort(
            weighted_mps2=(x, y, z),
            total_mps2=round(found.total_mps2, 4),
            jerk_p99_mps3=round(found.jerk_p99_mps3, 2),
            duration_s=_s(found.duration_s),
        )

    def _stand(self, seen: Observation) -> None:
        if seen.speed_mps >= STANDING_MPS:
            self._end_of_stop()
            return
        if math.isnan(seen.speed_mps):
            return
        if self._standing is None:
            self._standing = _Standing(seen)
        self._standing.step(seen)

    def _end_of_stop(self) -> None:
        standing, self._standing = self._standing, None
        if standing is not None and _is_stop(standing) and len(self._stops) < _MOST_ITEMS:
            self._stops.append(standing.stop(self.first.time_s))

    def _walk(self, seen: Observation, after_s: float) -> None:
        if not (math.isfinite(seen.x) and math.isfinite(seen.y)) or len(self._path) >= _MOST_ITEMS:
            return
        last = self._path[-1] if self._path else None
        moving = not seen.speed_mps < STANDING_MPS
        arrived = last is not None and not moving and last.speed_mps >= STANDING_MPS
        if last is None or arrived or (moving and after_s - last.at_s >= _PATH_S):
            speed = seen.speed_mps if math.isfinite(seen.speed_mps) else 0.0
            point = RidePoint(at_s=_s(after_s), x=round(seen.x, 2), y=round(seen.y, 2), speed_mps=round(speed, 2))
            self._path.append(point)

    def record(self) -> RideRecord:
        first, last, standing = self.first, self._last, self._standing
        stops = self._stops
        if standing is not None and _is_stop(standing):
            stops = [*stops, standing.stop(first.time_s)]
        return RideRecord(
            id=first.id,
            mission_id=first.mission_id,
            mission_name=first.mission_name,
            began_s=first.at_s,
            duration_s=_s(last.time_s - first.time_s),
            state=MissionState(last.state),
            reason=last.reason,
            distance_m=round(self._distance_m, 2),
            carried_m=round(self._carried_m, 2),
            top_speed_mps=round(self._top_mps, 2),
            battery=(_known(self._battery, 3), _known(last.battery, 3)),
            stops=tuple(stops),
            waypoints=tuple(self._waypoints),
            dockings=tuple(self._dockings),
            path=tuple(self._path),
            comfort=self._ride_comfort(),
            charges=tuple(self._charges),
        )


def _is_stop(standing: _Standing) -> bool:
    return standing.until_s - standing.first.time_s >= STOP_S


def _s(seconds: float) -> float:
    return round(seconds, 2)


def _cm(metres: float) -> float | None:
    return _known(metres, 2)


def _known(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None
