"""A robot in fake time: what /cmd_vel does to a drive with a delay, jerk and acceleration limits, and a lag."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from robot_stack.core.config import load
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
    """Takes twists after ``delay_s``, limits jerk and acceleration on the way to them, and lags by ``lag_s``."""

    motion: Motion
    delay_s: float = 0.06
    lag_s: float = 0.03
    pose: Pose2 = IDENTITY
    twist: Twist2 = ZERO_TWIST
    blocked: bool = False
    _set_point: Twist2 = ZERO_TWIST
    _acceleration: Twist2 = ZERO_TWIST
    _commands: deque[Twist2] = field(default_factory=deque)

    def step(self, command: Twist2) -> None:
        self._commands.append(command)
        wish = self._commands.popleft() if len(self._commands) > round(self.delay_s / STEP_S) else ZERO_TWIST
        self._approach(ZERO_TWIST if self.blocked else wish)
        share = STEP_S / (self.lag_s + STEP_S)
        t, s = self.twist, self._set_point
        vx, vy = t.vx + share * (s.vx - t.vx), t.vy + share * (s.vy - t.vy)
        self.twist = Twist2(vx, vy, t.omega + share * (s.omega - t.omega))
        self.pose = self.pose.compose(exp_se2(self.twist, STEP_S))

    def _approach(self, wish: Twist2) -> None:
        """Each of translation and yaw: as fast as it can still come to rest at the wish."""
        m = self.motion
        dx, dy, dw = wish.vx - self._set_point.vx, wish.vy - self._set_point.vy, wish.omega - self._set_point.omega
        size = math.hypot(dx, dy)
        a = min(m.max_acceleration_mps2, math.sqrt(2.0 * m.max_jerk_mps3 * size), size / STEP_S)
        b = min(m.max_yaw_acceleration_radps2, math.sqrt(2.0 * m.max_yaw_jerk_radps3 * abs(dw)), abs(dw) / STEP_S)
        wanted = Twist2(a * dx / size if size else 0.0, a * dy / size if size else 0.0, math.copysign(b, dw))
        now = self._acceleration
        jx, jy = wanted.vx - now.vx, wanted.vy - now.vy
        jump, most = math.hypot(jx, jy), m.max_jerk_mps3 * STEP_S
        part = 1.0 if jump <= most else most / jump
        most = m.max_yaw_jerk_radps3 * STEP_S
        turn = max(-most, min(most, wanted.omega - now.omega))
        self._acceleration = now = Twist2(now.vx + part * jx, now.vy + part * jy, now.omega + turn)
        s = self._set_point
        self._set_point = Twist2(s.vx + now.vx * STEP_S, s.vy + now.vy * STEP_S, s.omega + now.omega * STEP_S)


@dataclass
class Ride:
    """Controller and drive together, the controller at 20 Hz."""

    controller: NavigationController
    drive: Drive
    now_s: float = 50.0
    emergency_stop: bool = False
    pose_known: bool = True
    outputs: list[Output] = field(default_factory=list)
    errors_m: list[float] = field(default_factory=list)

    def located(self) -> Located | None:
        return Located(self.drive.pose, self.drive.twist) if self.pose_known else None

    def go(self, goal: Pose2, **changes: object) -> str:
        return self.controller.request(request(goal, self.now_s, **changes), self.now_s, self.located())

    def tick(self) -> Output:
        problem = "" if self.pose_known else "/current_pose silent"
        output = self.controller.tick(Situation(self.now_s, self.located(), problem, self.emergency_stop))
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


def ride(start: Pose2 = IDENTITY, **overrides: object) -> Ride:
    return Ride(NavigationController(params(**overrides), ROBOT, "map"), Drive(ROBOT.empty, pose=start))
