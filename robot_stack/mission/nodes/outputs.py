"""Outputs of the mission manager: goals, dockings, the emergency stop, its status, the external display."""

from __future__ import annotations

from geometry_msgs.msg import PoseStamped

from custom_msgs.msg import EHMIState, MissionStatus, VelocityLimit
from robot_stack.contract import frames, topics
from robot_stack.core.goals import SendGoal
from robot_stack.core.limits import NO_LIMIT, SpeedLimit
from robot_stack.core.mission import Kind
from robot_stack.middleware.motion_warning import MotionWarnings
from robot_stack.middleware.navigation_client import NavigationClient
from robot_stack.middleware.node import StackNode
from robot_stack.mission.display import usable_language
from robot_stack.mission.events import Status
from robot_stack.mission.nodes.docking_client import DockingClient
from robot_stack.mission.nodes.queue_messages import report_message
from robot_stack.mission.orders import QueueReport
from robot_stack.mission.params import MissionParams


class MissionOutputs:
    """Publishers of the node ``mission_manager``, and its goals: the kernel's ``perform.Outputs``."""

    def __init__(
        self,
        node: StackNode,
        params: MissionParams,
        navigation: NavigationClient,
        docking: DockingClient,
        motion_warnings: MotionWarnings,
    ) -> None:
        self._node, self._params, self._navigation = node, params, navigation
        self._docking, self._motion_warnings = docking, motion_warnings
        self._status = node.advertise(topics.MISSION_STATUS)
        self._queue = node.advertise(topics.MISSION_QUEUE)
        self._goal = node.advertise(topics.GOAL_POSE)
        self._limit = node.advertise(topics.MISSION_VELOCITY_LIMIT)
        self._stop = node.emergency_stop_source(until_latched=True)
        self._ehmi = node.advertise(topics.EHMI_STATE_COMMAND)
        self._language: str = params.language
        self._displays = 0
        self._display: int | None = None
        self.reason = ""

    def send_goal(self, goal: SendGoal) -> None:
        self._publish_limit(goal.limit)
        self._navigation.send(goal)

    def cancel_goal(self, everything: bool) -> None:
        """Afterwards the limit does not hold for goals of others."""
        self._publish_limit(NO_LIMIT)
        if not everything:
            self._navigation.cancel()
            return
        self._navigation.cancel_everything()
        message = PoseStamped()  # an empty frame ends also a goal that was given on /goal_pose
        message.header.stamp = self._node.stamp()
        self._goal.publish(message)

    def _publish_limit(self, limit: SpeedLimit) -> None:
        message = VelocityLimit(max_linear_velocity=limit.linear_mps, max_angular_velocity=limit.angular_radps)
        message.header.stamp, message.header.frame_id = self._node.stamp(), frames.BASE_LINK
        self._limit.publish(message)

    def start_docking(self, call: int, kind: Kind, dock_id: str) -> None:
        self._docking.start(call, kind, dock_id)

    def cancel_docking(self, everything: bool) -> None:
        if everything:
            self._docking.cancel_everything()
        else:
            self._docking.cancel()

    def publish_emergency_stop(self, active: bool) -> None:
        self._stop.publish(active)

    def warn_of_departure(self, remaining_s: float) -> None:
        self._motion_warnings.publish(remaining_s)

    def publish_status(self, status: Status) -> None:
        message = MissionStatus(
            state=status.state,
            mission_id=status.mission.id if status.mission else "",
            mission_name=status.mission.name_in(self._language) if status.mission else "",
            current_waypoint=status.current_waypoint,
            waypoints_completed=status.waypoints_completed,
            total_waypoints=status.total_waypoints,
            progress=status.progress,
            eta_s=status.eta_s,
            passenger_attached=status.passenger_attached,
            reason=status.reason,
            last_command=status.last_command,
            last_command_accepted=status.last_command_accepted,
        )
        message.header.stamp, message.header.frame_id = self._node.stamp(), frames.MAP
        self._status.publish(message)
        self.reason = status.reason
        if status.display != self._display:
            self.show(status.display)

    def publish_queue(self, report: QueueReport) -> None:
        self._queue.publish(report_message(report, self._node.stamp()))

    def set_language(self, requested: str) -> None:
        """Of the external display, at once, and of mission names. An unknown one is ignored."""
        before, self._language = self._language, usable_language(requested, self._language)
        if self._language != before and self._display is not None:
            self.show(self._display)

    def show(self, display: int) -> None:
        """On the external display."""
        self._display = display
        message = EHMIState(state_num=display, language=self._language, volume=self._params.ehmi_volume)
        message.header.stamp = self._node.stamp()
        self._ehmi.publish(message)

    def show_newcomers(self) -> None:
        """Sends the state to a new display, because it is not latched."""
        before, self._displays = self._displays, self._ehmi.get_subscription_count()
        if self._displays > before and self._display is not None:
            self.show(self._display)
