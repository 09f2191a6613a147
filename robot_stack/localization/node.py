"""localization: /odom and /sensors/imu to /current_pose, /localization/quality and the transform map -> odom."""

from __future__ import annotations

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32

from robot_stack.contract import frames, topics
from robot_stack.core.geometry import Pose2
from robot_stack.localization.gyro import ImuSample
from robot_stack.localization.localizer import Estimate, Localizer, planar_covariance, usable_covariance
from robot_stack.localization.odometry import OdometryReading, Variances
from robot_stack.localization.params import LocalizationParams
from robot_stack.ros.conversions import (
    pose_from_msg,
    pose_stamped,
    time_from_s,
    time_to_s,
    transform_stamped,
    twist_from_msg,
)
from robot_stack.ros.node import StackNode, run
from tf2_msgs.msg import TFMessage


class Localization(StackNode):
    """Predicts with every odometry message and publishes at the contract's rate."""

    def __init__(self) -> None:
        super().__init__("ndt_localization", LocalizationParams)
        motion = self.robot.empty
        self._localizer = Localizer(self.params, motion.max_speed_mps, motion.max_yaw_rate_radps)
        self._pose = self.advertise(topics.CURRENT_POSE)
        self._quality = self.advertise(topics.LOCALIZATION_QUALITY)
        self._tf = self.advertise(topics.TF)
        self._imu = self.subscribe(topics.IMU, self._on_imu)
        self._odom = self.subscribe(topics.ODOM, self._on_odometry)
        self.subscribe(topics.INITIAL_POSE, self._on_initial_pose)
        self.set_health(False, "waiting for /odom")
        assert topics.CURRENT_POSE.rate_hz is not None
        self.every(topics.CURRENT_POSE.rate_hz, self._tick)

    def _on_imu(self, message: Imu) -> None:
        rate, acceleration = message.angular_velocity, message.linear_acceleration
        signature = (rate.x, rate.y, rate.z, acceleration.x, acceleration.y, acceleration.z)
        self._localizer.on_imu(ImuSample(time_to_s(message.header.stamp), rate.z, signature))

    def _on_odometry(self, message: Odometry) -> None:
        reading = OdometryReading(
            time_to_s(message.header.stamp),
            pose_from_msg(message.pose.pose),
            twist_from_msg(message.twist.twist),
            _planar_variances(message.pose.covariance),
            _planar_variances(message.twist.covariance),
        )
        self._localizer.on_odometry(reading, self.steady_s())

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        pose, problem = _given_pose(message)
        if problem:
            self.get_logger().error(f"/initialpose refused: {problem}")
            return
        covariance = planar_covariance(message.pose.covariance)
        if not usable_covariance(covariance):  # a tool that leaves it zero, or writes nonsense
            covariance = self._localizer.start_covariance()
        self._localizer.reset(pose, covariance, time_to_s(message.header.stamp))
        self.get_logger().info(f"/initialpose taken: x {pose.x:.2f} m, y {pose.y:.2f} m, yaw {pose.yaw:.3f} rad")

    def _tick(self) -> None:
        estimate = self._localizer.estimate(self.steady_s())
        self._quality.publish(Float32(data=estimate.quality))
        if estimate.pose is not None and estimate.map_to_odom is not None:
            stamp = time_from_s(estimate.stamp_s)
            self._pose.publish(pose_stamped(estimate.pose, frames.MAP, stamp))
            transform = transform_stamped(estimate.map_to_odom, frames.MAP, frames.ODOM, stamp)
            self._tf.publish(TFMessage(transforms=[transform]))
        self._tell(estimate)

    def _tell(self, estimate: Estimate) -> None:
        self.set_health(estimate.pose is not None, "; ".join(estimate.faults) or "pose known")
        self.report.values = {
            "position sigma": f"{estimate.position_sigma_m:.3f} m",
            "yaw sigma": f"{estimate.yaw_sigma_rad:.4f} rad",
            "gyro bias": f"{estimate.gyro_bias_radps:.5f} rad/s",
            "standing": str(estimate.standing),
        }


def _planar_variances(covariance: list[float]) -> Variances:
    """(x, y, yaw) of the diagonal of a row-major (6, 6) covariance."""
    return float(covariance[0]), float(covariance[7]), float(covariance[35])


def _given_pose(message: PoseWithCovarianceStamped) -> tuple[Pose2, str]:
    """The pose and why it cannot be used, an empty text if it can."""
    pose = pose_from_msg(message.pose.pose)
    q = message.pose.pose.orientation
    norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if message.header.frame_id != frames.MAP:
        return pose, f"frame_id is {message.header.frame_id!r}, must be {frames.MAP!r}"
    if not pose.is_finite():
        return pose, f"pose is not finite: x {pose.x}, y {pose.y}, yaw {pose.yaw}"
    if not abs(norm2 - 1.0) < 0.01:
        return pose, f"orientation is no unit quaternion, its squared norm is {norm2:.3f}"
    return pose, ""


def main() -> None:
    run(Localization)


if __name__ == "__main__":
    main()
