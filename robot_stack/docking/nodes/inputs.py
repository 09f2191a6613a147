"""Inputs of the docking controller, as the situation of its kernel."""

from __future__ import annotations

import math

from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState

from custom_msgs.msg import ArucoDetectionArray, VelocityLimit
from robot_stack.contract import topics
from robot_stack.core.geometry import Pose2, Twist2, exp_se2
from robot_stack.docking.controller import DockingController
from robot_stack.docking.latch import LatchInputs
from robot_stack.docking.nodes.messages import markers, safety, wheel_force
from robot_stack.docking.params import DockingParams
from robot_stack.docking.situation import Situation
from robot_stack.middleware.conversions import pose_from_msg, time_to_s, twist_from_msg
from robot_stack.middleware.node import StackNode

# The charger of a full battery gives no current.
_CHARGING = (BatteryState.POWER_SUPPLY_STATUS_CHARGING, BatteryState.POWER_SUPPLY_STATUS_FULL)


class DockingInputs:
    """Subscriptions of the node ``docking_controller``. Odometry and markers go to the kernel at once."""

    def __init__(self, node: StackNode, params: DockingParams, controller: DockingController) -> None:
        self._node, self._params, self._controller = node, params, controller
        self._odom = node.subscribe(topics.ODOM, self._on_odometry)
        self._pose = node.subscribe(topics.CURRENT_POSE)
        self._detections = node.subscribe(topics.ARUCO_DETECTIONS, self._on_detections)
        self._joints = node.subscribe(topics.JOINT_STATES)
        self._limit = node.subscribe(topics.VELOCITY_LIMIT)
        self._battery = node.subscribe(topics.BATTERY_STATE)

    def _on_odometry(self, message: Odometry) -> None:
        pose, stamp_s = pose_from_msg(message.pose.pose), time_to_s(message.header.stamp)
        if pose.is_finite() and twist_from_msg(message.twist.twist).is_finite():
            self._controller.on_odometry(stamp_s, pose)
        else:
            self._node.get_logger().error("/odom refused: it is not finite", throttle_duration_sec=1.0)

    def _on_detections(self, message: ArucoDetectionArray) -> None:
        self._controller.on_markers(markers(message))

    def situation(self, latch: LatchInputs, *, navigation_served: bool) -> Situation:
        node, now_s = self._node, self._node.now_s()
        odom, twist = self._odometry(now_s)
        limit = self._limit.latest
        pose = pose_from_msg(self._pose.latest.pose) if self._pose.fresh() else None
        images_s = 0.0 if self._detections.latest is None else time_to_s(self._detections.latest.header.stamp)
        return Situation(
            now_s=now_s,
            located=pose if pose is not None and pose.is_finite() else None,
            odom=odom,
            twist=twist,
            safety=safety(
                node.safety_status_input.latest,
                node.safety_status_input.fresh(),
                node.emergency_stop,
                _speed_limit_mps(limit, self._limit.fresh()),
            ),
            images_fresh=self._detections.fresh() and abs(now_s - images_s) <= self._params.detections_timeout_s,
            latch=latch,
            force_n=wheel_force(self._joints.latest if self._joints.fresh() else None, node.robot.wheel_radius_m),
            navigation_served=navigation_served,
            charging=self._battery.fresh() and self._battery.latest.power_supply_status in _CHARGING,
        )

    def _odometry(self, now_s: float) -> tuple[Pose2 | None, Twist2 | None]:
        """(base_link in odom now, its twist), (None, None) while /odom is stale."""
        message = self._odom.latest
        if message is None or not self._odom.fresh():
            return None, None
        pose, twist = pose_from_msg(message.pose.pose), twist_from_msg(message.twist.twist)
        if not (pose.is_finite() and twist.is_finite()):
            return None, None
        ahead_s = min(max(now_s - time_to_s(message.header.stamp), 0.0), self._params.motion.max_extrapolation_s)
        return pose.compose(exp_se2(twist, ahead_s)), twist


def _speed_limit_mps(message: VelocityLimit | None, fresh: bool) -> float:
    """A stale speed limit is a stop."""
    if message is None:
        return math.inf
    return float(message.max_linear_velocity) if fresh else 0.0
