"""The conditions of the fault list, one pure function per row: a snapshot of the inputs in, a finding out.

Each takes the snapshot, the parameters and the row's action in force (NONE while it is not raised), the only memory
needed for hysteresis. A new row is a function here and its code in ``CONDITIONS``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from robot_stack.contract import topics
from robot_stack.contract.model import Criticality, SafetyAction, Topic
from robot_stack.contract.processes import HEARTBEAT_STALE_S
from robot_stack.core.limits import STANDSTILL, SpeedLimit
from robot_stack.safety.collision_prediction import ground_limit_mps, seen_limit_mps, speed_limit_mps
from robot_stack.safety.inputs import CLEAR, UNKNOWN, Finding, Level, Snapshot

if TYPE_CHECKING:
    from robot_stack.safety.params import SafetyParams

_WARN, _LIMIT, _STOP, _EMERGENCY = SafetyAction.WARN, SafetyAction.LIMIT, SafetyAction.STOP, SafetyAction.EMERGENCY_STOP

Condition = Callable[[Snapshot, "SafetyParams", SafetyAction], Finding]


def estop_pressed(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """Any true on /emergency_stop, any source that is pressed, or a button without reports."""
    return _present(_EMERGENCY, now.estop) if now.estop else CLEAR


def joint_states_timeout(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """Stale joint states. Until they have come up, the robot waits but nothing is latched within the start-up grace."""
    if now.joint_states_age_s <= stale_s(topics.JOINT_STATES):
        return CLEAR if now.joint_states_up else _waiting("/joint_states: settling")
    detail = f"/joint_states: {now.joint_states_problem or _for_s(now.joint_states_age_s)}"
    if not now.joint_states_up and now.uptime_s <= params.startup_grace_s:
        return _waiting(detail)
    return _present(_EMERGENCY, detail)


def tilt(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """About to tip over."""
    if math.isnan(now.inclination_rad):
        return UNKNOWN
    if not now.inclination_rad > math.radians(params.tilt_clear_deg if active_action else params.tilt_stop_deg):
        return CLEAR
    return _present(_EMERGENCY, f"inclination {math.degrees(now.inclination_rad):.1f} deg")


def imu_timeout(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """No new sample, a frozen sensor included."""
    if now.imu_age_s <= stale_s(topics.IMU):
        return CLEAR
    return _present(_LIMIT, f"/sensors/imu: {now.imu_problem or _for_s(now.imu_age_s)}", _degraded(params))


def localization_lost(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """The pose is stale, has jumped, or has a low quality."""
    if not now.pose_age_s <= stale_s(topics.CURRENT_POSE):
        return _present(_STOP, f"/current_pose: {_for_s(now.pose_age_s)}")
    if not now.quality_age_s <= stale_s(topics.LOCALIZATION_QUALITY):
        return _present(_STOP, f"/localization/quality: {_for_s(now.quality_age_s)}")
    if now.pose_jump_m > params.pose_jump_m:
        return _present(_STOP, f"/current_pose jumped by {now.pose_jump_m:.2f} m")
    enough = now.quality > params.found_quality if active_action else now.quality >= params.lost_quality
    return CLEAR if enough else _present(_STOP, f"localization quality {now.quality:.2f}")


def node_dead(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """Expected processes without a heartbeat; the most critical one decides."""
    dead = {name: p for name, p in now.processes.items() if not p.age_s <= HEARTBEAT_STALE_S}
    if not dead:
        return CLEAR
    action = max(_LOSS[process.criticality] for process in dead.values())
    detail = f"no heartbeat of {', '.join(dead)}"
    return _present(action, detail, _degraded(params) if action == _LIMIT else None)


def latch_not_stored(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """A power cut would lose an emergency stop, or a passenger."""
    return _present(_LIMIT, now.latch_problem, _degraded(params)) if now.latch_problem else CLEAR


def battery_low(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """Not enough charge for a new mission. An unknown charge counts as a low one."""
    if not now.battery_age_s <= stale_s(topics.BATTERY_STATE):
        return _present(_WARN, f"/battery_state: {_for_s(now.battery_age_s)}")
    return _emptier(now, _refilled(params.battery_low, params, active_action), _WARN)


def battery_critical(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """Hardly any charge left: the speed is limited."""
    if not now.battery_age_s <= stale_s(topics.BATTERY_STATE):
        return UNKNOWN
    return _emptier(now, _refilled(params.battery_critical, params, active_action), _LIMIT, _degraded(params))


def camera_timeout(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """A docking that is guided by images does not get them. The docking controller ends it; nothing else is limited."""
    late = [
        f"{name}: {_for_s(age_s)}"
        for name, age_s in now.cameras.items()
        if not age_s <= stale_s(topics.FRONT_CAMERA_INFO)
    ]
    return _present(_WARN, ", ".join(late)) if late else CLEAR


def lidar_timeout(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """No new sweep of one of the LiDARs, a frozen or covered sensor included."""
    lidars = (
        (topics.LIDAR_POINTS, now.lidar_age_s, now.lidar_problem),
        (topics.OVERHEAD_LIDAR_POINTS, now.overhead_lidar_age_s, now.overhead_lidar_problem),
    )
    late = [f"{topic.name}: {why or _for_s(age_s)}" for topic, age_s, why in lidars if not age_s <= stale_s(topic)]
    return _present(_STOP, ", ".join(late)) if late else CLEAR


def obstacles_timeout(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """The obstacles around the robot are unknown."""
    if now.obstacles_age_s <= stale_s(topics.OBSTACLES):
        return CLEAR
    return _present(_STOP, f"/perception/obstacles: {now.obstacles_problem or _for_s(now.obstacles_age_s)}")


def collision_imminent(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """The robot must brake now, or is too near to an obstacle to start in its direction."""
    prediction, p = now.prediction, params.collision
    if prediction is None:
        return UNKNOWN
    time_s = p.stop_s + (p.hysteresis_s if active_action else 0.0)
    clearance_m = p.stop_clearance_m + (p.hysteresis_m if active_action else 0.0)
    if prediction.moving.time_s < time_s:
        return _present(_STOP, f"collision in {prediction.moving.time_s:.1f} s")
    if prediction.clearance_m < clearance_m:
        return _present(_STOP, f"obstacle {prediction.clearance_m:.2f} m ahead")
    return _present(_STOP, "pedestrian entering the path") if prediction.pedestrian_collision.stop else CLEAR


def obstacle_near(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """An obstacle is in the way: the nearer the slower."""
    prediction, p = now.prediction, params.collision
    if prediction is None:
        return UNKNOWN
    time_s = p.near_s + (p.hysteresis_s if active_action else 0.0)
    clearance_m = p.near_clearance_m + (p.hysteresis_m if active_action else 0.0)
    linear_mps, detail = prediction.pedestrian_collision.speed_mps, "pedestrian approaching"
    if prediction.time_s < time_s or prediction.clearance_m < clearance_m:
        ahead_mps = speed_limit_mps(prediction.clearance_m, p, prediction.brake_mps2)
        linear_mps, detail = min(linear_mps, ahead_mps), f"obstacle {prediction.clearance_m:.2f} m ahead"
    if math.isinf(linear_mps):
        return CLEAR
    linear_mps = max(linear_mps, p.slowest_mps)
    limit = SpeedLimit(linear_mps, max(p.slowest_radps, linear_mps / prediction.reach_m))
    return _present(_LIMIT, detail, limit)


def unseen_limit(now: Snapshot, params: SafetyParams) -> SpeedLimit | None:
    """The speed that stops within the seen or remembered part of the way, and on known ground with a passenger.

    This is no fault: it occurs at every start.
    """
    prediction = now.prediction
    if prediction is None or "OBSTACLES_TIMEOUT" not in params.rows:
        return None
    p, motion, linear_mps = params.collision, prediction.motion, math.inf
    if not math.isinf(prediction.unseen.clearance_m):
        linear_mps = seen_limit_mps(prediction.unseen.clearance_m, p, motion)
    if not math.isinf(prediction.no_ground.clearance_m):
        linear_mps = min(linear_mps, ground_limit_mps(prediction.no_ground.clearance_m, p, motion))
    return None if math.isinf(linear_mps) else SpeedLimit(linear_mps, linear_mps / prediction.reach_m)


def stale_sight_limit(now: Snapshot, params: SafetyParams) -> SpeedLimit | None:
    """While the newest obstacle points are stale: the limit of unseen space. A faster robot brakes hard.

    This is no fault: a few lost sweeps suffice. OBSTACLES_TIMEOUT is raised later and independently.
    """
    prediction = now.prediction
    if prediction is None or "OBSTACLES_TIMEOUT" not in params.rows:
        return None
    if now.sight_age_s <= params.obstacles.sight_stale_s:
        return None
    slow_mps = params.collision.unseen_mps
    # A limit above zero is approached at the comfortable deceleration. With its jerk limit the robot would lose 1 cm/s
    # until the row is raised.
    if prediction.no_faster_than(slow_mps):
        return SpeedLimit(slow_mps, slow_mps / prediction.reach_m)
    return STANDSTILL


def overheat(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """The computer is about to throttle or to shut down."""
    limit_c = params.computer.overheat_c - (params.computer.overheat_hysteresis_c if active_action else 0.0)
    return _above(now.computer.temperature_c, limit_c, f"the computer is at {now.computer.temperature_c:.0f} C")


def cpu_high(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """No processor time is left for unexpected load."""
    busy_percent = now.computer.cpu_percent
    if busy_percent > params.computer.cpu_high_percent and not (active_action or _long_busy(now, params)):
        return CLEAR
    return _above(busy_percent, params.computer.cpu_high_percent, f"processor {busy_percent:.0f} %")


def memory_high(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """The OOM killer is about to act."""
    limit_percent = params.computer.memory_high_percent - _usage_hysteresis(params, active_action)
    return _above(now.computer.memory_percent, limit_percent, f"memory {now.computer.memory_percent:.0f} %")


def disk_full(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """Journal and recordings are about to fail."""
    limit_percent = params.computer.disk_full_percent - _usage_hysteresis(params, active_action)
    return _above(now.computer.disk_percent, limit_percent, f"disk {now.computer.disk_percent:.0f} %")


def ehmi_link_lost(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """People around the robot do not see its intentions."""
    return _lost(now.ehmi_silent_s, topics.EHMI_STATUS, "no acknowledgement of the external display")


def ui_link_lost(now: Snapshot, params: SafetyParams, active_action: SafetyAction) -> Finding:
    """The passenger has no screen, and no stop on it."""
    return _lost(now.ui_silent_s, topics.UI_HEARTBEAT, "no page of the touch screen")


# Findings that a watch with a memory has made already (``robot_stack.safety.inputs.Snapshot``) pass unchanged.
CONDITIONS: Mapping[str, Condition] = {
    "ESTOP_PRESSED": estop_pressed,
    "CONTACT": lambda now, *_: now.contact,
    "CHAIR_LOOSE": lambda now, *_: now.chair_loose,
    "DRIVE_FAULT": lambda now, *_: now.drive,
    "STEERING_FAULT": lambda now, *_: now.steering,
    "JOINT_STATES_TIMEOUT": joint_states_timeout,
    "OVERSPEED": lambda now, *_: now.overspeed,
    "TILT": tilt,
    "LATCH_NOT_CLOSED": lambda now, *_: now.latch_not_closed,
    "COLLISION_IMMINENT": collision_imminent,
    "OBSTACLE_NEAR": obstacle_near,
    "LIDAR_TIMEOUT": lidar_timeout,
    "OBSTACLES_TIMEOUT": obstacles_timeout,
    "LOCALIZATION_LOST": localization_lost,
    "IMU_TIMEOUT": imu_timeout,
    "CAMERA_TIMEOUT": camera_timeout,
    "NODE_DEAD": node_dead,
    "SLOPE": lambda now, *_: now.slope,
    "LATCH_NOT_STORED": latch_not_stored,
    "BATTERY_LOW": battery_low,
    "BATTERY_CRITICAL": battery_critical,
    "OVERHEAT": overheat,
    "CPU_HIGH": cpu_high,
    "MEMORY_HIGH": memory_high,
    "DISK_FULL": disk_full,
    "EHMI_LINK_LOST": ehmi_link_lost,
    "UI_LINK_LOST": ui_link_lost,
}

_LOSS = {Criticality.CRITICAL: _STOP, Criticality.LIMITING: _LIMIT, Criticality.OPTIONAL: _WARN}


def _present(action: SafetyAction, detail: str, limit: SpeedLimit | None = None) -> Finding:
    return Finding(Level.PRESENT, action, limit, detail)


def _waiting(detail: str) -> Finding:
    return Finding(Level.WAITING, _STOP, detail=detail)


def _refilled(threshold: float, params: SafetyParams, active_action: SafetyAction) -> float:
    return threshold + (params.battery_hysteresis if active_action else 0.0)


def _emptier(now: Snapshot, needed: float, action: SafetyAction, limit: SpeedLimit | None = None) -> Finding:
    return _present(action, f"charge {now.battery:.0%}", limit) if now.battery < needed else CLEAR


def _above(value: float, limit: float, detail: str) -> Finding:
    """A warning. An unknown value neither raises nor clears it: its missing publisher is reported as NODE_DEAD."""
    if math.isnan(value):
        return UNKNOWN
    return _present(_WARN, detail) if value > limit else CLEAR


def _long_busy(now: Snapshot, params: SafetyParams) -> bool:
    return now.computer.cpu_high_for_s > params.computer.cpu_high_s


def _usage_hysteresis(params: SafetyParams, active_action: SafetyAction) -> float:
    return params.computer.usage_hysteresis_percent if active_action else 0.0


def _lost(silent_s: float | None, topic: Topic, detail: str) -> Finding:
    if silent_s is None or silent_s <= stale_s(topic):
        return CLEAR
    return _present(_WARN, f"{detail} for {silent_s:.1f} s")


def _degraded(params: SafetyParams) -> SpeedLimit:
    return SpeedLimit(params.degraded_limit_mps, params.degraded_limit_radps)


def stale_s(topic: Topic) -> float:
    """The contract's staleness limit of a topic, s."""
    return topic.stale_limit_s


def _for_s(age_s: float) -> str:
    return "never received" if math.isinf(age_s) else f"silent for {age_s:.2f} s"
