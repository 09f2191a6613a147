"""A simulated robot in fake time: /cmd_vel drives it with a delay, jerk and acceleration limits, and a lag."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.robot import Motion, load_robot
from robot_stack.navigation.controller import NavigationController, Output, Situation
from robot_stack.navigation.goal import GoalRequest
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.pose_source import Located

STEP_S = 0.01
ROBOT = load_robot()


def params(**overrides: object) -> NavigationParams:
    return load(NavigationParams, "navigation_controller", overrides)


@dataclass
class Drive:
    """Applies twists after ``delay_s``, lags by ``lag_s``, and keeps the robot's acceleration limits."""

    motion: Motion
    delay_s: float = 0.06
    lag_s: float = 0.04
    pose: Pose2 = IDENTITY
    twist: Twist2 = ZERO_TWIST
    blocked: bool = False
    _commands: deque[Twist2] = field(default_factory=deque)

    def step(self, command: Twist2) -> None:
        self._commands.append(command)
        requested = self._commands.popleft() if len(self._commands) > round(self.delay_s / STEP_S) else ZERO_TWIST
        self._follow(ZERO_TWIST if self.blocked else requested)
        self.pose = self.pose.compose(exp_se2(self.twist, STEP_S))

    def _follow(self, requested: Twist2) -> None:
        share, t, m = STEP_S / (self.lag_s + STEP_S), self.twist, self.motion
        dx, dy, dw = share * (requested.vx - t.vx), share * (requested.vy - t.vy), share * (requested.omega - t.omega)
        size, most = math.hypot(dx, dy), 1.2 * m.max_acceleration_mps2 * STEP_S
        factor = 1.0 if size <= most else most / size
        most = 1.2 * m.max_yaw_acceleration_radps2 * STEP_S
        self.twist = Twist2(t.vx + factor * dx, t.vy + factor * dy, t.omega + max(-most, min(most, dw)))


@dataclass
class Ride:
    """Controller and drive together, the controller at 20 Hz."""

    controller: NavigationController
    drive: Drive
    now_s: float = 50.0
    emergency_stop: bool = False
    manual: bool = False
    pose_known: bool = True
    outputs: list[Output] = field(default_factory=list)
    errors_m: list[float] = field(default_factory=list)

    def located(self) -> Located | None:
        return Located(self.drive.pose, self.drive.twist) if self.pose_known else None

    def go(self, goal: Pose2, **changes: object) -> str:
        return self.controller.request(
            request(goal, self.now_s, **changes), self.now_s, self.located(), emergency_stop=self.emergency_stop
        )

    def tick(self) -> Output:
        problem = "" if self.pose_known else "/current_pose silent"
        situation = Situation(self.now_s, self.located(), problem, self.emergency_stop, manual=self.manual)
        output = self.controller.tick(situation)
        self.outputs.append(output)
        for _ in range(5):
            self.drive.step(output.twist)
            self.now_s += STEP_S
        if output.planned is not None:
            self.errors_m.append(output.error.distance_m())
        return output

    def run(self, seconds: float) -> Ride:
        for _ in range(round(seconds / 0.05)):
            self.tick()
        return self

    def until_reached(self, limit_s: float = 120.0) -> Output:
        end_s = self.now_s + limit_s
        while self.now_s < end_s:
            output = self.tick()
            if output.reached:
                return output
        raise AssertionError(f"goal not reached in {limit_s} s: {self.outputs[-1]}, drive {self.drive}")


def request(goal: Pose2, stamp_s: float = 0.0, frame_id: str = "map") -> GoalRequest:
    half = 0.5 * goal.yaw
    return GoalRequest(frame_id, stamp_s, (goal.x, goal.y, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))


def ride(start: Pose2 = IDENTITY, departure: Departure | None = None, **overrides: object) -> Ride:
    return Ride(
        NavigationController(
            params(**overrides),
            ROBOT,
            "map",
            departure or Departure(load(DepartureParams, "departure"), announced=True),
        ),
        Drive(ROBOT.empty, pose=start),
    )
