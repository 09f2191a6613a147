"""Values from messages: any objects with the fields of the ROS type."""

from __future__ import annotations

from typing import Any

from robot_stack.contract.model import SafetyState
from robot_stack.docking.tools.trace import Effort, Lens, Limit, Marker, Safety, Speed, Status


def stamp_s(header: Any) -> float:
    return float(header.stamp.sec) + 1e-9 * float(header.stamp.nanosec)


def status_of(at_s: float, message: Any) -> Status:
    return Status(
        at_s,
        str(message.state),
        float(message.position_error),
        float(message.orientation_error),
        int(message.visible_markers_count),
        float(message.convergence_progress),
    )


def marker_of(at_s: float, detection: Any) -> Marker:
    p, q = detection.pose.position, detection.pose.orientation
    return Marker(
        at_s,
        stamp_s(detection.header),
        str(detection.camera_frame),
        int(detection.marker_id),
        float(detection.quality_score),
        (float(p.x), float(p.y), float(p.z)),
        (float(q.x), float(q.y), float(q.z), float(q.w)),
    )


def safety_of(at_s: float, message: Any) -> Safety:
    faults = tuple(str(code) for code in message.active_faults)
    state = str(message.safety_state)
    return Safety(at_s, state, faults, state == SafetyState.EMERGENCY_STOP.name)


def limit_of(at_s: float, message: Any) -> Limit:
    linear, angular = float(message.max_linear_velocity), float(message.max_angular_velocity)
    return Limit(at_s, linear, angular, str(message.reason))


def speed_of(at_s: float, twist: Any) -> Speed:
    return Speed(at_s, float(twist.linear.x), float(twist.linear.y), float(twist.angular.z))


def effort_of(at_s: float, message: Any) -> Effort | None:
    """None if the drives report no effort."""
    efforts = [abs(float(value)) for value in message.effort]
    return Effort(at_s, max(efforts)) if efforts else None


def lens_of(message: Any) -> Lens:
    return Lens(tuple(map(float, message.k)), tuple(map(float, message.d)))
