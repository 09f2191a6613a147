"""The conditions of the fault list, one pure function per row: what the monitor knows in, what it means out.

Each takes the snapshot, the parameters and the action that the row asks for at the moment (NONE while it is not
raised), which is all the memory that hysteresis needs. A new row is a function here and its code in ``CONDITIONS``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from robot_stack.contract import topics
from robot_stack.contract.model import Criticality, SafetyAction, Topic
from robot_stack.safety.inputs import CLEAR, Finding, Level, Snapshot, SpeedLimit
from robot_stack.safety.outlook import speed_limit_mps

if TYPE_CHECKING:
    from robot_stack.safety.params import SafetyParams

_WARN, _LIMIT, _STOP, _EMERGENCY = SafetyAction.WARN, SafetyAction.LIMIT, SafetyAction.STOP, SafetyAction.EMERGENCY_STOP
_UNKNOWN = Finding(Level.UNKNOWN)

Condition = Callable[[Snapshot, "SafetyParams", SafetyAction], Finding]


def estop_pressed(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Any true on /emergency_stop."""
    return _present(_EMERGENCY, now.estop) if now.estop else CLEAR


def drive_fault(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Judged by ``DriveWatch``."""
    return now.drive


def joint_states_timeout(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Too old. Until they have come up, the robot waits but nothing is latched within the start-up grace."""
    if now.joint_states_age_s <= stale_s(topics.JOINT_STATES):
        return CLEAR if now.joint_states_up else _waiting("/joint_states: settling")
    detail = f"/joint_states: {now.joint_states_problem or _for_s(now.joint_states_age_s)}"
    if not now.joint_states_up and now.uptime_s <= params.startup_grace_s:
        return _waiting(detail)
    return _present(_EMERGENCY, detail)


def tilt(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """About to tip over."""
    if math.isnan(now.inclination_rad):
        return _UNKNOWN
    threshold_deg = params.tilt_clear_deg if held else params.tilt_stop_deg
    return _steeper(now, threshold_deg, _EMERGENCY) or CLEAR


def slope(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Too steep to drive fast, or at all."""
    if math.isnan(now.inclination_rad):
        return _UNKNOWN
    stop_deg = params.slope_stop_deg - (params.slope_hysteresis_deg if held >= _STOP else 0.0)
    limit_deg = params.slope_limit_deg - (params.slope_hysteresis_deg if held else 0.0)
    limit = SpeedLimit(params.slope_limit_mps, params.slope_limit_radps)
    return _steeper(now, stop_deg, _STOP) or _steeper(now, limit_deg, _LIMIT, limit) or CLEAR


def imu_timeout(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """No new sample, a frozen sensor included."""
    if now.imu_age_s <= stale_s(topics.IMU):
        return CLEAR
    return _present(_LIMIT, f"/sensors/imu: {now.imu_problem or _for_s(now.imu_age_s)}", _degraded(params))


def localization_lost(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Nobody knows where the robot is."""
    if not now.pose_age_s <= stale_s(topics.CURRENT_POSE):
        return _present(_STOP, f"/current_pose: {_for_s(now.pose_age_s)}")
    if not now.quality_age_s <= stale_s(topics.LOCALIZATION_QUALITY):
        return _present(_STOP, f"/localization/quality: {_for_s(now.quality_age_s)}")
    if now.pose_jump_m > params.pose_jump_m:
        return _present(_STOP, f"/current_pose jumped by {now.pose_jump_m:.2f} m")
    enough = now.quality > params.found_quality if held else now.quality >= params.lost_quality
    return CLEAR if enough else _present(_STOP, f"localization quality {now.quality:.2f}")


def node_dead(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Expected processes without a heartbeat; the most critical one decides."""
    dead = {name: p for name, p in now.processes.items() if not p.age_s <= stale_s(topics.HEARTBEAT)}
    if not dead:
        return CLEAR
    action = max(_LOSS[process.criticality] for process in dead.values())
    detail = f"no heartbeat of {', '.join(dead)}"
    return _present(action, detail, _degraded(params) if action == _LIMIT else None)


def battery_low(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Not enough charge for a new mission. A charge that nobody knows is taken for a low one."""
    if not now.battery_age_s <= stale_s(topics.BATTERY_STATE):
        return _present(_WARN, f"/battery_state: {_for_s(now.battery_age_s)}")
    return _emptier(now, _refilled(params.battery_low, params, held), _WARN)


def battery_critical(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Hardly any charge left: slowly home."""
    if not now.battery_age_s <= stale_s(topics.BATTERY_STATE):
        return _UNKNOWN
    return _emptier(now, _refilled(params.battery_critical, params, held), _LIMIT, _degraded(params))


def camera_timeout(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """A docking that is guided by images does not get them. The docking controller ends it; nobody else is slower."""
    late = [
        f"{name}: {_for_s(age_s)}"
        for name, age_s in now.cameras.items()
        if not age_s <= stale_s(topics.FRONT_CAMERA_INFO)
    ]
    return _present(_WARN, ", ".join(late)) if late else CLEAR


def lidar_timeout(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """No new sweep, a frozen or covered sensor included."""
    if now.lidar_age_s <= stale_s(topics.LIDAR_POINTS):
        return CLEAR
    return _present(_STOP, f"/sensors/lidar/points: {now.lidar_problem or _for_s(now.lidar_age_s)}")


def obstacles_timeout(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Nobody says what is around the robot."""
    if now.obstacles_age_s <= stale_s(topics.OBSTACLES):
        return CLEAR
    return _present(_STOP, f"/perception/obstacles: {now.obstacles_problem or _for_s(now.obstacles_age_s)}")


def collision_imminent(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Too late to do anything but brake, or too near to set out in that direction."""
    outlook, p = now.outlook, params.collision
    if outlook is None:
        return _UNKNOWN
    time_s = p.stop_s + (p.hysteresis_s if held else 0.0)
    clearance_m = p.stop_clearance_m + (p.hysteresis_m if held else 0.0)
    if outlook.moving.time_s < time_s:
        return _present(_STOP, f"collision in {outlook.moving.time_s:.1f} s")
    if outlook.clearance_m < clearance_m:
        return _present(_STOP, f"obstacle {outlook.clearance_m:.2f} m ahead")
    return CLEAR


def obstacle_near(now: Snapshot, params: SafetyParams, held: SafetyAction) -> Finding:
    """Something is in the way: the nearer the slower."""
    outlook, p = now.outlook, params.collision
    if outlook is None:
        return _UNKNOWN
    time_s = p.near_s + (p.hysteresis_s if held else 0.0)
    clearance_m = p.near_clearance_m + (p.hysteresis_m if held else 0.0)
    if not (outlook.time_s < time_s or outlook.clearance_m < clearance_m):
        return CLEAR
    linear_mps = speed_limit_mps(outlook.clearance_m, p, outlook.brake_mps2)
    limit = SpeedLimit(linear_mps, max(p.slowest_radps, linear_mps / outlook.reach_m))
    return _present(_LIMIT, f"obstacle {outlook.clearance_m:.2f} m ahead", limit)


CONDITIONS: Mapping[str, Condition] = {
    "ESTOP_PRESSED": estop_pressed,
    "DRIVE_FAULT": drive_fault,
    "JOINT_STATES_TIMEOUT": joint_states_timeout,
    "TILT": tilt,
    "COLLISION_IMMINENT": collision_imminent,
    "OBSTACLE_NEAR": obstacle_near,
    "LIDAR_TIMEOUT": lidar_timeout,
    "OBSTACLES_TIMEOUT": obstacles_timeout,
    "LOCALIZATION_LOST": localization_lost,
    "IMU_TIMEOUT": imu_timeout,
    "CAMERA_TIMEOUT": camera_timeout,
    "NODE_DEAD": node_dead,
    "SLOPE": slope,
    "BATTERY_LOW": battery_low,
    "BATTERY_CRITICAL": battery_critical,
}

_LOSS = {Criticality.CRITICAL: _STOP, Criticality.LIMITING: _LIMIT, Criticality.OPTIONAL: _WARN}


def _present(action: SafetyAction, detail: str, limit: SpeedLimit | None = None) -> Finding:
    return Finding(Level.PRESENT, action, limit, detail)


def _waiting(detail: str) -> Finding:
    return Finding(Level.WAITING, _STOP, detail=detail)


def _steeper(
    now: Snapshot, threshold_deg: float, action: SafetyAction, limit: SpeedLimit | None = None
) -> Finding | None:
    if not now.inclination_rad > math.radians(threshold_deg):
        return None
    return _present(action, f"inclination {math.degrees(now.inclination_rad):.1f} deg", limit)


def _refilled(threshold: float, params: SafetyParams, held: SafetyAction) -> float:
    return threshold + (params.battery_hysteresis if held else 0.0)


def _emptier(now: Snapshot, needed: float, action: SafetyAction, limit: SpeedLimit | None = None) -> Finding:
    return _present(action, f"charge {now.battery:.0%}", limit) if now.battery < needed else CLEAR


def _degraded(params: SafetyParams) -> SpeedLimit:
    return SpeedLimit(params.degraded_limit_mps, params.degraded_limit_radps)


def stale_s(topic: Topic) -> float:
    """The contract's staleness limit of a topic, s."""
    assert topic.stale_s is not None, f"{topic.name} has no stale_s"
    return topic.stale_s


def _for_s(age_s: float) -> str:
    return "never received" if math.isinf(age_s) else f"silent for {age_s:.2f} s"
