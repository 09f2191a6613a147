"""perception_pipeline: /sensors/lidar/half_sweep to /perception/obstacles, unseen and space."""

from __future__ import annotations

import math
from array import array

import numpy as np
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool

from robot_stack.contract import frames, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.point_cloud import SWEEP, Points, moving_points, points_from_xyz
from robot_stack.perception.attitude import attitude_of
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline, Scene
from robot_stack.perception.warm_up import warm_up
from robot_stack.perception.watch import Watch, too_near
from robot_stack.ros.conversions import pose_from_msg, time_to_s, twist_from_msg
from robot_stack.ros.inputs import Input
from robot_stack.ros.node import StackNode, run
from robot_stack.ros.point_cloud import cloud_message, fill, points_of
from robot_stack.ros.wire import CloudView

# A grid follows the sweep that is due, not a timer: the one whose stamp is nearest to a period after the last grid's.
_SPACE_DUE_S = 1.0 / topics.SPACE.nominal_rate_hz - 0.5 / topics.OBSTACLES.nominal_rate_hz


class PerceptionPipelineNode(StackNode):
    """Publishes with every half sweep, and nothing at all while what it would publish could be wrong."""

    def __init__(self) -> None:
        super().__init__("perception_pipeline", PerceptionParams)
        warm_up()
        self._period_s = 1.0 / topics.OBSTACLES.nominal_rate_hz
        self._pipeline = Pipeline(self.robot, self.params)
        height_m = self.robot.lidar_xyz_m[2]
        self._watch, self._overhead_watch = (Watch(self.params.watch, height_m) for _ in range(2))
        self._excused = too_near(self.robot, load_docks().latched_wheelchair(), self.params.watch)
        self._cloud = cloud_message(points_from_xyz(np.empty((0, 3))), frames.BASE_LINK)
        self._ends = cloud_message(points_from_xyz(np.empty((0, 3))), frames.BASE_LINK)
        self._bodies = cloud_message(moving_points(np.empty((0, 5))), frames.BASE_LINK)
        self._moving = self.advertise(topics.MOVING)
        self._obstacles, self._unseen = self.advertise(topics.OBSTACLES), self.advertise(topics.UNSEEN_SPACE)
        self._space = self.advertise(topics.SPACE)
        self._space_s = -math.inf  # stamp of the last one
        self._repeat = self.create_timer(self._period_s, self._send_again)
        self._repeat.cancel()
        self.subscribe(topics.ODOM, self._on_odometry)
        self.subscribe(topics.IMU, self._on_imu)
        self.subscribe(topics.PASSENGER_ATTACHED, self._on_passenger)
        self._halves = self.subscribe(topics.LIDAR_HALF_SWEEP, self._on_half_sweep)
        self._overhead = self.subscribe(topics.OVERHEAD_LIDAR_POINTS, self._on_overhead)
        self._fulls: Input | None = None
        self._driver_since_s = math.inf
        self.set_health(False, f"waiting for {topics.LIDAR_HALF_SWEEP.name}")
        self.every(topics.OBSTACLES.nominal_rate_hz, self._tick)

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

    def _on_half_sweep(self, message: CloudView) -> None:
        self._take(message, full=False)

    def _on_full_sweep(self, message: CloudView) -> None:
        self._take(message, full=True)

    def _on_overhead(self, message: CloudView) -> None:
        """What it shows goes out with the next half sweep. That it shows nothing is the safety monitor's to judge."""
        stamp_s = time_to_s(message.header.stamp)
        points, problem = self._overhead_points(message, stamp_s)
        if points is not None:
            self._pipeline.overhead(points, stamp_s)
        self.report.values["overhead LiDAR"] = problem or "seen"

    def _overhead_points(self, message: CloudView, stamp_s: float) -> tuple[Points | None, str]:
        """The points of a frame, or None and why they cannot be used."""
        if message.header.frame_id != frames.OVERHEAD_LIDAR:
            return None, f"frame_id is {message.header.frame_id!r}, must be {frames.OVERHEAD_LIDAR!r}"
        try:
            points = points_of(message, SWEEP)
        except ValueError as error:
            return None, str(error)
        problem = self._overhead_watch.stamp_problem(stamp_s, self.now_s())
        if not problem and self._overhead_watch.frozen(points):
            problem = "frozen: the same points came before"
        problem = problem or self._pipeline.motion.problem(stamp_s)
        return (None, problem) if problem else (points, "")

    # --- work --------------------------------------------------------------------------------------------------------

    def _take(self, message: CloudView, *, full: bool) -> None:
        self._repeat.cancel()
        stamp_s = time_to_s(message.header.stamp)
        points, problem = self._look(message, stamp_s)
        if points is None:
            self.set_health(False, f"{'full' if full else 'half'} sweep: {problem}")
            return
        scene = self._pipeline.scene(points, stamp_s, self._watch.obstructed)
        self._publish(message, scene)
        if full:
            self._repeat.reset()
        level = self._pipeline.motion.attitude_at(stamp_s) is not None
        self.set_health(True, "obstacles are seen" if level else "obstacles are seen, without the attitude")
        self.report.values |= {
            "obstacle points": str(len(scene.obstacles)),
            "points not finite": str(scene.broken),
            "obstructed directions": str(int(self._watch.obstructed.sum())),
            "sweeps": "full" if full else "half",
        }

    def _look(self, message: CloudView, stamp_s: float) -> tuple[Points | None, str]:
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
        excused = self._excused if self._pipeline.chair else None
        problem = problem or self._watch.blind(points, stamp_s, excused) or self._pipeline.motion.problem(stamp_s)
        return (None, problem) if problem else (points, "")

    def _publish(self, message: CloudView, scene: Scene) -> None:
        fill(self._cloud, points_from_xyz(scene.obstacles))
        fill(self._ends, points_from_xyz(scene.unseen))
        fill(self._bodies, moving_points(scene.moving))
        for cloud in (self._cloud, self._ends, self._bodies):
            cloud.header.stamp = message.header.stamp
        self._send()
        if not 0.0 <= scene.stamp_s - self._space_s < _SPACE_DUE_S:
            self._space_s = scene.stamp_s
            self._publish_space(message)

    def _publish_space(self, message: CloudView) -> None:
        space, grid = self._pipeline.space.grid(), OccupancyGrid()
        grid.header.stamp = grid.info.map_load_time = message.header.stamp
        grid.header.frame_id = frames.ODOM
        grid.info.resolution = space.cell_m
        grid.info.height, grid.info.width = space.state.shape
        grid.info.origin.position.x, grid.info.origin.position.y = space.corner_m
        grid.info.origin.orientation.w = 1.0
        grid.data = array("b", space.state.tobytes())
        self._space.publish(grid)

    def _send(self) -> None:
        self._obstacles.publish(self._cloud)
        self._unseen.publish(self._ends)
        self._moving.publish(self._bodies)

    def _send_again(self) -> None:
        """A full sweep between two of them."""
        self._repeat.cancel()
        self._send()

    def _tick(self) -> None:
        """What no message tells: silence, a driver without half sweeps."""
        silent = not self._halves.fresh()
        if silent and self._fulls is None and self._only_full_sweeps_come():
            self._fulls = self.subscribe(topics.LIDAR_POINTS, self._on_full_sweep)
        elif not silent and self._fulls is not None:
            self._leave_full_sweeps()
        if not self._overhead.fresh():
            self.report.values["overhead LiDAR"] = "silent"
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


def main() -> None:
    run(PerceptionPipelineNode, bulk=True)


if __name__ == "__main__":
    main()
