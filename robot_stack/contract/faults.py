"""The closed fault list of the safety monitor, one row each.

Thresholds are parameters of ``config/safety_monitor.yaml``.
"""

from collections.abc import Collection, Iterable

from robot_stack.contract.model import Clears, Fault, SafetyAction, SafetyState

_GONE, _RESET = Clears.WHEN_GONE, Clears.ON_RESET
_WARN, _LIMIT, _STOP, _ESTOP = SafetyAction.WARN, SafetyAction.LIMIT, SafetyAction.STOP, SafetyAction.EMERGENCY_STOP
_DEGRADED, _AVOIDANCE, _EMERGENCY = SafetyState.DEGRADED, SafetyState.COLLISION_AVOIDANCE, SafetyState.EMERGENCY_STOP

FAULTS: tuple[Fault, ...] = (
    Fault(
        "ESTOP_PRESSED", "any /emergency_stop true, or the button's process silent > 0.4 s", _ESTOP, _EMERGENCY, _RESET
    ),
    Fault(
        "CONTACT", "a side of the safety edge pressed or its wire cut, or its relay open", _ESTOP, _EMERGENCY, _RESET
    ),
    Fault(
        "CHAIR_LOOSE",
        "latch no longer confirmed closed with a wheelchair on it, without a command at standstill",
        _ESTOP,
        _EMERGENCY,
        _RESET,
    ),
    Fault(
        "DRIVE_FAULT",
        "amplifier alarm, servo off unasked, following error, or engine not communicating > 0.1 s",
        _ESTOP,
        _EMERGENCY,
        _RESET,
    ),
    Fault(
        "STEERING_FAULT",
        "rolling, a module > 20 deg or a wheel > 0.15 m/s off the common motion for 0.5 s",
        _ESTOP,
        _EMERGENCY,
        _RESET,
    ),
    Fault("JOINT_STATES_TIMEOUT", "/joint_states older than 0.1 s", _ESTOP, _EMERGENCY, _RESET),
    Fault("OVERSPEED", "measured faster than the limit permits for 0.3 s", _ESTOP, _EMERGENCY, _RESET),
    Fault("TILT", "tilt > 15 deg", _ESTOP, _EMERGENCY, _RESET),
    Fault(
        "LATCH_NOT_CLOSED",
        "wheelchair attached, latch not confirmed closed: stops all motion but a slow undocking",
        _STOP,
        _DEGRADED,
        _GONE,
    ),
    Fault(
        "COLLISION_IMMINENT",
        "time to collision < 1.0 s or clearance < 0.15 m ahead of the motion",
        _STOP,
        _AVOIDANCE,
        _GONE,
        0.5,
    ),
    Fault("OBSTACLE_NEAR", "time to collision < 3.0 s or clearance < 1.0 m", _LIMIT, _AVOIDANCE, _GONE),
    Fault(
        "LIDAR_TIMEOUT",
        "/sensors/lidar/points older than 0.5 s, or /sensors/overhead_lidar/points than 0.3 s",
        _STOP,
        _DEGRADED,
        _GONE,
        1.0,
    ),
    Fault("OBSTACLES_TIMEOUT", "/perception/obstacles older than 0.3 s", _STOP, _DEGRADED, _GONE, 1.0),
    Fault(
        "LOCALIZATION_LOST",
        "quality < 0.3, pose older than 0.5 s, or a jump > 1 m",
        _STOP,
        _DEGRADED,
        _GONE,
        2.0,
        gentle=True,
    ),
    Fault("IMU_TIMEOUT", "/sensors/imu older than 0.1 s, or frozen", _LIMIT, _DEGRADED, _GONE, 1.0),
    Fault("CAMERA_TIMEOUT", "a camera image older than 0.5 s while docking", _WARN, _DEGRADED, _GONE),
    Fault("NODE_DEAD", "no heartbeat of a process for 1 s: critical stops, others limit", _STOP, _DEGRADED, _GONE),
    Fault(
        "SLOPE",
        "slope > 5 deg limits, > 10 deg stops every motion but a slow one downhill along the fall line",
        _STOP,
        _DEGRADED,
        _GONE,
        gentle=True,
    ),
    Fault("LATCH_NOT_STORED", "latched stop and passenger cannot be written to disk", _LIMIT, _DEGRADED, _GONE),
    Fault("BATTERY_LOW", "charge < 30 %", _WARN, _DEGRADED, _GONE),
    Fault("BATTERY_CRITICAL", "charge < 15 %", _LIMIT, _DEGRADED, _GONE),
    Fault("OVERHEAT", "> 85 C", _WARN, _DEGRADED, _GONE),
    Fault("CPU_HIGH", "> 95 % for 10 s", _WARN, _DEGRADED, _GONE),
    Fault("MEMORY_HIGH", "> 95 %", _WARN, _DEGRADED, _GONE),
    Fault("DISK_FULL", "> 95 %", _WARN, _DEGRADED, _GONE),
    Fault("EHMI_LINK_LOST", "no acknowledge for 5 s", _WARN, _DEGRADED, _GONE),
    Fault("UI_LINK_LOST", "no heartbeat of the UI for 5 s", _WARN, _DEGRADED, _GONE),
)

BY_CODE: dict[str, Fault] = {fault.code: fault for fault in FAULTS}

# Reasons of a speed limit that are not faults.
PASSENGER_ONBOARD = "PASSENGER_ONBOARD"
UNDOCKING = "UNDOCKING"  # the latch is open, and the docking controller backs off from the wheelchair
DOCKING = "DOCKING"  # the robot moves into a dock, whose parts do not count as obstacles
WAY_UNSEEN = "WAY_UNSEEN"  # the motion leads into an area that is neither observed nor in the memory
SIGHT_STALE = "SIGHT_STALE"  # the newest obstacle points are old, OBSTACLES_TIMEOUT is not raised yet


def join_codes(codes: Iterable[str]) -> str:
    """``VelocityLimit.reason`` of these codes; ``split_codes`` reads it."""
    return ",".join(codes)


def split_codes(reason: str) -> tuple[str, ...]:
    """The codes of ``VelocityLimit.reason``. A space or another separator makes an unknown code."""
    return tuple(reason.split(",")) if reason else ()


def stops_gently(codes: Collection[str]) -> bool:
    """True if every code of a limit is a row with a gentle stop.

    Without a code, or with one that is not in the list, the stop is hard.
    """
    return bool(codes) and all(code in BY_CODE and BY_CODE[code].gentle for code in codes)
