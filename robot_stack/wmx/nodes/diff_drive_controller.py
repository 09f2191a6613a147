"""diff_drive_controller: twists to the speeds of two wheels on the motion engine, their encoders to odometry."""

from __future__ import annotations

from geometry_msgs.msg import Twist, TwistStamped

from robot_stack.contract import topics
from robot_stack.core.config import config_dir
from robot_stack.middleware.conversions import time_from_s, time_to_s, twist_fields
from robot_stack.middleware.node import StackNode
from robot_stack.wmx import connect
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.device_opener import ThreadedOpener
from robot_stack.wmx.differential.command import BadTwist, Command, OldTwist, TwistCommand
from robot_stack.wmx.differential.kinematics import REST, body_twist
from robot_stack.wmx.differential.odometry import Odometry, WheelOdometry, WheelReading
from robot_stack.wmx.differential.params import (
    DiffDriveParams,
    base_geometry,
    motion_limits,
    named,
    parameter_file,
    wheel_axes,
)
from robot_stack.wmx.differential.session import WheelSession
from robot_stack.wmx.differential.shaping import TwistShaper
from robot_stack.wmx.nodes.diff_drive_outputs import DiffDriveOutputs
from robot_stack.wmx.session import EngineSession
from robot_stack.wmx.start_up import SessionState

# Discovery time of a sender that started earlier (config/fastdds.xml).
_DISCOVERY_S = 2.5
_END_POLL_S = 0.02


class DiffDriveControllerNode(StackNode):
    """Stores each received twist; a tick reads the engine once, drives the wheels and reports them."""

    def __init__(self) -> None:
        super().__init__("diff_drive_controller", DiffDriveParams)
        client, params = load_client_config(), self.params
        self._base, self._axes = base_geometry(params), wheel_axes(params)
        self._command = TwistCommand(params.cmd_vel_timeout_s, self.steady_s() + _DISCOVERY_S)
        limits, most_radps = motion_limits(params.limits), params.max_wheel_speed_radps
        self._shaper = TwistShaper(self._base, most_radps, limits, 1.0 / params.rate)
        self._odometry = WheelOdometry(self._base, params.odometry, most_radps)
        self._engine = EngineSession(
            lambda: connect("diff_drive_controller", client, timeout_s=0.0),
            params.session.patience(),
            opener=lambda open_engine: self.device(ThreadedOpener, open_engine),
        )
        self._session = WheelSession(self._engine, params, parameter_file(params, config_dir()))
        self._outputs = DiffDriveOutputs(self, params)
        self.subscribe(topics.WMX_CMD_VEL, self._on_cmd_vel, name=params.cmd_vel_topic)
        if named(params.cmd_vel_stamped_topic):
            self.subscribe(topics.WMX_CMD_VEL_STAMPED, self._on_stamped, name=params.cmd_vel_stamped_topic)
        self.every(params.rate, self._tick)

    # --- commands ----------------------------------------------------------------------------------------------------

    def _on_cmd_vel(self, message: Twist) -> None:
        self._receive(message, self.params.cmd_vel_topic, 0.0)

    def _on_stamped(self, message: TwistStamped) -> None:
        """A stamp of zero means now, as with ros2_controllers' diff_drive_controller."""
        stamp_s = time_to_s(message.header.stamp)
        self._receive(message.twist, self.params.cmd_vel_stamped_topic, self.now_s() - stamp_s if stamp_s else 0.0)

    def _receive(self, message: Twist, topic: str, age_s: float) -> None:
        self._outputs.echo(message)
        try:
            self._command.receive(twist_fields(message), self.steady_s(), age_s)
        except BadTwist as error:
            self.log_throttled(f"{topic} refused, the wheels stop: {error}")
        except OldTwist as error:
            self.log_throttled(f"{topic} left out: {error}")

    def on_emergency_stop(self) -> None:
        self._command.demand_rest(self.steady_s())
        problem = self._session.quick_stop()
        if problem:
            self.log_throttled(problem)

    # --- tick --------------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        state = self._session.poll(self.steady_s(), stop=self.emergency_stop)
        requested = self._command.requested(self.steady_s())
        if self._session.ready and state.snapshot is not None:
            self._drive(requested, state.snapshot)
        else:
            self._command.demand_rest(self.steady_s())
        if state.snapshot is not None:
            self._report_motion(state.snapshot)
        self._report(state, requested)

    def _drive(self, requested: Command, snapshot: StatusSnapshot) -> None:
        now_s = self.steady_s()
        shaped = self._shaper.shape(requested, self._axes.wheels(snapshot.velocity_cmd), snapshot.engine_time_s)
        problem = self._session.follow(self._axes.turned(shaped.speeds), now_s, shaped.ramp_s).problem
        if problem:
            self.log_throttled(problem)

    # --- reports -----------------------------------------------------------------------------------------------------

    def _report_motion(self, snapshot: StatusSnapshot) -> None:
        speeds = self._axes.wheels(snapshot.actual_velocity)
        self._outputs.wheels(speeds)
        age_s = self.age_s(snapshot.age_s(round(1e9 * self.monotonic_s())))  # since the engine's reading
        stamp = time_from_s(self.now_s() - age_s)
        odometry = self._travelled(snapshot) if self.params.publish_pose else None
        self._outputs.odometry(body_twist(speeds, self._base), odometry, stamp)

    def _travelled(self, snapshot: StatusSnapshot) -> Odometry:
        reading = WheelReading(snapshot.engine_time_s, self._axes.wheels(snapshot.actual_pos), snapshot.epoch)
        odometry = self._odometry.update(reading)
        if odometry.fault:
            self.log_throttled(odometry.fault)
        return odometry

    def _report(self, state: SessionState, requested: Command) -> None:
        self.report.values = {"engine": state.stage.value}
        if state.ready:
            self.set_health(not requested.blocked, requested.text or state.text)
        else:
            self.set_health(state.stopped, state.text)

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        """Stops the wheels, switches servos off and closes the device. The bus is left to its other users."""
        self.port.wait_until(self._switched_off, self.params.end_timeout_s)
        self._engine.close()

    def _switched_off(self) -> bool:
        """Stops the wheels, then switches the servos off. True once nothing is left to do."""
        snapshot = self._session.poll(self.steady_s(), stop=self.emergency_stop).snapshot
        if snapshot is None:
            return True
        if self._session.standing(snapshot):
            self._session.servos_off()
            return True
        if self._session.ready:
            self._session.follow(REST, self.steady_s())
        return False
