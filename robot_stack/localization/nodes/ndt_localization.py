"""ndt_localization: estimates the pose in map from /odom, /sensors/imu and, with a map, /sensors/lidar/points.

Publishes /current_pose, /localization/pose, /localization/quality, the transform map -> odom, and the map itself.
"""

from __future__ import annotations

from functools import partial

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32

from robot_stack.contract import frames, topics
from robot_stack.core.config import ConfigError
from robot_stack.core.levels import load_levels
from robot_stack.core.site_map import SiteMap, load_map
from robot_stack.localization.localizer import Estimate, Localizer, planar_covariance, usable_covariance
from robot_stack.localization.map_localizer import MapLocalizer
from robot_stack.localization.ndt.solver import MatchRequest, MatchResult, SweepSolver
from robot_stack.localization.nodes.messages import (
    given_pose,
    imu_sample,
    map_cloud,
    map_grid,
    odometry_reading,
    pose_with_covariance,
    sweep_of,
    up_of,
)
from robot_stack.localization.params import LocalizationParams
from robot_stack.localization.warm_up import warm_up
from robot_stack.middleware.conversions import pose_stamped, time_from_s, time_to_s, transform_stamped
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wire import CloudView
from tf2_msgs.msg import TFMessage

_END_S = 2.0  # longest wait for a running match at the end


class NdtLocalizationNode(StackNode, bulk=True):
    """Predicts with every odometry message and publishes ``localizer``'s estimate at the contract's rate."""

    def __init__(self) -> None:
        super().__init__("ndt_localization", LocalizationParams)
        motion = self.robot.empty
        self._matching = False
        self._map: MapLocalizer | None = None
        self.localizer: Localizer
        if self.params.map:
            warm_up()
            site = load_map(self.params.map)
            self._solver = self._make_solver(site)
            limits = motion.max_speed_mps, motion.max_yaw_rate_radps
            levels = load_levels(self.params.map)
            self.localizer = self._map = MapLocalizer(self.params, *limits, self._solver.matcher, levels)
            self._worker = self.worker("matching")
            self.advertise(topics.MAP).publish(map_grid(site.grid, self.stamp()))
            self.advertise(topics.MAP_CLOUD).publish(map_cloud(site.cells, self.stamp()))
        else:
            self.localizer = Localizer(self.params, motion.max_speed_mps, motion.max_yaw_rate_radps)
        self._pose = self.advertise(topics.CURRENT_POSE)
        self._with_covariance = self.advertise(topics.LOCALIZATION_POSE)
        self._quality = self.advertise(topics.LOCALIZATION_QUALITY)
        self._tf = self.advertise(topics.TF)
        self._imu = self.subscribe(topics.IMU, self._on_imu)
        self._odom = self.subscribe(topics.ODOM, self._on_odometry)
        self.subscribe(topics.INITIAL_POSE, self._on_initial_pose)
        if self._map is not None:
            self.subscribe(topics.LIDAR_POINTS, self._on_sweep)
        self.set_health(False, "waiting for /odom")
        self.every(topics.CURRENT_POSE.nominal_rate_hz, self._tick)

    def _make_solver(self, site: SiteMap) -> SweepSolver:
        try:
            solver = SweepSolver(site.cells, self.params.ndt, self.robot.lidar_xyz_m)
        except ValueError as error:
            raise ConfigError(f"map {self.params.map!r}: {error}") from error
        self.get_logger().info(f"map {site.name}: {len(site.cells.key)} cells of {site.cells.size_m} m")
        return solver

    def _on_imu(self, message: Imu) -> None:
        self.localizer.on_imu(imu_sample(message))
        if self._map is not None and (up := up_of(message)) is not None:
            self._map.on_up(up)

    def _on_odometry(self, message: Odometry) -> None:
        self.localizer.on_odometry(odometry_reading(message), self._odom.received_s)

    def _on_sweep(self, message: CloudView) -> None:
        assert self._map is not None
        try:
            sweep = sweep_of(message)
        except ValueError as error:
            self.get_logger().error(f"/sensors/lidar/points refused: {error}", throttle_duration_sec=1.0)
            return
        self._map.on_sweep(sweep, time_to_s(message.header.stamp))
        self._match()

    def _match(self) -> None:
        """Starts to match the newest sweep unless a match is running."""
        if self._map is None or self._matching:
            return
        request = self._map.request()
        if request is not None:
            self._matching = True
            self._worker.submit(partial(_solve, self._solver, request), self._on_match)

    def _on_match(self, result: MatchResult) -> None:
        assert self._map is not None
        self._matching = False
        self._map.answer(result, self.steady_s())
        self._match()

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        pose, problem = given_pose(message)
        if problem:
            self.get_logger().error(f"/initialpose refused: {problem}")
            return
        covariance = planar_covariance(message.pose.covariance)
        if not usable_covariance(covariance):  # zero or invalid, as some tools send it
            covariance = self.localizer.start_covariance()
        self.localizer.reset(pose, covariance, time_to_s(message.header.stamp))
        self.get_logger().info(f"/initialpose accepted: x {pose.x:.2f} m, y {pose.y:.2f} m, yaw {pose.yaw:.3f} rad")

    def _tick(self) -> None:
        self._match()
        estimate = self.localizer.estimate(self.steady_s())
        self._quality.publish(Float32(data=estimate.quality))
        if estimate.pose is not None and estimate.map_to_odom is not None:
            stamp = time_from_s(estimate.stamp_s)
            self._pose.publish(pose_stamped(estimate.pose, frames.MAP, stamp))
            self._with_covariance.publish(pose_with_covariance(estimate.pose, estimate.covariance, stamp))
            transform = transform_stamped(estimate.map_to_odom, frames.MAP, frames.ODOM, stamp)
            self._tf.publish(TFMessage(transforms=[transform]))
        self._report_state(estimate)

    def _report_state(self, estimate: Estimate) -> None:
        self.set_health(estimate.pose is not None, "; ".join(estimate.faults) or "pose known")
        self.report.values = {
            "position sigma": f"{estimate.position_sigma_m:.3f} m",
            "yaw sigma": f"{estimate.yaw_sigma_rad:.4f} rad",
            "gyro bias": f"{estimate.gyro_bias_radps:.5f} rad/s",
            "standing": str(estimate.standing),
        }
        if self._map is not None:
            match = self._map.match
            self.report.values["map"] = self._map.confidence.value
            self.report.values["match"] = "none" if match is None else f"{match.score:.2f}, {match.iterations} steps"
            self.report.values["slip"] = str(self._map.slip or "none")

    def destroy_node(self) -> None:
        if self._map is not None:
            self._worker.close(_END_S)
        super().destroy_node()


def _solve(solver: SweepSolver, request: MatchRequest) -> MatchResult:
    try:
        return solver.solve(request)
    except Exception as error:  # a sweep that cannot be matched must not end the node: the quality shows it
        return MatchResult(request, None, 0, f"matching failed: {type(error).__name__}: {error}")
