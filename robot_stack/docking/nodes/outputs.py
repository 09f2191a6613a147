"""Outputs of the docking controller: motion, goals, status, the passenger, and the external display."""

from __future__ import annotations

from std_msgs.msg import Bool

from custom_msgs.msg import EHMIState, LatchStatus
from robot_stack.contract import frames, topics
from robot_stack.contract.states import DockingState
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.docking.nodes.messages import status
from robot_stack.docking.params import DockingParams
from robot_stack.docking.situation import Output
from robot_stack.middleware.conversions import pose_stamped, twist_stamped
from robot_stack.middleware.navigation_client import NavigationClient
from robot_stack.middleware.node import StackNode

_DISPLAYS = {
    DockingState.APPROACH: EHMIState.APPROACHING_CHAIR,
    DockingState.SEARCH: EHMIState.DOCKING,
    DockingState.SERVOING: EHMIState.DOCKING,
    DockingState.FINE_ALIGN: EHMIState.DOCKING,
    DockingState.DOCKED: EHMIState.DOCKING_COMPLETE,
    DockingState.FAILED: EHMIState.DOCKING_FAILED,
}


class DockingOutputs:
    """Publishers of the node ``docking_controller``, with their last messages, and its goals."""

    def __init__(self, node: StackNode, params: DockingParams, navigation: NavigationClient) -> None:
        self._node, self._params, self._navigation = node, params, navigation
        self._status = node.advertise(topics.DOCKING_STATUS)
        self._cmd_vel = node.advertise(topics.DOCKING_CMD_VEL)
        self._target = node.advertise(topics.DOCKING_TARGET)
        self._latch = node.advertise(topics.LATCH_STATUS)
        self._passenger = node.advertise(topics.PASSENGER_ATTACHED)
        self._stop = node.emergency_stop_source(until_latched=True)
        self._ehmi = node.advertise(topics.EHMI_STATE_COMMAND)
        self._owns_motion = self._asserted = False
        self._attached: bool | None = None
        self._latch_state: tuple[bool, bool, bool] | None = None
        self._shown: int | None = None

    def act(self, output: Output) -> None:
        """Executes urgent outputs: motion, goal, passenger, stop."""
        if output.twist is not None or self._owns_motion:  # and one last zero when docking gives the motion up
            self.command(output.twist or ZERO_TWIST)
        self._owns_motion = output.twist is not None
        if output.goal is not None:
            self._navigation.send(output.goal)
        elif output.cancel_goal:
            self._navigation.cancel()
        if output.attached is not None and output.attached != self._attached:
            self._attached = output.attached
            self._passenger.publish(Bool(data=output.attached))
        if output.emergency:
            self._node.get_logger().error(f"emergency stop: {output.text}")
            self._asserted = True
            self._stop.publish(True)

    def publish_status(self, output: Output, visible_markers: int) -> None:
        """/docking/status, and the external display without a mission manager, so that the display has one source."""
        stamp = self._node.stamp()
        self._status.publish(status(output, visible_markers, stamp))
        display = _DISPLAYS.get(output.state)
        if display is None or display == self._shown:
            return
        self._shown = display
        if not self._node.count_publishers(topics.MISSION_STATUS.name):
            message = EHMIState(state_num=display, language=self._params.language, volume=self._params.ehmi_volume)
            message.header.stamp = stamp
            self._ehmi.publish(message)

    def latch(self, closed: bool, attached: bool, undocking: bool, *, due: bool) -> None:
        """Publishes /docking/latch, if it is due or has changed."""
        state = (closed, attached, undocking)
        if not due and state == self._latch_state:
            return
        self._latch_state = state
        message = LatchStatus(closed=closed, attached=attached, undocking=undocking)
        message.header.stamp, message.header.frame_id = self._node.stamp(), frames.BASE_LINK
        self._latch.publish(message)

    def publish_target(self, pose: Pose2 | None) -> None:
        """See ``DockingController.target``."""
        if pose is not None:
            self._target.publish(pose_stamped(pose, frames.BASE_LINK, self._node.stamp()))

    def command(self, twist: Twist2) -> None:
        self._cmd_vel.publish(twist_stamped(twist, frames.BASE_LINK, self._node.stamp()))

    def stand(self) -> None:
        """Publishes zero at once, if docking owns the motion."""
        if self._owns_motion:
            self.command(ZERO_TWIST)

    def released(self) -> None:
        """Both keys are released: clears our latched message, which would stop a node that starts later."""
        if self._asserted:
            self._asserted = False
            self._stop.publish(False)
