"""manipulator_state: starts the manipulator's joints and publishes their positions."""

from __future__ import annotations

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.config import config_dir
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.raw import RawSender
from robot_stack.wmx import connect
from robot_stack.wmx.axes import AxisFeedback
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.manipulator.bring_up import BringUp
from robot_stack.wmx.manipulator.joints import read
from robot_stack.wmx.manipulator.params import ManipulatorStateParams
from robot_stack.wmx.nodes.feedback_thread import FeedbackThread
from robot_stack.wmx.nodes.joint_outputs import JointOutputs
from robot_stack.wmx.start_up import SessionState

_REPORT_HZ = 10.0
_COMPLAIN_S = 5.0
_CONNECT_S = 0.3  # other nodes create devices at the same time; this thread can wait for them


class ManipulatorStateNode(StackNode):
    """The feedback thread does the work; the executor's tick reports on it."""

    def __init__(self) -> None:
        super().__init__("manipulator_state", ManipulatorStateParams)
        params: ManipulatorStateParams = self.params
        client = load_client_config()
        encoder, isaac, gazebo = params.topics
        self._outputs = JointOutputs(
            params.joint_name,
            self._sender(topics.WMX_JOINT_STATES, encoder),
            self._sender(topics.ISAAC_JOINT_COMMAND, isaac),
            self._sender(topics.GAZEBO_COMMANDS, gazebo),
            isaac_stamp=params.isaacsim_stamp,
        )
        self._skipped = 0
        self._bring_up = BringUp(
            lambda: connect("manipulator_state", client, _CONNECT_S),
            params,
            params.parameter_file(config_dir()),
            self.get_logger(),
        )
        self._feedback = self.device(
            FeedbackThread,
            self._bring_up,
            self._publish,
            lambda: self.emergency_stop,
            params.joint_feedback_rate,
            params.session.poll_s,
            params.end_timeout_s,
        )
        self.every(_REPORT_HZ, self._report)
        self._feedback.start()

    def _sender(self, row: Topic, name: str) -> RawSender | None:
        return self.device(RawSender, self.advertise(row, name)) if name else None

    # --- in the feedback thread --------------------------------------------------------------------------------------

    def _publish(self, feedback: AxisFeedback) -> str:
        values = read(feedback, self.params)
        if values is None:
            return "a joint's position or velocity is not finite"
        self._outputs.send(*values, self.now_ns())
        return ""

    # --- in the executor ---------------------------------------------------------------------------------------------

    def _report(self) -> None:
        self._outputs.look_around()
        feedback = self._feedback
        if feedback.failure:
            raise RuntimeError(f"the feedback thread has ended:\n{feedback.failure}")
        changes = self._bring_up.changes
        while changes:
            self._set_health(changes.popleft())
        state = self._bring_up.state
        if state.ready and feedback.snapshot is None:
            self.set_health(False, f"nothing published: {feedback.reason or 'no status yet'}")
        else:
            self._set_health(state)
        if feedback.skipped > self._skipped:
            text = f"nothing published {feedback.skipped - self._skipped} times: {feedback.reason}"
            self.get_logger().warning(text, throttle_duration_sec=_COMPLAIN_S)
        self._skipped = feedback.skipped
        self.report.values = {
            "engine": state.stage.value,
            "published": str(feedback.published),
            "skipped": str(feedback.skipped),
            "overruns": str(feedback.overruns),
            "latest tick": f"{feedback.worst_late_ns * 1e-6:.2f} ms",
        }

    def _set_health(self, state: SessionState) -> None:
        self.set_health(state.ready, state.text)

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        """Stops the joints, switches off the servos switched on here, and closes the device."""
        if self._feedback.end():
            self._outputs.close()
