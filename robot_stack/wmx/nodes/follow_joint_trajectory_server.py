"""follow_joint_trajectory_server: trajectories of the arm as splines of the motion engine, and its gripper."""

from __future__ import annotations

from std_srvs.srv import SetBool

from robot_stack.contract import services
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.node import StackNode
from robot_stack.wmx import connect
from robot_stack.wmx.api import CoreMotionErrorCode
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.device_opener import ThreadedOpener
from robot_stack.wmx.nodes.trajectory_action import Job, TrajectoryAction
from robot_stack.wmx.nodes.trajectory_messages import feedback_to_msg, goal_from_msg
from robot_stack.wmx.session import EngineSession
from robot_stack.wmx.trajectory.engine_arm import EngineArm
from robot_stack.wmx.trajectory.goal import check_goal
from robot_stack.wmx.trajectory.goal_queue import GoalQueue
from robot_stack.wmx.trajectory.params import TrajectoryServerParams, goal_limits
from robot_stack.wmx.trajectory.results import Fault, GoalCode, GoalRefused, Result, aborted
from robot_stack.wmx.trajectory.settings import execution_settings

_NAME = "follow_joint_trajectory_server"
_EMERGENCY = Fault(CoreMotionErrorCode.EmergencyStopSignalOn, "emergency stop")
_SHUTDOWN = Fault(GoalCode.INVALID_GOAL, "the trajectory server ends")
_LAST_ANSWER_S = 0.05  # an answer passes through three successive tasks of the executor


class FollowJointTrajectoryServerNode(StackNode):
    """A goal starts in its callback; one tick monitors the motion. No call blocks."""

    def __init__(self) -> None:
        super().__init__(_NAME, TrajectoryServerParams)
        client = load_client_config()
        self._limits = goal_limits(self.params)
        patience = self.params.link.patience()
        session = EngineSession(
            lambda: connect(_NAME, client, timeout_s=0.0),
            patience,
            opener=lambda open_engine: self.device(ThreadedOpener, open_engine),
        )
        self._arm = EngineArm(session, self.params.joint_number, self.params.spline.max_points)
        self._goals: GoalQueue[Job] = GoalQueue(self._arm, execution_settings(self.params), self._end)
        self._feedback_s = 0.0
        self._leaving = False
        self._action = TrajectoryAction(self, self.params.joint_trajectory_action, self._begin, self._cancel)
        self.serve(services.SET_GRIPPER, self._set_gripper, self.params.wmx_gripper_topic)
        self.every(self.params.poll_rate_hz, self._tick)

    # --- goals -------------------------------------------------------------------------------------------------------

    def _begin(self, job: Job) -> None:
        try:
            goal = check_goal(goal_from_msg(job.goal.request), self._limits, self.now_s())
        except GoalRefused as refusal:
            self._end(job, aborted(refusal.fault))
            return
        if self.emergency_stop or self._leaving:
            self._end(job, aborted(_SHUTDOWN if self._leaving else _EMERGENCY))
            return
        job.order = goal.order
        self._goals.submit(job, goal, self.steady_s(), self._arm.read())

    def _cancel(self, job: Job) -> None:
        self._goals.cancel(job, self.steady_s())

    def _end(self, job: Job, result: Result) -> None:
        text = f"trajectory {result.outcome.value}: error code {result.code} {result.text}".rstrip()
        self.get_logger().warning(text) if result.outcome is GoalStatus.ABORTED else self.get_logger().info(text)
        job.end(result)

    def on_emergency_stop(self) -> None:
        self._goals.stop_all(_EMERGENCY, self.steady_s())

    # --- tick --------------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        now_s = self.steady_s()
        missing = self._arm.poll(now_s)
        if self.emergency_stop:
            self._goals.stop_all(_EMERGENCY, now_s)
        self._action.look_for_cancellations()
        active = self._goals.active
        if active is not None:
            self._goals.tick(now_s, self._arm.read())
            self._report(now_s)
        phase = active[1].phase.value if active is not None else "no trajectory"
        self.report.values = {"goal": phase}
        self.set_health(not missing, missing or ("emergency stop" if self.emergency_stop else "ready"))

    def _report(self, now_s: float) -> None:
        """Publishes feedback of the active goal at its rate."""
        if self._goals.active is None:
            return
        job, execution = self._goals.active
        if execution.sample is None:
            return
        if 0.0 <= now_s - self._feedback_s < 1.0 / self.params.feedback_rate_hz - 0.5 / self.params.poll_rate_hz:
            return
        self._feedback_s = now_s
        job.publish_feedback(feedback_to_msg(execution.sample, self.params.joints, job.order, self.stamp()))

    # --- gripper -----------------------------------------------------------------------------------------------------

    def _set_gripper(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        """Refused during an emergency stop, because the gripper is a motion too."""
        fault: Fault | None = _EMERGENCY
        if not self.emergency_stop:
            byte, bit = self.params.gripper_output_byte, self.params.gripper_output_bit
            fault = self._arm.set_output(byte, bit, int(request.data))
        verb = "close" if request.data else "open"
        response.success = fault is None
        if fault is None:
            response.message = f"Gripper {'closed' if request.data else 'opened'} successfully"
        else:
            response.message = f"Failed to {verb} gripper"
            self.get_logger().error(f"{response.message}: {fault.text}")
        return response

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        """Stops the arm, answers its goals and closes the device."""
        self._leaving = True
        watch = self.params.watch
        try:
            self._goals.stop_all(_SHUTDOWN, self.steady_s())
            timeout_s = watch.stop_timeout_s + watch.quick_stop_timeout_s
            self.port.wait_until(lambda: not self._action.busy, timeout_s, loop=True)
            self.port.wait_until(lambda: False, _LAST_ANSWER_S, loop=True)
        finally:
            self._arm.close()
