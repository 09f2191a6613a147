"""perception_pipeline: computes /perception/obstacles, unseen and space from /sensors/lidar/half_sweep."""

from __future__ import annotations

import math

from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from custom_msgs.msg import LatchStatus
from robot_stack.contract import frames, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.middleware.conversions import pose_from_msg, time_to_s, twist_from_msg
from robot_stack.middleware.inputs import Input
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import points_of
from robot_stack.middleware.wire import CloudView
from robot_stack.perception.attitude import attitude_of
from robot_stack.perception.nodes.outputs import PerceptionOutputs
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.warm_up import warm_up
from robot_stack.perception.watch import Watch, too_near


class PerceptionPipelineNode(StackNode, bulk=True):
    """Publishes with every half sweep; publishes nothing while its inputs may be wrong."""

    def __init__(self) -> None:
        super().__init__("perception_pipeline", PerceptionParams)
        warm_up()
        self._pipeline = Pipeline(self.robot, self.params)
        height_m = self.robot.lidar_xyz_m[2]
        self._watch, self._overhead_watch = (Watch(self.params.watch, height_m) for _ in range(2))
        self._excused = too_near(self.robot, load_docks().latched_wheelchair(), self.params.watch)
        self._outputs = PerceptionOutputs(self, self._pipeline.grid, self._pipeline.people)
        self.subscribe(topics.ODOM, self._on_odometry)
        self.subscribe(topics.IMU, self._on_imu)
        self.subscribe(topics.LATCH_STATUS, self._on_latch)
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

    def _on_latch(self, message: LatchStatus) -> None:
        """Without a latched wheelchair, points in front of the robot are obstacles."""
        self._pipeline.chair = message.closed

    def _on_half_sweep(self, message: CloudView) -> None:
        self._take(message, full=False)

    def _on_full_sweep(self, message: CloudView) -> None:
        self._take(message, full=True)

    def _on_overhead(self, message: CloudView) -> None:
        """Its obstacles are published with the next half sweep. Missing data is detected by the safety monitor."""
        stamp_s = time_to_s(message.header.stamp)
        points, problem = self._look(message, frames.OVERHEAD_LIDAR, self._overhead_watch)
        problem = problem or self._pipeline.motion.problem(stamp_s)
        if points is not None and not problem:
            self._pipeline.overhead(points, stamp_s)
        self.report.values["overhead LiDAR"] = problem or "seen"

    def _look(self, message: CloudView, sensor: str, watch: Watch) -> tuple[Points | None, str]:
        """The points of a sensor's sweep or frame, or None and why they cannot be used."""
        stamp_s = time_to_s(message.header.stamp)
        if message.header.frame_id != sensor:
            return None, f"frame_id is {message.header.frame_id!r}, must be {sensor!r}"
        try:
            points = points_of(message, SWEEP)
        except ValueError as error:
            return None, str(error)
        problem = watch.stamp_problem(stamp_s, self.now_s())
        if not problem and watch.frozen(points):
            problem = "frozen: equal to earlier points"
        return (None, problem) if problem else (points, "")

    # --- work --------------------------------------------------------------------------------------------------------

    def _take(self, message: CloudView, *, full: bool) -> None:
        self._outputs.hold_back()
        stamp_s = time_to_s(message.header.stamp)
        points, problem = self._look(message, frames.LIDAR, self._watch)
        if points is not None:
            problem = self._watch.blind(points, stamp_s, self._excused if self._pipeline.chair else None)
        problem = problem or self._pipeline.motion.problem(stamp_s)
        if points is None or problem:
            self.set_health(False, f"{'full' if full else 'half'} sweep: {problem}")
            return
        scene = self._pipeline.scene(points, stamp_s, self._watch.obstructed)
        self._outputs.publish(scene, message.header.stamp, twice=full)
        level = self._pipeline.motion.attitude_at(stamp_s) is not None
        self.set_health(True, "obstacles are seen" if level else "obstacles are seen, without the attitude")
        self.report.values |= {
            "obstacle points": str(len(scene.obstacles)),
            "points not finite": str(scene.broken),
            "obstructed directions": str(int(self._watch.obstructed.sum())),
            "sweeps": "full" if full else "half",
        }

    def _tick(self) -> None:
        """Handles missing messages: silence, and a driver without half sweeps."""
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
        """Full sweeps are 36 MB/s: they are subscribed to only if there are no half sweeps."""
        if not self.count_publishers(topics.LIDAR_POINTS.name):
            self._driver_since_s = math.inf
            return False
        self._driver_since_s = min(self._driver_since_s, self.steady_s())
        waited_s = min(self._halves.age_s(), self.steady_s() - self._driver_since_s)
        return waited_s > self.params.output.full_sweep_after_s

    def _leave_full_sweeps(self) -> None:
        if self._fulls is not None:
            self.unsubscribe(self._fulls)
        self._fulls = None
