"""Conversions between the messages of docking and the values of its kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from custom_msgs.action import Dock, Undock
from custom_msgs.msg import ArucoDetection, ArucoDetectionArray, DockingStatus, SafetyStatus
from robot_stack.contract import frames
from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.docking.contact import push_n
from robot_stack.docking.results import Result
from robot_stack.docking.sighting import Marker
from robot_stack.docking.situation import Output, Safety
from robot_stack.middleware.conversions import time_to_s

# A speed limit below this is a stop, as in navigation.
_STOP_BELOW_MPS = 0.02


def markers(message: ArucoDetectionArray) -> list[Marker]:
    return [_marker(item) for item in message.detections]


def _marker(message: ArucoDetection) -> Marker:
    p, q = message.pose.position, message.pose.orientation
    pose = np.eye(4)
    pose[:3, :3] = _rotation(q.x, q.y, q.z, q.w)
    pose[:3, 3] = p.x, p.y, p.z
    stamp_s = time_to_s(message.header.stamp)
    return Marker(stamp_s, message.camera_frame, message.marker_id, pose, message.quality_score)


def _rotation(x: float, y: float, z: float, w: float) -> NDArray[np.float64]:
    """(3, 3) rotation of a unit quaternion; of any other something that is no rotation, which the kernel refuses."""
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def wheel_force(message: JointState | None, wheel_radius_m: float) -> float:
    """Force of the four wheels along base_link's x, N; NaN if the message lacks the values."""
    if message is None or len(message.effort) != len(message.name) or len(message.position) != len(message.name):
        return math.nan
    index = {name: i for i, name in enumerate(message.name)}
    if not index.keys() >= set(frames.JOINTS):
        return math.nan
    torques_nm = [message.effort[index[f"{module}_drive"]] for module in frames.MODULES]
    headings_rad = [message.position[index[f"{module}_steer"]] for module in frames.MODULES]
    return push_n(torques_nm, headings_rad, wheel_radius_m)


def safety(message: SafetyStatus | None, fresh: bool, emergency: bool, speed_limit_mps: float) -> Safety:
    """emergency: by the two-key rule, which is active before the status shows a stop."""
    if message is None:
        return Safety(emergency=emergency)
    faults: Sequence[str] = message.active_faults
    # A row's action is its most severe; the speed limit shows whether it stops now.
    stops = speed_limit_mps < _STOP_BELOW_MPS
    emergency = emergency or message.safety_state == SafetyState.EMERGENCY_STOP.name
    emergency = emergency or any(
        BY_CODE[code].action is SafetyAction.EMERGENCY_STOP for code in faults if code in BY_CODE
    )
    return Safety(known=fresh, emergency=emergency, stopped=stops, faults=tuple(faults))


def status(output: Output, visible_markers: int, stamp: Time) -> DockingStatus:
    message = DockingStatus(
        state=output.state.value,
        position_error=output.position_error_m,
        orientation_error=output.yaw_error_rad,
        visible_markers_count=visible_markers,
        convergence_progress=output.progress,
    )
    message.header.stamp, message.header.frame_id = stamp, frames.BASE_LINK
    return message


def dock_result(result: Result) -> Dock.Result:
    return Dock.Result(
        success=result.success,
        error_code=int(result.code),
        reason=result.reason,
        position_error=result.position_error_m,
        orientation_error=result.yaw_error_rad,
        tries=result.tries,
    )


def undock_result(result: Result) -> Undock.Result:
    return Undock.Result(
        success=result.success, error_code=int(result.code), reason=result.reason, distance=result.distance_m
    )


def dock_feedback(output: Output) -> Dock.Feedback:
    return Dock.Feedback(
        state=output.state.value,
        position_error=output.position_error_m,
        orientation_error=output.yaw_error_rad,
        convergence_progress=output.progress,
        tries=output.tries,
    )


def undock_feedback(output: Output) -> Undock.Feedback:
    moved = output.distance_m > 0.0
    state = Undock.Feedback.BACKING_OFF if moved else Undock.Feedback.UNLATCHING
    if output.result is not None and output.result.success:
        state = Undock.Feedback.CLEAR
    return Undock.Feedback(state=state, distance=output.distance_m)
