"""Converts a snapshot to sections of JSON values for pages, rounded to visible differences."""

from __future__ import annotations

import math
from typing import Any

from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.model import SafetyState
from robot_stack.contract.states import ACTIVE, DoorPhase, HeldBy, MissionState
from robot_stack.ui.snapshot import Docking, Limit, Order, Queue, Ride, Safety, Snapshot

Section = dict[str, Any]
_PLAN_POINTS_MAX = 200
_EMPTY = "BATTERY_CRITICAL"
_FLEET = "fleet"  # MissionOrder.FLEET
# Texts for a robot that stands because of its ride.
_STANDS_BY_RIDE: dict[str, str] = {
    MissionState.PAUSED: "PAUSED",
    MissionState.WAITING: "WAITING",
    MissionState.FAILED: "RIDE_FAILED",
    MissionState.ABORTED: "RIDE_ENDED",
}


def sections(snapshot: Snapshot) -> dict[str, Section]:
    """Every section that all pages may see, by name."""
    return {
        "safety": _safety(snapshot.safety, snapshot.limit, snapshot.emergency_stop),
        "ride": _ride(snapshot.ride),
        "queue": _queue(snapshot.queue),
        "stand": {"reasons": standing_reasons(snapshot)},
        "place": _place(snapshot),
        "docking": _docking(snapshot.docking),
        "battery": {"percent": _rounded(_percent(snapshot.battery), 0)},
        "computer": _computer(snapshot),
        "staff": {"called": snapshot.staff_called, "driving": snapshot.driven_by_hand},
        "navigation": {"text": snapshot.navigation[:200]},
        "door": {"name": "" if snapshot.door is None else snapshot.door[0]},
        "missing": {"topics": list(snapshot.missing)},
    }


def plan_section(snapshot: Snapshot) -> Section:
    """The plan in map, m, thinned for a screen; its last point stays."""
    points = snapshot.plan
    step = max(1, math.ceil(len(points) / _PLAN_POINTS_MAX))
    thinned = [*points[::step], *([points[-1]] if points and (len(points) - 1) % step else [])]
    return {"points": [[round(x, 2), round(y, 2)] for x, y in thinned]}


def marker_section(snapshot: Snapshot) -> Section:
    return {
        "seen": [
            {
                "id": item.marker_id,
                "camera": item.camera,
                "quality": _rounded(item.quality, 2),
                "at": [_rounded(value, 3) for value in (item.x_m, item.y_m, item.z_m)],
            }
            for item in snapshot.markers
        ]
    }


def people_section(snapshot: Snapshot) -> Section:
    """People and objects nearby, in map, m, m/s."""
    return {
        "near": [
            {
                "kind": item.kind,
                "at": [_rounded(value, 2) for value in (item.x_m, item.y_m)],
                "radius": _rounded(item.radius_m, 2),
                "speed": [_rounded(value, 2) for value in (item.vx_mps, item.vy_mps)],
            }
            for item in snapshot.people
        ]
    }


def display_section(snapshot: Snapshot) -> Section:
    """The state of the external display; unknown while it does not answer."""
    display = snapshot.display
    if display is None:
        return {"known": False, "linked": False, "state": None, "fault": ""}
    state = display.state if display.linked else None
    return {"known": True, "linked": display.linked, "state": state, "fault": display.fault[:64]}


def standing_reasons(snapshot: Snapshot) -> list[str]:
    """Why the robot stands or may not move, most severe first; empty if there is no reason.

    Keys of texts: fault codes, and other reasons.
    """
    if snapshot.safety is None:
        return ["NO_SAFETY"]
    held = _held(snapshot.safety, snapshot.limit)
    if snapshot.emergency_stop and not held:
        held = ["ESTOP_PRESSED"]
    if held:
        return held
    if snapshot.driven_by_hand:
        return ["BY_HAND"]
    if snapshot.ride is None:
        return ["NO_MISSION_MANAGER"]
    reason = _stands_by_ride(snapshot.ride, snapshot.queue) or _stands_at_door(snapshot)
    # It only limits the speed, but the mission manager pauses the ride for it.
    empty = snapshot.ride.state == MissionState.PAUSED and _EMPTY in snapshot.safety.faults
    return [*([_EMPTY] if empty else []), *([reason] if reason else [])]


def _stands_by_ride(ride: Ride, queue: Queue | None) -> str | None:
    if ride.state == MissionState.PAUSED and queue is not None and queue.paused_by == _FLEET:
        return "PAUSED_BY_FLEET"
    if ride.state == MissionState.WAITING and not ride.waypoint:
        return "AWAITS_ROUTE"
    return _STANDS_BY_RIDE.get(ride.state)


def _stands_at_door(snapshot: Snapshot) -> str | None:
    if snapshot.door is None:
        return None
    return "DOOR_UNANSWERED" if snapshot.door[1] == DoorPhase.ASKING_STAFF else "DOOR"


def _held(safety: Safety, limit: Limit | None) -> list[str]:
    """Codes that stop the robot. Those that only slow it down are left out."""
    emergency = safety.state == SafetyState.EMERGENCY_STOP.name
    stopped = limit is not None and limit.linear_mps <= 0.0
    if not emergency and not stopped:
        return []
    named = limit.reasons if limit is not None and stopped else ()
    codes = [code for code in dict.fromkeys((*named, *safety.faults)) if code in BY_CODE]
    codes.sort(key=lambda code: -BY_CODE[code].action)
    least = max((BY_CODE[code].action for code in codes), default=0)
    return [code for code in codes if BY_CODE[code].action == least] or ["ESTOP_PRESSED" if emergency else "STOPPED"]


def _safety(safety: Safety | None, limit: Limit | None, emergency_stop: bool) -> Section:
    known = safety is not None
    return {
        "known": known,
        "state": safety.state if safety else "UNKNOWN",
        "emergency": emergency_stop or (safety is not None and safety.state == SafetyState.EMERGENCY_STOP.name),
        "pressed": bool(safety and safety.pressed),
        "faults": [_fault(code) for code in (safety.faults if safety else ())],
        "obstacle_m": _rounded(safety.obstacle_m, 1) if safety else None,
        "limit_mps": _rounded(limit.linear_mps, 2) if limit else None,
        "limit_reasons": list(limit.reasons) if limit else [],
    }


def _fault(code: str) -> Section:
    row = BY_CODE.get(code)
    return {
        "code": code,
        "action": row.action.name if row else "NONE",
        "latched": bool(row and row.clears.name == "ON_RESET"),
        "when": row.raised_when if row else "",
    }


def _ride(ride: Ride | None) -> Section:
    if ride is None:
        return {"known": False, "state": "UNKNOWN", "active": False}
    return {
        "known": True,
        "state": ride.state,
        "active": ride.state in ACTIVE,
        "mission": ride.mission_id,
        "waypoint": ride.waypoint,
        "completed": ride.completed,
        "total": ride.total,
        "progress": _rounded(ride.progress, 2),
        "eta_s": _eta(ride.eta_s),
        "passenger": ride.passenger,
        "reason": ride.reason[:300],
        "last_command": ride.last_command,
        "accepted": ride.accepted,
    }


def _queue(queue: Queue | None) -> Section:
    if queue is None:
        return {
            "known": False,
            "held_by": HeldBy.NOTHING.name,
            "reason": "",
            "orders": [],
            "current": None,
            "paused_by": "",
        }
    return {
        "known": True,
        "held_by": queue.held_by,
        "reason": queue.reason[:300],
        "orders": [_order(order) for order in queue.orders],
        "current": _order(queue.current) if queue.current else None,
        "paused_by": queue.paused_by,
    }


def _order(order: Order) -> Section:
    return {
        "id": order.id,
        "mission": order.mission_id,
        "origin": order.origin,
        "priority": order.priority,
        "earliest_s": _rounded(order.earliest_s, 0) or None,
        "open": order.open,
    }


def _eta(eta_s: float) -> int | None:
    """The ETA in coarse steps, so that it does not change every second."""
    if not math.isfinite(eta_s) or eta_s < 0.0:
        return None
    step_s = 5 if eta_s < 60.0 else 15
    return int(step_s * math.ceil(eta_s / step_s))


def _place(snapshot: Snapshot) -> Section:
    pose, speed = snapshot.pose, snapshot.speed
    return {
        "pose": [_rounded(pose.x, 2), _rounded(pose.y, 2), _rounded(pose.yaw, 3)] if pose else None,
        "quality": _rounded(snapshot.quality, 1),
        "speed_mps": _rounded(speed[0], 2) if speed else None,
        "turn_radps": _rounded(speed[1], 2) if speed else None,
    }


def _docking(docking: Docking | None) -> Section:
    if docking is None:
        return {"state": "UNKNOWN"}
    return {
        "state": docking.state,
        "position_mm": _rounded(1e3 * docking.position_m, 1),
        "yaw_deg": _rounded(math.degrees(docking.yaw_rad), 2),
        "markers": docking.markers,
        "progress": _rounded(docking.progress, 2),
    }


def _computer(snapshot: Snapshot) -> Section:
    computer = snapshot.computer
    if computer is None:
        return {"known": False}
    return {
        "known": True,
        "cpu_pct": _rounded(computer.cpu_pct, 0),
        "memory_pct": _rounded(computer.memory_pct, 0),
        "disk_pct": _rounded(computer.disk_pct, 0),
    }


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _rounded(value: float | None, digits: int) -> float | None:
    """None for values that are unknown or infinite: JSON has neither."""
    return round(float(value), digits) if value is not None and math.isfinite(value) else None
