"""Records a ride from the topics of stack and world, for every way to run them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from std_msgs.msg import String

from custom_msgs.msg import DockingStatus, MissionStatus, SafetyStatus, VelocityLimit
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.contract.states import DOCKING
from robot_stack.middleware.conversions import pose_from_msg, pose_from_transform, time_to_s
from sim.run.ride import Ride, Sample, Step
from tf2_msgs.msg import TFMessage

_WHEELCHAIR = "wheelchair"  # its frame in /sim/bodies


class RideNotes:
    """``ride`` grows with each message; its times are the world's, from ``begin`` on.

    subscribe: called with each row of interest and what takes its messages.
    """

    def __init__(self, subscribe: Callable[[Topic, Callable[[Any], None]], None]) -> None:
        self.ride = Ride()
        self.mission: MissionStatus | None = None
        self.safety: SafetyStatus | None = None
        self.limit: VelocityLimit | None = None
        self.docking: DockingStatus | None = None
        self.moved_m = 0.0
        self._touched: tuple[str, ...] = ()
        self._begun_stamp_s: float | None = None
        for row, callback in (
            (topics.MISSION_STATUS, self._on_mission),
            (topics.SAFETY_STATUS, self._on_safety),
            (topics.VELOCITY_LIMIT, self._on_limit),
            (topics.SIM_GROUND_TRUTH, self._on_truth),
            (topics.CURRENT_POSE, self._on_pose),
            (topics.PLAN, self._on_plan),
            (topics.SIM_BODIES, self._on_bodies),
            (topics.DOCKING_STATUS, self._on_docking),
            (topics.SIM_TOUCHED, self._on_touched),
        ):
            subscribe(row, callback)

    @property
    def world_s(self) -> float:
        """The world's time since ``begin``: that of the newest sample."""
        return self.ride.samples[-1].time_s if self.ride.samples else 0.0

    def may_move(self) -> bool:
        """True if nothing stops the robot; on a slope its speed may still be limited."""
        limit = self.limit
        return limit is not None and limit.max_linear_velocity > 0.0 and self.safety is not None

    def docking_now(self) -> bool:
        """True during a docking, in which the robot may stand for a while."""
        return self.docking is not None and self.docking.state in DOCKING

    def begin(self) -> None:
        """The ride begins with the newest sample; what was noted before is dropped."""
        here = self.ride.samples[-1]
        assert self._begun_stamp_s is not None
        self._begun_stamp_s += here.time_s
        self.ride = Ride(
            samples=[Sample(0.0, here.pose, here.speed_mps)],
            plans=[(0.0, line) for _, line in self.ride.plans[-1:]],
            touched=self._touched,
            limits=[(0.0, speed_mps, reason) for _, speed_mps, reason in self.ride.limits[-1:]],
            docking=[(0.0, state) for _, state in self.ride.docking[-1:]],
        )
        if self.mission is not None:
            self._on_mission(self.mission)
        self.moved_m = 0.0

    def _on_mission(self, message: MissionStatus) -> None:
        self.mission = message
        step = Step(self.world_s, message.state, message.current_waypoint, message.reason)
        if not self.ride.steps or replace(self.ride.steps[-1], time_s=step.time_s) != step:
            self.ride.steps.append(step)

    def _on_safety(self, message: SafetyStatus) -> None:
        self.safety = message

    def _on_limit(self, message: VelocityLimit) -> None:
        self.limit = message
        self.ride.limits.append((self.world_s, message.max_linear_velocity, message.reason))

    def _on_truth(self, message: Odometry) -> None:
        pose, linear = pose_from_msg(message.pose.pose), message.twist.twist.linear
        samples, stamp_s = self.ride.samples, time_to_s(message.header.stamp)
        if self._begun_stamp_s is None:
            self._begun_stamp_s = stamp_s
        if samples:
            last = samples[-1].pose
            self.moved_m += math.hypot(pose.x - last.x, pose.y - last.y)
        samples.append(Sample(stamp_s - self._begun_stamp_s, pose, math.hypot(linear.x, linear.y)))

    def _on_bodies(self, message: TFMessage) -> None:
        for item in message.transforms:
            if item.child_frame_id == _WHEELCHAIR:
                self.ride.wheelchair.append((self.world_s, pose_from_transform(item.transform)))

    def _on_docking(self, message: DockingStatus) -> None:
        if self.docking is None or self.docking.state != message.state:
            self.ride.docking.append((self.world_s, message.state))
        self.docking = message

    def _on_touched(self, message: String) -> None:
        self._touched = tuple(filter(None, message.data.split(",")))
        self.ride.touched = self._touched

    def _on_pose(self, message: PoseStamped) -> None:
        if self._begun_stamp_s is not None:
            time_s = time_to_s(message.header.stamp) - self._begun_stamp_s
            self.ride.estimates.append((time_s, pose_from_msg(message.pose)))

    def _on_plan(self, message: Path) -> None:
        points = [(item.pose.position.x, item.pose.position.y) for item in message.poses]
        self.ride.plans.append((self.world_s, np.array(points, dtype=np.float64).reshape(-1, 2)))
