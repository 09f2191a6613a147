"""perception_pipeline: /sensors/lidar/half_sweep to /perception/obstacles and /perception/free_space."""

from __future__ import annotations

import math
from array import array

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, LaserScan, PointCloud2
from std_msgs.msg import Bool

from robot_stack.contract import frames, topics
from robot_stack.core.point_cloud import SWEEP, Points, points_from_xyz
from robot_stack.perception.attitude import attitude_of
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline, Scene
from robot_stack.perception.watch import Watch, hidden_by_chair
from robot_stack.ros.conversions import pose_from_msg, time_to_s, twist_from_msg
from robot_stack.ros.inputs import Input
from robot_stack.ros.node import StackNode, run
from robot_stack.ros.point_cloud import cloud_message, fill, points_of


class PerceptionPipeline(StackNode):
    """Publishes with every half sweep, and nothing at all while what it would publish could be wrong."""

    def __init__(self) -> None:
        super().__init__("perception_pipeline", PerceptionParams)
        assert topics.OBSTACLES.rate_hz is not None
        self._period_s = 1.0 / topics.OBSTACLES.rate_hz
        self._pipeline = Pipeline(self.robot, self.params)
        self._pipeline.warm_up()
        self._watch = Watch(self.params.watch)
        self._behind_chair = hidden_by_chair(self.robot, self.params.watch.sectors)
        self._cloud = cloud_message(points_from_xyz(np.empty((0, 3))), frames.BASE_LINK)
        self._scan = self._make_scan()
        self._obstacles, self._free = self.advertise(topics.OBSTACLES), self.advertise(topics.FREE_SPACE)
        self._repeat_at_s = math.inf
        self.subscribe(topics.ODOM, self._on_odometry)
        self.subscribe(topics.IMU, self._on_imu)
        self.subscribe(topics.PASSENGER_ATTACHED, self._on_passenger)
        self._halves = self.subscribe(topics.LIDAR_HALF_SWEEP, self._on_half_sweep)
        self._fulls: Input | None = None
        self._driver_since_s = math.inf
        self.set_health(False, f"waiting for {topics.LIDAR_HALF_SWEEP.name}")
        self.every(2.0 * topics.OBSTACLES.rate_hz, self._tick)

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_odometry(self, message: Odometry) -> None:
        stamp_s, pose = time_to_s(message.header.stamp), pose_from_msg(message.pose.pose)
        problem = self._pipeline.motion.on_odometry(stamp_s, pose, twist_from_msg(message.twist.twist))
        if problem:
            self.set_health(False, problem)

    def _on_imu(self, message: Imu) -> None:
        q = message.orientation
        attitude = attitude_of(q.x, q.y, q.z, q.w)
        if attitude is not None:
            self._pipeline.motion.on_attitude(time_to_s(message.header.stamp), attitude)

    def _on_passenger(self, message: Bool) -> None:
        self._pipeline.chair = message.data

    def _on_half_sweep(self, message: PointCloud2) -> None:
        self._take(message, full=False)

    def _on_full_sweep(self, message: PointCloud2) -> None:
        self._take(message, full=True)

    # --- work --------------------------------------------------------------------------------------------------------

    def _take(self, message: PointCloud2, *, full: bool) -> None:
        self._repeat_at_s = math.inf
        stamp_s = time_to_s(message.header.stamp)
        points, problem = self._look(message, stamp_s)
        if points is None:
            self.set_health(False, f"{'full' if full else 'half'} sweep: {problem}")
            return
        scene = self._pipeline.scene(points, stamp_s, self._watch.dark)
        self._publish(message, scene)
        if full:
            self._repeat_at_s = self.steady_s() + self._period_s
        level = self._pipeline.motion.attitude_at(stamp_s) is not None
        self.set_health(True, "obstacles are seen" if level else "obstacles are seen, without the attitude")
        self.report.values |= {
            "obstacle points": str(len(scene.obstacles)),
            "points not finite": str(scene.broken),
            "blind directions": str(int(self._watch.dark.sum())),
            "sweeps": "full" if full else "half",
        }

    def _look(self, message: PointCloud2, stamp_s: float) -> tuple[Points | None, str]:
        """The points of a sweep, or None and why they cannot be used."""
        if message.header.frame_id != frames.LIDAR:
            return None, f"frame_id is {message.header.frame_id!r}, must be {frames.LIDAR!r}"
        try:
            points = points_of(message, SWEEP)
        except ValueError as error:
            return None, str(error)
        problem = self._watch.stamp_problem(stamp_s, self.now_s())
        if not problem and self._watch.frozen(points):
            problem = "frozen: the same points came before"
        excused = self._behind_chair if self._pipeline.chair else None
        problem = problem or self._watch.blind(points, stamp_s, excused) or self._pipeline.motion.problem(stamp_s)
        return (None, problem) if problem else (points, "")

    def _publish(self, message: PointCloud2, scene: Scene) -> None:
        fill(self._cloud, points_from_xyz(scene.obstacles))
        self._cloud.header.stamp = self._scan.header.stamp = message.header.stamp
        self._scan.ranges = array("f", scene.free_m.tobytes())
        self._send()

    def _send(self) -> None:
        self._obstacles.publish(self._cloud)
        self._free.publish(self._scan)

    def _tick(self) -> None:
        """What no message tells: silence, a driver without half sweeps, the time to show a full sweep again."""
        if self.steady_s() >= self._repeat_at_s:
            self._repeat_at_s = math.inf
            self._send()
        silent = not self._halves.fresh()
        if silent and self._fulls is None and self._only_full_sweeps_come():
            self._fulls = self.subscribe(topics.LIDAR_POINTS, self._on_full_sweep)
        elif not silent and self._fulls is not None:
            self._leave_full_sweeps()
        if silent and not (self._fulls is not None and self._fulls.fresh()) and self.report.ok:
            self.set_health(False, "the LiDAR is silent")

    def _only_full_sweeps_come(self) -> bool:
        """Full sweeps are 36 MB/s: they are received only while nothing else is to be had."""
        if not self.count_publishers(topics.LIDAR_POINTS.name):
            self._driver_since_s = math.inf
            return False
        self._driver_since_s = min(self._driver_since_s, self.steady_s())
        waited_s = min(self._halves.age_s(), self.steady_s() - self._driver_since_s)
        return waited_s > self.params.output.full_sweep_after_s

    def _leave_full_sweeps(self) -> None:
        self._fulls = None
        for subscription in list(self.subscriptions):
            if subscription.topic_name == topics.LIDAR_POINTS.name:
                self.destroy_subscription(subscription)

    def _make_scan(self) -> LaserScan:
        count = self.params.free_space.directions
        step = 2.0 * math.pi / count
        scan = LaserScan(
            angle_min=-math.pi + 0.5 * step,
            angle_max=math.pi - 0.5 * step,
            angle_increment=step,
            scan_time=self._period_s,
            range_min=0.0,
            range_max=self.params.crop.range_max_m,
        )
        scan.header.frame_id = frames.BASE_LINK
        return scan


def main() -> None:
    run(PerceptionPipeline, bulk=True)


if __name__ == "__main__":
    main()
