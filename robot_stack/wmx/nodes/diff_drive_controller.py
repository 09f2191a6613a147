"""diff_drive_controller: twists to the speeds of two wheels on the motion engine, their encoders to odometry."""

from __future__ import annotations

import time

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.config import config_dir
from robot_stack.ros.conversions import pose_to_msg, time_from_s, time_to_s, transform_stamped
from robot_stack.ros.node import StackNode, run
from robot_stack.wmx import connect
from robot_stack.wmx.axes import FloatRow, StatusSnapshot
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.differential.command import BadTwist, Command, OldTwist, TwistCommand
from robot_stack.wmx.differential.kinematics import REST, WheelPair, body_twist
from robot_stack.wmx.differential.odometry import WheelOdometry, WheelReading
from robot_stack.wmx.differential.parameters import (
    DiffDriveParams,
    base_geometry,
    motion_limits,
    named,
    odometry_settings,
    patience,
    pose_covariance,
    session_settings,
    twist_covariance,
)
from robot_stack.wmx.differential.session import WheelSession
from robot_stack.wmx.differential.shaping import TwistShaper
from robot_stack.wmx.differential.states import Stage
from robot_stack.wmx.session import EngineSession
from tf2_msgs.msg import TFMessage

# So long a sender that was there before may need to be discovered (config/fastdds.xml).
_DISCOVERY_S = 2.5
_END_POLL_S = 0.02


class DiffDriveControllerNode(StackNode):
    """A twist is stored when it comes; a tick looks at the engine once, drives the wheels and reports them."""

    def __init__(self) -> None:
        super().__init__("diff_drive_controller", DiffDriveParams)
        client, params = load_client_config(), self.params
        self._base = base_geometry(params)
        self._command = TwistCommand(params.cmd_vel_timeout_s, self.steady_s() + _DISCOVERY_S)
        limits, most_radps = motion_limits(params.limits), params.max_wheel_speed_radps
        self._shaper = TwistShaper(self._base, most_radps, limits, 1.0 / params.rate)
        self._odometry = WheelOdometry(self._base, odometry_settings(params))
        self._engine = EngineSession(
            lambda: connect("diff_drive_controller", client, timeout_s=0.0), patience(params.session), own_thread=True
        )
        self._session = WheelSession(self._engine, session_settings(params, config_dir()))
        self._measured = Odometry(child_frame_id=params.base_frame)  # one for all ticks: most of it never changes
        self._measured.header.frame_id = params.odom_frame
        self._measured.twist.covariance = twist_covariance(params.odometry)
        self._echo = self._optional(topics.WMX_CMD_VEL_CHECK, params.encoder_vel_topic)
        self._speeds = self._optional(topics.WMX_WHEEL_VELOCITIES, params.encoder_omega_topic)
        self._odom = self._optional(topics.WMX_ODOM_ENC, params.encoder_odometry_topic)
        self._tf = self.advertise(topics.WMX_TF) if params.publish_tf else None
        self.subscribe(topics.WMX_CMD_VEL, self._on_cmd_vel, name=params.cmd_vel_topic)
        if named(params.cmd_vel_stamped_topic):
            self.subscribe(topics.WMX_CMD_VEL_STAMPED, self._on_stamped, name=params.cmd_vel_stamped_topic)
        self.every(params.rate, self._tick)

    def _optional(self, row: Topic, name: str) -> Publisher | None:
        return self.advertise(row, name=name) if named(name) else None

    # --- commands ----------------------------------------------------------------------------------------------------

    def _on_cmd_vel(self, message: Twist) -> None:
        self._receive(message, self.params.cmd_vel_topic, 0.0)

    def _on_stamped(self, message: TwistStamped) -> None:
        """A stamp of zero means now, as with ros2_controllers' diff_drive_controller."""
        stamp_s = time_to_s(message.header.stamp)
        self._receive(message.twist, self.params.cmd_vel_stamped_topic, self.now_s() - stamp_s if stamp_s else 0.0)

    def _receive(self, message: Twist, topic: str, age_s: float) -> None:
        if self._echo is not None:
            self._echo.publish(message)
        parts = {"linear": message.linear, "angular": message.angular}
        fields = {f"{name}.{axis}": getattr(part, axis) for name, part in parts.items() for axis in "xyz"}
        try:
            self._command.receive(fields, self.steady_s(), age_s)
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
        self._report(state.stage, state.text, requested)

    def _drive(self, requested: Command, snapshot: StatusSnapshot) -> None:
        now_s = self.steady_s()
        shaped = self._shaper.shape(requested, self._of_wheels(snapshot.velocity_cmd), snapshot.engine_time_s)
        problem = self._session.follow(self._turned(shaped.speeds), now_s, shaped.ramp_s).problem
        if problem:
            self.log_throttled(problem)

    def _turned(self, wheels: WheelPair) -> WheelPair:
        """Between wheels that drive forward and axes that turn, either way."""
        return WheelPair(wheels.left * self.params.left_polarity, wheels.right * self.params.right_polarity)

    def _of_wheels(self, of_axes: FloatRow) -> WheelPair:
        return self._turned(WheelPair(float(of_axes[self.params.left_axis]), float(of_axes[self.params.right_axis])))

    # --- reports -----------------------------------------------------------------------------------------------------

    def _report_motion(self, snapshot: StatusSnapshot) -> None:
        speeds = self._of_wheels(snapshot.actual_velocity)
        if self._speeds is not None:
            self._speeds.publish(Float64MultiArray(data=[speeds.left, speeds.right]))
        stamp_s = self.now_s() - self._age_s(snapshot)
        message = self._measured
        message.header.stamp = time_from_s(stamp_s)
        message.twist.twist.linear.x, message.twist.twist.angular.z = body_twist(speeds, self._base)
        if self.params.publish_pose:
            self._fill_pose(message, snapshot)
        if self._odom is not None:
            self._odom.publish(message)

    def _fill_pose(self, message: Odometry, snapshot: StatusSnapshot) -> None:
        reading = WheelReading(snapshot.engine_time_s, self._of_wheels(snapshot.actual_pos), snapshot.epoch)
        odometry = self._odometry.update(reading)
        if odometry.fault:
            self.log_throttled(odometry.fault)
        message.pose.pose = pose_to_msg(odometry.pose)
        message.pose.covariance = pose_covariance(odometry.covariance)
        if self._tf is not None:
            frames = self.params.odom_frame, self.params.base_frame
            self._tf.publish(TFMessage(transforms=[transform_stamped(odometry.pose, *frames, message.header.stamp)]))

    def _age_s(self, snapshot: StatusSnapshot) -> float:
        """How long ago the engine took the reading."""
        return self.age_s(snapshot.age_s(time.monotonic_ns()))

    def _report(self, stage: Stage, text: str, requested: Command) -> None:
        self.report.values = {"engine": stage.value}
        if stage is Stage.READY:
            self.set_health(not requested.blocked, requested.text or text)
        else:
            self.set_health(stage is Stage.STOPPED, text)

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        """Wheels to a stop, servos off, device given back. The bus is left to those who still use it."""
        deadline_s = time.monotonic() + self.params.end_timeout_s
        while time.monotonic() < deadline_s:
            state = self._session.poll(self.steady_s(), stop=self.emergency_stop)
            if state.snapshot is None:
                break
            if self._session.standing(state.snapshot):
                self._session.servos_off()
                break
            if self._session.ready:
                self._session.follow(REST, self.steady_s())
            time.sleep(_END_POLL_S)
        self._engine.close()


def main() -> None:
    run(DiffDriveControllerNode)
