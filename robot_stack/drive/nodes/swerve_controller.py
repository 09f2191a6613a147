"""swerve_controller: velocity commands and joint states to wheel commands, odometry and odom -> base_link."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from robot_stack.contract import frames, services, topics
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.drive.arbitration import Arbiter, Source
from robot_stack.drive.joint_states import BadJointStates, encoders
from robot_stack.drive.nodes.conversions import odom_to_base_link, odometry_message, speed_limit, wheel_commands
from robot_stack.drive.odometry import Encoders, Odometry, SwerveOdometry
from robot_stack.drive.parameters import (
    SwerveControllerParams,
    drive_settings,
    module_limits,
    module_positions,
    motion_limits,
    odometry_settings,
)
from robot_stack.drive.permission import Action, Permission, Situation, permit
from robot_stack.drive.swerve_drive import DriveOutput, SwerveDrive
from robot_stack.ros.conversions import time_to_s, twist_from_msg, twist_stamped
from robot_stack.ros.node import StackNode, run

assert topics.JOINT_STATES.stale_s is not None
assert topics.WHEEL_COMMANDS.rate_hz is not None
_JOINT_STATES_STALE_S = topics.JOINT_STATES.stale_s
_TICK_HZ = topics.WHEEL_COMMANDS.rate_hz
_LOG_PERIOD_S = 1.0


class SwerveController(StackNode):
    """Stores what arrives; one tick decides and commands. Odometry runs with every joint state."""

    def __init__(self) -> None:
        super().__init__("swerve_controller", SwerveControllerParams)
        positions = module_positions(self.robot)
        self._drive = SwerveDrive(
            positions, module_limits(self.params.module, self.robot), drive_settings(self.params.drive, self.robot)
        )
        self._arbiter = Arbiter(self.params.command_timeout_s)
        self._odometry = SwerveOdometry(positions, odometry_settings(self.params.odometry, self.robot))
        self._motion_limits = motion_limits(self.robot.empty), motion_limits(self.robot.with_passenger)
        self._encoders: Encoders | None = None
        self._encoders_at_s = self._ticked_at_s = self.steady_s()
        self._latest = Odometry()
        self._commands = self.advertise(topics.WHEEL_COMMANDS)
        self._limited = self.advertise(topics.CMD_VEL_LIMITED)
        self._odom = self.advertise(topics.ODOM)
        self._tf = self.advertise(topics.TF)
        self.subscribe(topics.JOINT_STATES, self._on_joint_states)
        self.subscribe(topics.CMD_VEL, self._on_cmd_vel)
        self.subscribe(topics.DOCKING_CMD_VEL, lambda message: self._on_stamped(Source.DOCKING, message))
        self.subscribe(topics.TELEOP_CMD_VEL, lambda message: self._on_stamped(Source.TELEOP, message))
        self._passenger = self.subscribe(topics.PASSENGER_ATTACHED)
        self._limit = self.subscribe(topics.VELOCITY_LIMIT)
        self.serve(services.RESET_ODOMETRY, self._on_reset_odometry)
        self.set_health(False, f"waiting for {topics.JOINT_STATES.name}")
        self.every(_TICK_HZ, self._tick)

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_cmd_vel(self, message: Twist) -> None:
        self._on_command(Source.NAVIGATION, message)

    def _on_stamped(self, source: Source, message: TwistStamped) -> None:
        stamp_s = time_to_s(message.header.stamp)
        age_s = self.now_s() - stamp_s
        if stamp_s and age_s > self.params.command_timeout_s:  # without a stamp the time of reception has to do
            self._complain(
                f"{source.name.lower()} command refused: {age_s:.2f} s old, at most {self.params.command_timeout_s} s"
            )
            return
        self._on_command(source, message.twist)

    def _on_command(self, source: Source, message: Twist) -> None:
        refusal = self._arbiter.command(source, twist_from_msg(message), self.steady_s())
        if refusal:
            self._complain(refusal)

    def _on_joint_states(self, message: JointState) -> None:
        try:
            self._encoders = encoders(time_to_s(message.header.stamp), message.name, message.position)
        except BadJointStates as error:  # counts as silence
            self._complain(f"{topics.JOINT_STATES.name} refused: {error}")
            return
        self._encoders_at_s = self.steady_s()
        self._latest = self._odometry.update(self._encoders)
        for fault in self._latest.faults:
            self._complain(fault)
        self._odom.publish(odometry_message(self._latest, message.header.stamp))
        self._tf.publish(odom_to_base_link(self._latest, message.header.stamp))

    def _on_reset_odometry(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self._standing() or self._drive.twist != ZERO_TWIST:
            response.success, response.message = False, "refused: the robot is moving"
            return response
        self._odometry.reset()
        self._latest = Odometry()
        response.success, response.message = True, "odom starts here"
        return response

    # --- commands ----------------------------------------------------------------------------------------------------

    def on_emergency_stop(self) -> None:
        self._publish_commands(self._drive.halt(self._measured()))

    def safe_output(self) -> None:
        self._publish_commands(self._drive.halt(self._measured()))

    def _tick(self) -> None:
        now_s = self.steady_s()
        elapsed_s, self._ticked_at_s = now_s - self._ticked_at_s, now_s
        permission = self._permission(now_s)
        output = self._step(permission, elapsed_s)
        self._publish_commands(output)
        self._tell(permission, output)

    def _permission(self, now_s: float) -> Permission:
        holder, wish = self._arbiter.wish(now_s)
        passenger = self._passenger.latest
        situation = Situation(
            emergency_stop=self.emergency_stop,
            joint_states_fresh=self._encoders is not None
            and 0.0 <= now_s - self._encoders_at_s <= _JOINT_STATES_STALE_S,
            safety_status_fresh=self.safety_status_input.fresh(),
            speed_limit=speed_limit(self._limit.latest),
            passenger=self.params.assume_passenger if passenger is None else passenger.data,
            holder=holder,
            wish=wish,
        )
        return permit(situation, *self._motion_limits)

    def _step(self, permission: Permission, elapsed_s: float) -> DriveOutput:
        if permission.action is Action.HALT:
            return self._drive.halt(self._measured())
        return self._drive.step(
            permission.wish,
            permission.limits,
            elapsed_s,
            self._measured(),
            standing=self._standing(),
            braking=permission.action is Action.BRAKE,
        )

    def _measured(self) -> Any:
        return None if self._encoders is None else self._encoders.steer_rad

    def _standing(self) -> bool:
        twist, limit = self._latest.twist, self.params.standing
        return twist.speed() <= limit.speed_mps and abs(twist.omega) <= limit.yaw_rate_radps

    # --- outputs -----------------------------------------------------------------------------------------------------

    def _publish_commands(self, output: DriveOutput) -> None:
        stamp = self.stamp()
        self._limited.publish(twist_stamped(output.twist, frames.BASE_LINK, stamp))
        if self._encoders is not None:  # else nobody knows where the modules point: any angle would turn them
            self._commands.publish(wheel_commands(output.modules, stamp))

    def _complain(self, text: str) -> None:
        self.get_logger().error(text, throttle_duration_sec=_LOG_PERIOD_S)

    def _tell(self, permission: Permission, output: DriveOutput) -> None:
        stuck = ", ".join(f"{frames.MODULES[module]}_steer" for module in output.stuck)
        if stuck:
            self.set_health(False, f"cannot start: {stuck} does not reach its angle")
        else:
            self.set_health(permission.ready, permission.reason)
        self.report.values = {
            "drive": output.state.value,
            "set point": f"{output.twist.vx:.3f} {output.twist.vy:.3f} m/s {output.twist.omega:.3f} rad/s",
            "wheels contradict": str(self._latest.slipping),
            "wheel radii": ", ".join(f"{100 * error:+.3f} %" for error in self._odometry.calibration.radius_errors),
            "steering zeros": ", ".join(f"{zero:+.5f} rad" for zero in self._odometry.calibration.zero_errors_rad),
        }


def main() -> None:
    run(SwerveController)


if __name__ == "__main__":
    main()
