"""Publishers of the touch screen. ``stop`` and ``drive`` may be called from any thread and do not block."""

from __future__ import annotations

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Header, String

from custom_msgs.msg import UICommand
from robot_stack.contract import frames, topics
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.middleware.conversions import initial_pose, pose_stamped, twist_stamped
from robot_stack.middleware.node import StackNode

# Deviations of a pose dragged by finger: half a metre and 15 degrees, as in RViz's tool.
_POSITION_M, _YAW_RAD = 0.5, 0.2618


class Outputs:
    def __init__(self, node: StackNode) -> None:
        self._node = node
        self._stop = node.emergency_stop_source()
        self._command = node.advertise(topics.UI_COMMAND)
        self._language = node.advertise(topics.UI_LANGUAGE)
        self._teleop = node.advertise(topics.TELEOP_CMD_VEL)
        self._pose = node.advertise(topics.INITIAL_POSE)
        self._goal = node.advertise(topics.GOAL_POSE)
        self._heartbeat = node.advertise(topics.UI_HEARTBEAT)

    def stop(self) -> None:
        """Publishes the stop, and a command to the mission manager, which records the cause for its mission."""
        self._stop.publish(True)
        self.command(UICommand.EMERGENCY_STOP)

    def ask_release(self) -> None:
        """A request: other pressed sources stay pressed, and only the safety monitor grants it."""
        self._stop.publish(False)

    def drive(self, twist: Twist2) -> None:
        self._teleop.publish(twist_stamped(twist, frames.BASE_LINK, self._node.stamp()))

    def command(self, command_type: str, mission_id: str = "") -> None:
        message = UICommand(command_type=command_type, mission_id=mission_id)
        message.header.stamp = self._node.stamp()
        self._command.publish(message)

    def set_language(self, code: str) -> None:
        self._language.publish(String(data=code))

    def set_pose(self, pose: Pose2) -> None:
        self._pose.publish(initial_pose(pose, frames.MAP, self._node.stamp(), _POSITION_M, _YAW_RAD))

    def go(self, pose: Pose2) -> None:
        self._goal.publish(pose_stamped(pose, frames.MAP, self._node.stamp()))

    def cancel_goal(self) -> None:
        message = PoseStamped()  # an empty frame cancels
        message.header.stamp = self._node.stamp()
        self._goal.publish(message)

    def beat(self) -> None:
        self._heartbeat.publish(Header(stamp=self._node.stamp()))
