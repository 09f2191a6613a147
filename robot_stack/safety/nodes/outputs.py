"""Outputs of the safety monitor: its verdict, the speed limit, and the log of changes."""

from __future__ import annotations

from collections.abc import Mapping

from custom_msgs.msg import SafetyStatus, VelocityLimit
from robot_stack.contract import frames, topics
from robot_stack.contract.faults import join_codes
from robot_stack.core.limits import SafetyLimit
from robot_stack.middleware.node import StackNode
from robot_stack.safety.arbiter import Verdict


class SafetyOutputs:
    """Publishers of the node ``safety_monitor``."""

    def __init__(self, node: StackNode) -> None:
        self._node = node
        self._status = node.advertise(topics.SAFETY_STATUS)
        self._limit = node.advertise(topics.VELOCITY_LIMIT)

    def status(self, verdict: Verdict, nearest_obstacle_m: float, button_pressed: bool) -> None:
        message = SafetyStatus(
            safety_state=verdict.state.name,
            active_faults=list(verdict.faults),
            min_obstacle_distance=nearest_obstacle_m,
            emergency_stop_active=button_pressed,
        )
        message.header.stamp, message.header.frame_id = self._node.stamp(), frames.BASE_LINK
        self._status.publish(message)

    def log_changes(self, before: Verdict | None, verdict: Verdict, details: Mapping[str, str]) -> None:
        """Logs every raised and cleared fault. details: by fault."""
        logger, known = self._node.get_logger(), set(before.faults if before else ())
        for code in verdict.faults:
            if code not in known:
                logger.warning(f"{code}: {details[code]}")
        for code in known.difference(verdict.faults):
            logger.info(f"{code}: cleared")

    def limit(self, limit: SafetyLimit) -> None:
        message = VelocityLimit(
            max_linear_velocity=limit.linear_mps,
            max_angular_velocity=limit.angular_radps,
            reason=join_codes(limit.codes),
        )
        message.header.stamp, message.header.frame_id = self._node.stamp(), frames.BASE_LINK
        self._limit.publish(message)
