"""Records of missions as they were driven: one JSON file each in ``<state>/rides``, read by ``robot-stack report``."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import ValidationError

from robot_stack.contract.states import DOCKING, MissionState
from robot_stack.core.atomic_file import replace_file
from robot_stack.core.config import Config
from robot_stack.core.runtime import state_dir

# Slower is standing, and standing for this long is a stop.
STANDING_MPS = 0.05
STOP_S = 2.0


class RideStop(Config):
    """The robot stood. begin_s: after the begin of the ride. x, y: m, map; None without a pose. why: for people."""

    begin_s: float
    duration_s: float
    x: float | None
    y: float | None
    why: str


class RideWaypoint(Config):
    """done_s: when the mission went on from it, s after the begin."""

    name: str
    done_s: float


class RideDocking(Config):
    """A docking that reached its dock. error_m, error_deg: the docking controller's last; None unknown."""

    at_s: float
    error_m: float | None
    error_deg: float | None


class RidePoint(Config):
    """at_s after the begin; m and m/s, map."""

    at_s: float
    x: float
    y: float
    speed_mps: float


class RideComfort(Config):
    """See ``robot_stack.core.comfort.Comfort``: x and y horizontal, z vertical; weighted by ISO 2631-1, at the seat."""

    weighted_mps2: tuple[float, float, float]
    total_mps2: float
    jerk_p99_mps3: float
    duration_s: float


class RideCharge(Config):
    """charge: of the battery, [0, 1], where it changed."""

    at_s: float
    charge: float


class RideRecord(Config):
    """One mission from its start to its end.

    id: date and time (UTC, ms) of the begin. began_s: s since the epoch. duration_s: of the steady clock, in a
    recording of the ROS clock.
    state: as in /mission/status; RUNNING, WAITING or PAUSED if the record ended before the mission did.
    distance_m: by odometry. carried_m: of it with a wheelchair. battery: [0, 1] at begin and end, None unknown.
    comfort: None before the robot has driven for some seconds.
    """

    id: str
    mission_id: str
    mission_name: str
    began_s: float
    duration_s: float
    state: MissionState
    reason: str
    distance_m: float
    carried_m: float
    top_speed_mps: float
    battery: tuple[float | None, float | None]
    stops: tuple[RideStop, ...] = ()
    waypoints: tuple[RideWaypoint, ...] = ()
    dockings: tuple[RideDocking, ...] = ()
    path: tuple[RidePoint, ...] = ()
    comfort: RideComfort | None = None
    charges: tuple[RideCharge, ...] = ()

    @property
    def stood_s(self) -> float:
        return sum(stop.duration_s for stop in self.stops)


def why_standing(limits: Sequence[str], docking: Sequence[str], mission: Sequence[tuple[str, str, str]]) -> str:
    """The most severe cause of a stop: the safety monitor, docking, or the mission.

    limits: reasons of the limits of 0 m/s while it stood. docking: states. mission: state, waypoint and reason.
    """
    if limits:
        return f"stopped: {', '.join(dict.fromkeys(filter(None, limits))) or 'no reason given'}"
    moving = [state for state in docking if state in DOCKING]
    if moving:
        return f"docking: {' -> '.join(dict.fromkeys(moving))}"
    changes = [item for item in mission if item[0] != MissionState.RUNNING] or mission[:1]
    reasons = [reason for _, _, reason in mission if reason] or [f"{s.lower()} at {w}" for s, w, _ in changes]
    return "; ".join(dict.fromkeys(reasons))


def rides_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """It need not exist yet."""
    return state_dir(environment) / "rides"


def write_ride(folder: Path, record: RideRecord) -> None:
    """Writes or replaces the record atomically. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / f"{record.id}.json", record.model_dump_json())


def read_rides(folder: Path, from_s: float, until_s: float) -> tuple[list[RideRecord], list[Path]]:
    """(the rides that began in [from_s, until_s), oldest first; files that are no records)."""
    rides, damaged = [], []
    for path in sorted(folder.glob("*.json")):
        try:
            ride = RideRecord.model_validate_json(path.read_bytes())
        except (OSError, ValidationError):
            damaged.append(path)
            continue
        if from_s <= ride.began_s < until_s:
            rides.append(ride)
    return sorted(rides, key=lambda ride: ride.began_s), damaged


def delete_rides(folder: Path, before_s: float) -> None:
    """Deletes the records of rides that were last written before ``before_s``. Raises OSError."""
    for path in folder.glob("*.json"):
        if path.stat().st_mtime < before_s:
            path.unlink(missing_ok=True)
