"""swerve_hardware_interface: wheel commands to the motion engine, its encoders to joint states."""

from __future__ import annotations

import math
import time

from sensor_msgs.msg import JointState

from custom_msgs.msg import SwerveModuleCommandArray
from robot_stack.contract import frames, topics
from robot_stack.contract.frames import DRIVE_AXES, JOINTS, STEER_AXES
from robot_stack.drive.engine_session import EngineSession, SessionState, Stage
from robot_stack.drive.hardware_parameters import SwerveHardwareParams, axis_settings, session_settings
from robot_stack.drive.wheel_axes import BadWheelCommands, checked_set_points, drive_moves, steer_moves, stop_moves
from robot_stack.ros.conversions import time_from_s, time_to_s
from robot_stack.ros.node import StackNode, run
from robot_stack.wmx import connect
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import load_client_config

assert topics.WHEEL_COMMANDS.rate_hz is not None
assert topics.WHEEL_COMMANDS.stale_s is not None
assert topics.JOINT_STATES.rate_hz is not None
_JOINT_STATES_HZ = topics.JOINT_STATES.rate_hz
_COMMAND_HZ = topics.WHEEL_COMMANDS.rate_hz
_COMMAND_STALE_S = topics.WHEEL_COMMANDS.stale_s
_LOG_PERIOD_S = 1.0
_END_POLL_S = 0.02


class SwerveHardwareInterface(StackNode):
    """Commands go to the engine in the callback that brings them; a tick follows the engine and reports the joints."""

    def __init__(self) -> None:
        super().__init__("swerve_hardware_interface", SwerveHardwareParams)
        client = load_client_config()
        self._axes = axis_settings(self.params, self.robot, _COMMAND_HZ)
        torque = {True: self.robot.drive.max_torque_nm, False: self.robot.steer.max_torque_nm}
        self._nm_per_percent = [0.01 * torque[axis in DRIVE_AXES] for axis in range(len(JOINTS))]
        self._session = EngineSession(
            lambda: connect("swerve_hardware_interface", client, timeout_s=0.0), session_settings(self.params.session)
        )
        self._commanded_at_s = -math.inf
        self._joint_states = self.advertise(topics.JOINT_STATES)
        self.subscribe(topics.WHEEL_COMMANDS, self._on_wheel_commands)
        self.every(_JOINT_STATES_HZ, self._tick)

    # --- commands ----------------------------------------------------------------------------------------------------

    def _on_wheel_commands(self, message: SwerveModuleCommandArray) -> None:
        stamp_s = time_to_s(message.header.stamp)
        age_s = self.now_s() - stamp_s
        try:
            if stamp_s and age_s > _COMMAND_STALE_S:
                raise BadWheelCommands(f"header.stamp is {age_s:.2f} s old, at most {_COMMAND_STALE_S} s")
            set_points = checked_set_points(
                [module.module_id for module in message.modules],
                [module.drive_velocity for module in message.modules],
                [module.steering_angle for module in message.modules],
                self._axes.max_wheel_speed_mps,
            )
        except (
            BadWheelCommands
        ) as error:  # the last good command ages; without another one the watchdog stops the wheels
            self._complain(f"{topics.WHEEL_COMMANDS.name} refused: {error}")
            return
        self._commanded_at_s = self.steady_s()
        snapshot = self._session.look()
        if self.emergency_stop or snapshot is None:
            return
        problem = self._session.move(
            drive_moves(set_points.speeds_mps, snapshot.velocity_cmd[list(DRIVE_AXES)].tolist(), self._axes),
            steer_moves(set_points.angles_rad, snapshot.pos_cmd[list(STEER_AXES)].tolist(), self._axes),
        )
        if problem:
            self._complain(problem)

    def on_emergency_stop(self) -> None:
        problem = self._session.emergency_stop()
        if problem:
            self._complain(problem)

    # --- tick --------------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        state = self._session.poll(
            self.steady_s(),
            stop=self.emergency_stop,
            may_switch_on=self.safety_status_input.fresh() and not self.emergency_stop,
        )
        if state.snapshot is not None:
            self._publish_joint_states(state.snapshot)
            self._watch(state.snapshot)
        self._tell(state)

    def _watch(self, snapshot: StatusSnapshot) -> None:
        """Nobody commands the wheels any more: they stop by themselves."""
        if self._commanded() or not self._session.ready:
            return
        velocities = snapshot.velocity_cmd[list(DRIVE_AXES)].tolist()
        if any(velocities):
            problem = self._session.move(stop_moves(velocities, self._axes), [])
            if problem:
                self._complain(problem)

    def _commanded(self) -> bool:
        return 0.0 <= self.steady_s() - self._commanded_at_s <= _COMMAND_STALE_S

    def _publish_joint_states(self, snapshot: StatusSnapshot) -> None:
        message = JointState(name=list(JOINTS))
        message.header.frame_id = frames.BASE_LINK
        message.header.stamp = time_from_s(self.now_s() - self._age_s(snapshot))
        n = len(JOINTS)
        message.position = snapshot.actual_pos[:n].tolist()
        message.velocity = snapshot.actual_velocity[:n].tolist()
        percent = snapshot.actual_torque[:n].tolist()
        message.effort = [share * torque for share, torque in zip(percent, self._nm_per_percent, strict=True)]
        self._joint_states.publish(message)

    def _age_s(self, snapshot: StatusSnapshot) -> float:
        """How long ago the engine took the reading. Under /clock its steps are coarser than that."""
        return 0.0 if self.get_clock().ros_time_is_active else snapshot.age_s(time.monotonic_ns())

    def _complain(self, text: str) -> None:
        self.get_logger().error(text, throttle_duration_sec=_LOG_PERIOD_S)

    def _tell(self, state: SessionState) -> None:
        if state.stage is not Stage.READY:
            self.set_health(state.stage is Stage.STOPPED, state.text)
        elif not self._commanded():
            self.set_health(False, f"no usable {topics.WHEEL_COMMANDS.name} for {_COMMAND_STALE_S} s")
        else:
            self.set_health(True, state.text)
        self.report.values = {"engine": state.stage.value}

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        """Wheels to a stop, brakes closed, device given back."""
        deadline_s = time.monotonic() + self.params.end_timeout_s
        self._commanded_at_s = -math.inf
        while time.monotonic() < deadline_s:
            state = self._session.poll(self.steady_s(), stop=self.emergency_stop, may_switch_on=False)
            if state.snapshot is None:
                break
            if self._session.standing(state.snapshot) and not state.snapshot.velocity_cmd[list(DRIVE_AXES)].any():
                self._session.servos_off()
                break
            self._watch(state.snapshot)
            time.sleep(_END_POLL_S)
        self._session.close()


def main() -> None:
    run(SwerveHardwareInterface)


if __name__ == "__main__":
    main()
