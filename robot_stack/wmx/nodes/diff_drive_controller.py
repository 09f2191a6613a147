"""diff_drive_controller: twists to the speeds of two wheels on the motion engine, their encoders to odometry."""

from __future__ import annotations

import time

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.config import config_dir
from robot_stack.ros.conversions import pose_to_msg, time_from_s, transform_stamped
from robot_stack.ros.node import StackNode, run
from robot_stack.wmx import connect
from robot_stack.wmx.axes import FloatRow, StatusSnapshot
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.differential.command import BadTwist, TwistCommand, Wish
from robot_stack.wmx.differential.kinematics import REST, WheelPair, body_twist, wheel_speeds
from robot_stack.wmx.differential.odometry import WheelOdometry, WheelReading
from robot_stack.wmx.differential.parameters import (
    DiffDriveParams,
    base_geometry,
    named,
    odometry_settings,
    pose_covariance,
    session_settings,
    twist_covariance,
)
from robot_stack.wmx.differential.session import WheelSession
from robot_stack.wmx.differential.states import Stage
from robot_stack.wmx.link import EngineLink
from tf2_msgs.msg import TFMessage

_LOG_PERIOD_S = 1.0
_END_POLL_S = 0.02


class DiffDriveController(StackNode):
    """A twist is stored when it comes; a tick looks at the engine once, drives the wheels and reports them."""

    def __init__(self) -> None:
        super().__init__("diff_drive_controller", DiffDriveParams)
        client, params = load_client_config(), self.params
        self._base = base_geometry(params)
        self._command = TwistCommand(params.cmd_vel_timeout_s)
        self._odometry = WheelOdometry(self._base, odometry_settings(params))
        self._link = EngineLink(
            lambda: connect("diff_drive_controller", client, timeout_s=0.0),
            retry_s=params.session.retry_s,
            feed_period_s=params.session.feed_period_s,
            watchdog_s=params.session.watchdog_s,
        )
        self._session = WheelSession(self._link, session_settings(params, config_dir()))
        self._measured = Odometry(child_frame_id=params.base_frame)  # one for all ticks: most of it never changes
        self._measured.header.frame_id = params.odom_frame
        self._measured.twist.covariance = twist_covariance(params.odometry)
        self._echo = self._optional(topics.WMX_CMD_VEL_CHECK, params.encoder_vel_topic)
        self._speeds = self._optional(topics.WMX_WHEEL_VELOCITIES, params.encoder_omega_topic)
        self._odom = self._optional(topics.WMX_ODOM_ENC, params.encoder_odometry_topic)
        self._tf = self.advertise(topics.WMX_TF) if params.publish_tf else None
        self.subscribe(topics.WMX_CMD_VEL, self._on_cmd_vel, name=params.cmd_vel_topic)
        self.every(params.rate, self._tick)

    def _optional(self, row: Topic, name: str) -> Publisher | None:
        return self.advertise(row, name=name) if named(name) else None

    # --- commands ----------------------------------------------------------------------------------------------------

    def _on_cmd_vel(self, message: Twist) -> None:
        if self._echo is not None:
            self._echo.publish(message)
        parts = {"linear": message.linear, "angular": message.angular}
        fields = {f"{name}.{axis}": getattr(part, axis) for name, part in parts.items() for axis in "xyz"}
        try:
            self._command.receive(fields, self.steady_s())
        except BadTwist as error:
            self._complain(f"{self.params.cmd_vel_topic} refused, the wheels stop: {error}")

    def on_emergency_stop(self) -> None:
        self._command.demand_rest()
        problem = self._session.quick_stop()
        if problem:
            self._complain(problem)

    # --- tick --------------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        state = self._session.poll(self.steady_s(), stop=self.emergency_stop)
        wish = self._command.wish(self.steady_s())
        if self._session.ready:
            self._drive(wish)
        else:
            self._command.demand_rest()
        if state.snapshot is not None:
            self._report_motion(state.snapshot)
        self._tell(state.stage, state.text, wish)

    def _drive(self, wish: Wish) -> None:
        limit_radps = self.params.max_wheel_speed_radps
        speeds = wheel_speeds(wish.linear_mps, wish.angular_radps, self._base, limit_radps)
        problem = self._session.follow(self._turned(speeds), self.steady_s())
        if problem:
            self._complain(problem)

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
            self._complain(odometry.fault)
        message.pose.pose = pose_to_msg(odometry.pose)
        message.pose.covariance = pose_covariance(odometry.covariance)
        if self._tf is not None:
            frames = self.params.odom_frame, self.params.base_frame
            self._tf.publish(TFMessage(transforms=[transform_stamped(odometry.pose, *frames, message.header.stamp)]))

    def _age_s(self, snapshot: StatusSnapshot) -> float:
        """How long ago the engine took the reading. Under /clock its steps are coarser than that."""
        return 0.0 if self.get_clock().ros_time_is_active else snapshot.age_s(time.monotonic_ns())

    def _complain(self, text: str) -> None:
        self.get_logger().error(text, throttle_duration_sec=_LOG_PERIOD_S)

    def _tell(self, stage: Stage, text: str, wish: Wish) -> None:
        self.report.values = {"engine": stage.value}
        if stage is Stage.READY:
            self.set_health(not wish.blocked, wish.text or text)
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
        self._link.close()


def main() -> None:
    run(DiffDriveController)


if __name__ == "__main__":
    main()
