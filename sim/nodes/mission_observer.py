"""The passenger's seat: starts a mission as the touch screen would, and notes what happens on the ride."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from std_msgs.msg import String

from custom_msgs.msg import DockingStatus, MissionStatus, SafetyStatus, UICommand, VelocityLimit
from robot_stack.cli.nodes.operator import Operator
from robot_stack.contract import topics
from robot_stack.core.world_clock import WorldClock
from robot_stack.ros.conversions import pose_from_msg, pose_from_transform, time_to_s
from sim.run.ride import Ride, Sample, Step
from tf2_msgs.msg import TFMessage

_ANSWER_S = 10.0
_WHEELCHAIR = "wheelchair"  # its frame in /sim/bodies


class MissionObserver:
    """A context manager. ``ride`` grows while ``wait`` waits; its times count from the start of the mission.

    They are times of the world, which may run slower than the clock on the wall: that one is ``now_s``.
    """

    def __init__(self) -> None:
        self.ride = Ride()
        self._touched: tuple[str, ...] = ()
        self.mission: MissionStatus | None = None
        self.safety: SafetyStatus | None = None
        self.limit: VelocityLimit | None = None
        self.docking: DockingStatus | None = None
        self.moved_m = 0.0
        self.heard_s = math.nan  # when the world was heard last, as ``now_s`` counts
        self._begun_s = time.monotonic()
        self._begun_stamp_s: float | None = None
        self._operator = Operator()
        self._commands = self._operator.advertise(topics.UI_COMMAND)
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
            self._operator.subscribe(row, callback)

    def __enter__(self) -> MissionObserver:
        return self

    def __exit__(self, *_: object) -> None:
        self._operator.__exit__()

    @property
    def operator(self) -> Operator:
        """Whose node listens and speaks."""
        return self._operator

    def now_s(self) -> float:
        return time.monotonic() - self._begun_s

    @property
    def world_s(self) -> float:
        """The world's time since the start of the mission: that of the newest sample."""
        return self.ride.samples[-1].time_s if self.ride.samples else 0.0

    @property
    def pace(self) -> float:
        """Simulated over real time in the last second; 0 where nobody tells it."""
        clock = WorldClock.find()
        return 0.0 if clock is None else clock.pace

    @property
    def waiting_for(self) -> str:
        """For which nodes the world stands still, and why; empty while it goes on."""
        clock = WorldClock.find()
        return "" if clock is None else clock.waiting_for

    def may_move(self) -> bool:
        """Nothing stops the robot; on a slope it may still have to be slow."""
        limit = self.limit
        return limit is not None and limit.max_linear_velocity > 0.0 and self.safety is not None

    def docking_now(self) -> bool:
        """A docking is under way, in which the robot may stand for a while."""
        return self.docking is not None and self.docking.state not in ("IDLE", "DOCKED", "FAILED")

    def wait(self, condition: Callable[[], Any], timeout_s: float | None) -> bool:
        """Takes notes until the condition holds (True) or the time is over (False)."""
        return self._operator.wait(condition, timeout_s)

    def board(self) -> None:
        """Waits until everything is heard. Raises TimeoutError."""
        heard = self.wait(
            lambda: self.mission and self.safety and self.ride.samples and self._commands.get_subscription_count(),
            _ANSWER_S,
        )
        if not heard:
            raise TimeoutError("the stack is silent: mission, safety or the world does not speak")

    def start(self, mission_id: str) -> None:
        """Sends START_MISSION on /ui/command. Raises TimeoutError without an answer, ValueError if it is refused."""
        self._command(UICommand.START_MISSION, mission_id)
        if self.mission is not None and not self.mission.last_command_accepted:
            raise ValueError(self.mission.reason)
        self._begun_s = time.monotonic()
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

    def _command(self, command_type: str, mission_id: str) -> None:
        self.mission = None
        # Without a stamp: the world's time may be another than this node's.
        self._commands.publish(UICommand(command_type=command_type, mission_id=mission_id))
        if not self.wait(lambda: self.mission and self.mission.last_command == command_type, _ANSWER_S):
            raise TimeoutError(f"the mission manager does not answer {command_type}")

    # --- notes -------------------------------------------------------------------------------------------------------

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
        samples = self.ride.samples
        stamp_s, self.heard_s = time_to_s(message.header.stamp), self.now_s()
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
