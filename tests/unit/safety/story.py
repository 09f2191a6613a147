"""A robot on which everything is well unless a story says otherwise, in fake time.

``run`` advances the clock tick by tick and feeds the monitor what the story's switches say. What is set to None is
silent. Every tick brings new IMU noise, as a living sensor does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.config import load
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.robot import load_robot
from robot_stack.safety.arbiter import Verdict
from robot_stack.safety.inputs import Axis, DriveReading, ImuSample
from robot_stack.safety.monitor import Memory, ResetAnswer, SafetyMonitor
from robot_stack.safety.params import SafetyParams

ROBOT = load_robot()
PARAMS = load(SafetyParams, "safety_monitor")
TICK_S = 0.01
G = 9.81
_BEARINGS = np.linspace(-math.pi, math.pi, 90)
SWEEP = np.stack([8.0 * np.cos(_BEARINGS), 8.0 * np.sin(_BEARINGS), 0.0 * _BEARINGS], axis=1).astype(np.float32)
NOTHING = np.empty((0, 3), np.float32)
GOOD_AXIS = Axis(servo_on=True, amp_alarm=False, following_error=False)


def params(**changes: Any) -> SafetyParams:
    """The shipped parameters with some of them changed."""
    return SafetyParams(**{**PARAMS.model_dump(), **changes})


class Story:
    """Switches, a clock and expectations around one monitor."""

    def __init__(self, start_s: float = 100.0, memory: Memory | None = None, **changes: Any) -> None:
        self.params = params(**changes)
        self.now_s = start_s
        self.monitor = SafetyMonitor(self.params, ROBOT, memory or Memory(), start_s)
        self.ticks = 0
        self.verdict: Verdict = self.monitor.step(start_s)
        self.communicating: bool | None = True
        self.axes: list[Axis] = [GOOD_AXIS] * len(JOINTS)
        self.wheel_radps: float | None = 0.0
        self.imu_tilt_deg: float | None = 0.0
        self.imu_frozen = False
        self.pose_m: tuple[float, float] | None = (1.0, 2.0)
        self.quality: float | None = 0.9
        self.battery: float | None = 0.8
        self.docking: str | None = None
        self.cameras: list[str] = []
        self.sweep: NDArray[np.float32] | None = SWEEP
        self.sweep_frozen = False
        self.obstacles: NDArray[np.float32] | None = NOTHING
        self.driven: Twist2 | None = ZERO_TWIST
        self.wish: Twist2 | None = None
        self.dock: Pose2 | None = None
        self.beating: set[str] = set(self.params.expected_processes)

    def healthy(self) -> Story:
        """Runs until everything has cleared."""
        self.run(3.0)
        return self.expect(SafetyState.NORMAL)

    def run(self, duration_s: float) -> Story:
        for _ in range(round(duration_s / TICK_S)):
            self.tick()
        return self

    def before(self, moment_s: float) -> Story:
        """Runs until one tick before ``moment_s`` from now: a limit of that length must still be kept."""
        return self.run(moment_s - TICK_S)

    def past(self) -> Story:
        """After ``before``: runs one tick beyond that moment. The exact moment is a matter of rounding."""
        return self.run(2 * TICK_S)

    def tick(self, dt_s: float = TICK_S) -> Story:
        self.now_s += dt_s
        self.ticks += 1
        self._feed()
        return self.step()

    def step(self) -> Story:
        self.verdict = self.monitor.step(self.now_s)
        return self

    def estop(self, pressed: bool) -> Story:
        self.monitor.observation.emergency_stop(pressed, self.now_s)
        return self.step()

    def reset(self) -> ResetAnswer:
        answer = self.monitor.reset(self.now_s)
        self.step()
        return answer

    def axis(self, index: int, **changes: bool) -> Story:
        self.axes[index] = replace(self.axes[index], **changes)
        return self

    def restarted(self) -> Story:
        """The story after a crash of the monitor: a new one with the old one's memory."""
        return Story(self.now_s, self.monitor.memory)

    def expect(
        self,
        state: SafetyState,
        faults: Sequence[str] | None = None,
        *,
        linear_mps: float | None = None,
        reason: str | None = None,
        action: SafetyAction | None = None,
    ) -> Story:
        wanted = (state, tuple(faults) if faults is not None else self.verdict.faults)
        assert (self.verdict.state, self.verdict.faults) == wanted, f"at {self.now_s:.2f} s: {self.monitor.details}"
        if state is SafetyState.EMERGENCY_STOP:
            assert self.monitor.emergency
            assert self.verdict.limit.linear_mps == self.verdict.limit.angular_radps == 0.0
        if linear_mps is not None:
            assert self.verdict.limit.linear_mps == linear_mps
        if reason is not None:
            assert self.verdict.reason == reason
        if action is not None:
            assert self.verdict.action is action
        return self

    def _feed(self) -> None:
        inputs, now_s = self.monitor.observation, self.now_s
        for process in self.beating:
            inputs.heartbeat(process, now_s)
        if self.communicating is not None:
            inputs.engine(DriveReading(self.communicating, self.ticks, tuple(self.axes)), now_s)
        if self.wheel_radps is not None:
            velocity = [self.wheel_radps, 0.0] * 4
            inputs.joint_states(JOINTS, [0.0] * len(JOINTS), velocity, now_s)
        if self.imu_tilt_deg is not None:
            inputs.imu(self._imu_sample(math.radians(self.imu_tilt_deg)), now_s)
        if self.pose_m is not None:
            inputs.pose(*self.pose_m, now_s)
        if self.quality is not None:
            inputs.quality(self.quality, now_s)
        if self.battery is not None:
            inputs.battery(self.battery, now_s)

        if self.docking is not None:
            inputs.docking(self.docking, now_s)
        for camera in self.cameras:
            inputs.camera(camera, now_s)
        if self.driven is not None:
            inputs.commands.limited(self.driven, now_s)
        if self.wish is not None:
            inputs.commands.wish("/cmd_vel", self.wish, now_s)
        if self.dock is not None:
            inputs.surroundings.dock(self.dock, 0.0, now_s)
        if self.ticks % 5 == 0:
            self._feed_surroundings()

    def _feed_surroundings(self) -> None:
        inputs, now_s = self.monitor.observation, self.now_s
        if self.sweep is not None:
            noise = 0.0 if self.sweep_frozen else 1e-6 * self.ticks
            inputs.lidar.received(self.sweep * np.float32(1.0 + noise), 50 * len(self.sweep), now_s)
        if self.obstacles is not None:
            inputs.obstacles(self.obstacles, 0.0, now_s)

    def _imu_sample(self, tilt_rad: float) -> ImuSample:
        noise = 0.0 if self.imu_frozen else 1e-9 * (1 + self.ticks)
        return ImuSample(-G * math.sin(tilt_rad), 0.0, G * math.cos(tilt_rad), noise, 0.0, 0.0)
