"""swerve_controller: velocity commands and joint states to wheel commands, odometry and the robot's transforms.

Publishes the robot's description, whose frames these are.
"""

from __future__ import annotations

import math

from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from custom_msgs.msg import VelocityLimit
from robot_stack.contract import frames, services, topics
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot_description import robot_description
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.drive.arbitration import Arbiter, Source
from robot_stack.drive.controller import SwerveController
from robot_stack.drive.joint_states import BadJointStates, encoders
from robot_stack.drive.nodes.conversions import DriveTransforms, odometry_message, speed_limit, wheel_commands
from robot_stack.drive.params import SwerveControllerParams
from robot_stack.drive.permission import Permission, Situation, permit
from robot_stack.drive.swerve_drive import DriveOutput
from robot_stack.middleware.conversions import time_to_s, twist_from_msg, twist_stamped
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wheelchair import WheelchairInput

_PERIOD_S = 1.0 / topics.WHEEL_COMMANDS.nominal_rate_hz


class SwerveControllerNode(StackNode):
    """Stores inputs; one tick decides and commands. Odometry runs with every joint state."""

    def __init__(self) -> None:
        super().__init__("swerve_controller", SwerveControllerParams)
        self._controller = SwerveController(self.params, self.robot)
        self._arbiter = Arbiter()
        self._motion_limits = MotionLimits.of(self.robot.empty), MotionLimits.of(self.robot.with_passenger)
        self._encoders_at_s = -math.inf
        self._commands = self.advertise(topics.WHEEL_COMMANDS)
        self._limited = self.advertise(topics.CMD_VEL_LIMITED)
        self._odom = self.advertise(topics.ODOM)
        self._tf, self._transforms = self.advertise(topics.TF), DriveTransforms(self.robot)
        self._description = self.advertise(topics.ROBOT_DESCRIPTION)
        self._description.publish(String(data=robot_description(self.robot, load_robot_shape())))
        self._joint_states = self.subscribe(topics.JOINT_STATES, self._on_joint_states)
        self.subscribe(topics.CMD_VEL, self._on_cmd_vel)
        self.subscribe(topics.DOCKING_CMD_VEL, lambda message: self._on_stamped(Source.DOCKING, message))
        self.subscribe(topics.TELEOP_CMD_VEL, lambda message: self._on_stamped(Source.TELEOP, message))
        self._wheelchair = WheelchairInput(self, assumed=self.params.assume_passenger)
        self._limit = self.subscribe(topics.VELOCITY_LIMIT, self._on_limit)
        self.serve(services.RESET_ODOMETRY, self._on_reset_odometry)
        self.set_health(False, f"waiting for {topics.JOINT_STATES.name}")
        self.every(topics.WHEEL_COMMANDS.nominal_rate_hz, self._tick)

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_cmd_vel(self, message: Twist) -> None:
        self._on_command(Source.NAVIGATION, message)

    def _on_stamped(self, source: Source, message: TwistStamped) -> None:
        stamp_s = time_to_s(message.header.stamp)
        self._on_command(source, message.twist, self.now_s() - stamp_s if stamp_s else 0.0)

    def _on_command(self, source: Source, message: Twist, sent_ago_s: float = 0.0) -> None:
        refusal = self._arbiter.command(source, twist_from_msg(message), self.steady_s(), sent_ago_s)
        if refusal:
            self.log_throttled(refusal)

    def _on_joint_states(self, message: JointState) -> None:
        try:
            stamp_s, received_s = time_to_s(message.header.stamp), self._joint_states.received_s
            measured = encoders(stamp_s, message.name, message.position, received_s)
        except BadJointStates as error:  # counts as silence
            self.log_throttled(f"{topics.JOINT_STATES.name} refused: {error}")
            return
        self._encoders_at_s = self.steady_s()
        odometry = self._controller.observe(measured)
        for fault in odometry.faults:
            self.log_throttled(fault)
        self._odom.publish(odometry_message(odometry, message.header.stamp))
        self._tf.publish(self._transforms.message(odometry, measured, message.header.stamp))

    def _on_reset_odometry(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._controller.reset_odometry()
        response.message = "odom starts here" if response.success else "refused: the robot is moving"
        return response

    # --- commands ----------------------------------------------------------------------------------------------------

    def on_emergency_stop(self) -> None:
        self._arbiter.stopped()
        self._publish_commands(self._controller.halt(self.steady_s()))

    def _on_limit(self, _: VelocityLimit) -> None:
        """A hard stop does not wait for the tick: at 1.0 m/s that would be up to 0.05 m."""
        now_s = self.steady_s()
        output = self._controller.begin_braking(self._permission(now_s), _PERIOD_S, now_s)
        if output is not None:
            self._publish_commands(output)

    def safe_output(self) -> None:
        self._publish_commands(self._controller.halt(self.steady_s()))

    def _tick(self) -> None:
        now_s = self.steady_s()
        permission = self._permission(now_s)
        output = self._controller.carry_out(permission, now_s)
        self._publish_commands(output)
        self._report_state(permission, output)

    def _permission(self, now_s: float) -> Permission:
        if self.emergency_stop:
            self._arbiter.stopped()
        else:
            self._arbiter.released(now_s)
        holder, requested = self._arbiter.requested(now_s)
        situation = Situation(
            emergency_stop=self.emergency_stop,
            joint_states_fresh=0.0 <= now_s - self._encoders_at_s <= topics.JOINT_STATES.stale_limit_s,
            safety_status_fresh=self.safety_status_input.fresh(),
            speed_limit=speed_limit(self._limit.latest),
            speed_limit_fresh=self._limit.fresh(),
            passenger=self._wheelchair.attached,
            holder=holder,
            requested=requested,
            must_rest=self._arbiter.must_rest(holder),
        )
        return permit(situation, *self._motion_limits)

    # --- outputs -----------------------------------------------------------------------------------------------------

    def _publish_commands(self, output: DriveOutput) -> None:
        stamp = self.stamp()
        self._limited.publish(twist_stamped(output.twist, frames.BASE_LINK, stamp))
        # Without measured module headings, any commanded angle would turn the modules.
        if self._controller.measured_rad is not None:
            self._commands.publish(wheel_commands(output.modules, stamp))

    def _report_state(self, permission: Permission, output: DriveOutput) -> None:
        stuck = ", ".join(f"{frames.MODULES[module]}_steer" for module in output.stuck)
        if stuck:
            self.set_health(False, f"cannot start: {stuck} does not reach its angle")
        else:
            self.set_health(permission.ready, permission.reason)
        self.report.values = self._controller.figures(output)
