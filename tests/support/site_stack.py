"""The whole stack on the demonstration site with its map, as tests drive, blind and carry it about."""

from __future__ import annotations

import math
from pathlib import Path

from custom_msgs.srv import InjectFault
from robot_stack.contract import frames, services, topics
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped
from sim.settings import FEW_BEAMS, pose_settings, world_settings
from tests.support.stack import StackUnderTest, true_pose
from tests.support.waiting import wait_for


class SiteUnderTest(StackUnderTest):
    """Without people. wrong_by: the believed start, seen from the true one."""

    def __init__(self, logs: Path, start: Pose2, wrong_by: Pose2) -> None:
        super().__init__(
            logs,
            *world_settings("yard"),
            *FEW_BEAMS,
            *pose_settings("sim_world.start", start),
            *pose_settings("ndt_localization.start", start.compose(wrong_by)),
            "sim_world.people=false",
        )
        self.pose = self.peer.listen(topics.CURRENT_POSE)
        self.quality = self.peer.listen(topics.LOCALIZATION_QUALITY)
        self.quality.wait(lambda _: True, "a quality of the pose")
        self.bodies = self.peer.listen(topics.SIM_BODIES)
        self.navigation = self.peer.listen(topics.NAVIGATION_STATUS)
        self.plan = self.peer.listen(topics.PLAN)
        self._touched = self.peer.listen(topics.SIM_TOUCHED)
        self.peer.wait_matched(topics.GOAL_POSE)
        self.pose.wait(lambda _: True, "a pose")

    def make_ready(self) -> None:
        self.inject_lidar("clear")
        super().make_ready()

    def inject_lidar(self, kind: str, value: float = 0.0) -> None:
        answer = self.peer.call(services.INJECT_LIDAR_FAULT, InjectFault.Request(kind=kind, value=value))
        assert answer.success, answer.message

    def estimate_error_m(self) -> float:
        """While the robot stands."""
        return self.at().distance_to(pose_from_msg(self.pose.last.pose))

    def touched(self) -> str:
        return str(self._touched.last.data) if self._touched.last is not None else ""

    def wheelchair(self) -> Pose2:
        return true_pose(self.bodies.last, "wheelchair")

    def place(self, pose: Pose2) -> None:
        """Carries the standing robot to a place and waits until it has found itself there."""
        self.wait_stands()
        by = pose.relative_to(self.at())
        if by.x or by.y or by.yaw:
            self.inject("robot_moved", f"{by.x:.4f},{by.y:.4f},{math.degrees(by.yaw):.3f}")
        wait_for(lambda: self.at().distance_to(pose) < 0.05, "the robot is put down")
        wait_for(lambda: self.estimate_error_m() < 0.10 and self.quality.last.data > 0.5, "the pose is found", 60.0)
        self.wait_safety("NORMAL", deadline_s=30.0)

    def go(self, pose: Pose2) -> None:
        message = pose_stamped(pose, frames.MAP, self.pose.last.header.stamp)
        message.header.stamp.sec = message.header.stamp.nanosec = 0
        self.peer.publish(topics.GOAL_POSE, message)
