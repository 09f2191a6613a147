"""swerve_hardware_interface: wheel commands to the motion engine, its encoders to joint states."""

from __future__ import annotations

import math

from custom_msgs.msg import SwerveModuleCommandArray
from robot_stack.contract import topics
from robot_stack.contract.frames import JOINTS
from robot_stack.drive.hardware_params import SwerveHardwareParams, axis_settings
from robot_stack.drive.nodes.conversions import joint_states
from robot_stack.drive.session import DriveSession
from robot_stack.drive.wheel_axes import BadWheelCommands, checked_set_points
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.middleware.node import StackNode
from robot_stack.wmx import connect
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.device_opener import ThreadedOpener
from robot_stack.wmx.robot_parameters import robot_parameters, write_parameters
from robot_stack.wmx.start_up import SessionState

_COMMAND_STALE_S = topics.WHEEL_COMMANDS.stale_limit_s


class SwerveHardwareInterfaceNode(StackNode):
    """Sends commands to the engine in their callbacks; a tick maintains the session and publishes the joints."""

    def __init__(self) -> None:
        super().__init__("swerve_hardware_interface", SwerveHardwareParams)
        client = load_client_config()
        axes = axis_settings(self.params, self.robot, topics.WHEEL_COMMANDS.nominal_rate_hz)
        self._max_wheel_speed_mps = axes.max_wheel_speed_mps
        self._nm_per_percent = [0.01 * self.robot.motor(joint).rated_torque_nm for joint in JOINTS]
        parameters = robot_parameters(self.robot)
        self._session = DriveSession(
            lambda: connect("swerve_hardware_interface", client, timeout_s=0.0),
            self.params.session,
            axes,
            parameters,
            write_parameters(parameters),
            opener=lambda open_engine: self.device(ThreadedOpener, open_engine),
        )
        self._commanded_at_s = -math.inf
        self._joint_states = self.advertise(topics.JOINT_STATES)
        self.subscribe(topics.WHEEL_COMMANDS, self._on_wheel_commands)
        self.every(topics.JOINT_STATES.nominal_rate_hz, self._tick)

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
                self._max_wheel_speed_mps,
            )
        except BadWheelCommands as error:  # the last good command ages; without another one the wheels are stopped
            self.log_throttled(f"{topics.WHEEL_COMMANDS.name} refused: {error}")
            return
        self._commanded_at_s = self.steady_s()
        if self.emergency_stop or not self._session.ready:
            return
        problem = self._session.follow(set_points).problem
        if problem:
            self.log_throttled(problem)

    def on_emergency_stop(self) -> None:
        problem = self._session.emergency_stop()
        if problem:
            self.log_throttled(problem)

    # --- tick --------------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        state = self._session.poll(
            self.steady_s(),
            stop=self.emergency_stop,
            may_switch_on=self.safety_status_input.fresh() and not self.emergency_stop,
        )
        if state.snapshot is not None:
            stamp = time_from_s(self.now_s() - self._age_s(state.snapshot))
            self._joint_states.publish(joint_states(state.snapshot, self.robot.joint_axes, self._nm_per_percent, stamp))
            self._watch(state.snapshot)
        self._report_state(state)

    def _watch(self, snapshot: StatusSnapshot) -> None:
        """Without fresh commands, stops the wheels."""
        if self._commanded():
            return
        problem = self._session.stop_wheels(snapshot).problem
        if problem:
            self.log_throttled(problem)

    def _commanded(self) -> bool:
        return 0.0 <= self.steady_s() - self._commanded_at_s <= _COMMAND_STALE_S

    def _age_s(self, snapshot: StatusSnapshot) -> float:
        """Age of the engine's reading, s."""
        return self.age_s(snapshot.age_s(round(1e9 * self.monotonic_s())))

    def _report_state(self, state: SessionState) -> None:
        if not state.ready:
            self.set_health(state.stopped, state.text)
        elif not self._commanded():
            self.set_health(False, f"no usable {topics.WHEEL_COMMANDS.name} for {_COMMAND_STALE_S} s")
        else:
            self.set_health(True, state.text)
        self.report.values = {"engine": state.stage.value}

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        """Stops the wheels, closes the brakes, closes the device."""
        self._commanded_at_s = -math.inf
        self.port.wait_until(self._switched_off, self.params.end_timeout_s)
        self._session.close()

    def _switched_off(self) -> bool:
        """Stops the wheels, then switches the servos off. True once both are done."""
        snapshot = self._session.poll(self.steady_s(), stop=self.emergency_stop, may_switch_on=False).snapshot
        if snapshot is None:
            return True
        if self._session.standing(snapshot) and not any(self._session.wheel_speeds_radps(snapshot)):
            self._session.servos_off()
            return True
        self._watch(snapshot)
        return False
