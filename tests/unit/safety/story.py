"""A simulated robot in fake time on which all inputs are healthy unless a story changes them.

``run`` advances the clock tick by tick and feeds the inputs to the monitor. An input that is None is not sent. Every
tick brings new IMU noise, as a real sensor does.
"""

from __future__ import annotations

import math
import os
import pickle
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.faults import split_codes
from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.config import load
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.robot import load_robot
from robot_stack.safety.arbiter import Verdict
from robot_stack.safety.button import Contact
from robot_stack.safety.inputs import Axis, DriveReading, EdgeReading, ImuSample, LatchReading
from robot_stack.safety.monitor import Memory, ResetAnswer, SafetyMonitor
from robot_stack.safety.params import SafetyParams
from robot_stack.safety.stop_sources import SourceReport

ROBOT = load_robot()
PARAMS = load(SafetyParams, "safety_monitor")
TICK_S = 0.01
G = 9.81
_BEARINGS = np.linspace(-math.pi, math.pi, 90)
SWEEP = np.stack([8.0 * np.cos(_BEARINGS), 8.0 * np.sin(_BEARINGS), 0.0 * _BEARINGS], axis=1).astype(np.float32)
NOTHING = np.empty((0, 3), np.float32)
NOTHING_MOVES = np.empty((0, 5), np.float32)
OPEN = LatchReading(closed=False, open=True, opening=False)
CLOSED = LatchReading(closed=True, open=False, opening=False)
GOOD_AXIS = Axis(servo_on=True, amp_alarm=False, following_error=False)
_HEALTHY: dict[bytes, bytes] = {}  # pickled stories, initial state -> state after all faults have cleared


def params(**changes: Any) -> SafetyParams:
    """The shipped parameters with ``changes`` applied."""
    return SafetyParams(**{**PARAMS.model_dump(), **changes})


class Story:
    """The inputs of one monitor, its clock, and assertions on its verdict."""

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
        self.overhead: NDArray[np.float32] | None = SWEEP
        self.sweep_frozen = False
        self.overhead_frozen = False
        self.obstacles: NDArray[np.float32] | None = NOTHING
        self.unseen: NDArray[np.float32] | None = NOTHING
        self.no_ground: NDArray[np.float32] | None = NOTHING
        self.moving: NDArray[np.float32] | None = NOTHING_MOVES
        self.driven: Twist2 | None = ZERO_TWIST
        self.request: Twist2 | None = None
        self.dock: Pose2 | None = None
        self.button = Contact.RELEASED
        self.latch: LatchReading | None = OPEN
        self.edge: EdgeReading | None = EdgeReading()
        self.usage: tuple[float, float, float] | None = (20.0, 40.0, 60.0)
        self.temperature_c: float | None = 50.0
        self.ehmi_linked = self.ui_connected = False
        self.beating: set[str] = set(self.params.expected_processes)
        self.presses: dict[str, int] = {}
        self.pressed: dict[str, bool] = {}
        self.reporting: set[str] = {"emergency_stop_button", "touch_ui"}

    def healthy(self) -> Story:
        """Runs until all faults have cleared. Equal stories are computed once, since equal input gives equal state."""
        begun = pickle.dumps((os.getpid(), self))  # mutants run in forks, which must not share results
        if begun not in _HEALTHY:
            _HEALTHY[begun] = pickle.dumps(self.run(3.0).expect(SafetyState.NORMAL))
        self.__dict__ = pickle.loads(_HEALTHY[begun]).__dict__
        return self

    def run(self, duration_s: float) -> Story:
        for _ in range(round(duration_s / TICK_S)):
            self.tick()
        return self

    def before(self, moment_s: float) -> Story:
        """Runs until one tick before ``moment_s`` from now, when a limit of that length must not have expired yet."""
        return self.run(moment_s - TICK_S)

    def past(self) -> Story:
        """After ``before``: runs until one tick after that moment. The exact moment depends on rounding."""
        return self.run(2 * TICK_S)

    def tick(self, dt_s: float = TICK_S) -> Story:
        self.now_s += dt_s
        self.ticks += 1
        self._feed()
        return self.step()

    def step(self) -> Story:
        self.verdict = self.monitor.step(self.now_s)
        return self

    def estop(self, pressed: bool, source: str | None = "touch_ui") -> Story:
        """Sends a message on /emergency_stop and its report. With source None no report is sent."""
        self.monitor.observation.emergency_stop(pressed, self.now_s)
        if source is not None:
            self.presses[source] = self.presses.get(source, 0) + pressed
            self.pressed[source] = pressed
            self.report(source)
        return self.step()

    def report(self, source: str, pid: int = 1) -> None:
        """Sends one message on /emergency_stop/sources."""
        report = SourceReport(source, pid, self.presses.get(source, 0), self.pressed.get(source, False))
        self.monitor.observation.stop_source(report, self.now_s)

    def carry(self, attached: bool = True) -> Story:
        """Sets the state of a wheelchair on the closed latch."""
        self.latch = CLOSED if attached else OPEN
        self.monitor.observation.chair.contacts(self.latch)
        self.monitor.observation.chair.on_passenger(attached)
        return self

    def clear(self, source: str) -> ResetAnswer:
        answer = self.monitor.clear(source, self.now_s)
        self.step()
        return answer

    def reset(self) -> ResetAnswer:
        answer = self.monitor.reset(self.now_s)
        self.step()
        return answer

    def axis(self, index: int, **changes: bool) -> Story:
        self.axes[index] = replace(self.axes[index], **changes)
        return self

    def restarted(self) -> Story:
        """Returns a new story with this one's memory, as after a crash of the monitor."""
        story = Story(self.now_s, self.monitor.memory)
        story.presses, story.pressed, story.latch = dict(self.presses), dict(self.pressed), self.latch
        return story

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
            assert self.verdict.limit.codes == split_codes(reason)
        if action is not None:
            assert self.verdict.action is action
        return self

    def _feed(self) -> None:
        inputs, now_s = self.monitor.observation, self.now_s
        for process in self.beating:
            inputs.heartbeat(process, now_s)
        for source in self.reporting if self.ticks % 20 == 0 else ():
            self.report(source)
        if self.communicating is not None:
            axes = tuple(self.axes)
            reading = DriveReading(self.communicating, self.ticks, axes, self.button, self.latch, self.edge)
            inputs.engine(reading, now_s)
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
        self._feed_computer()
        if self.docking is not None:
            inputs.docking(self.docking, now_s)
        for camera in self.cameras:
            inputs.camera(camera, now_s)
        if self.driven is not None:
            inputs.commands.limited(self.driven, now_s)
        if self.request is not None:
            inputs.commands.request("/cmd_vel", self.request, now_s)
        if self.dock is not None:
            inputs.surroundings.dock(self.dock, 0.0, now_s)
        if self.ticks % 5 == 0:
            self._feed_surroundings()

    def _feed_computer(self) -> None:
        inputs, now_s = self.monitor.observation, self.now_s
        if self.usage is not None:
            inputs.computer.usage(*self.usage, now_s)
        if self.temperature_c is not None:
            inputs.computer.temperature(self.temperature_c, now_s)
        if self.ehmi_linked:
            inputs.ehmi.alive(now_s)
        if self.ui_connected:
            inputs.ui.alive(now_s)

    def _feed_surroundings(self) -> None:
        inputs, now_s = self.monitor.observation, self.now_s
        if self.sweep is not None:
            noise = 0.0 if self.sweep_frozen else 1e-6 * self.ticks
            inputs.lidar.received(self.sweep * np.float32(1.0 + noise), 50 * len(self.sweep), now_s)
        if self.overhead is not None:
            noise = 0.0 if self.overhead_frozen else 1e-6 * self.ticks
            inputs.overhead_lidar.received(self.overhead * np.float32(1.0 + noise), 50 * len(self.overhead), now_s)
        if self.obstacles is not None:
            inputs.obstacles(self.obstacles, 0.0, now_s)
        if self.unseen is not None:
            inputs.surroundings.unseen_received(self.unseen, 0.0, now_s)
        if self.no_ground is not None:
            inputs.surroundings.no_ground_received(self.no_ground, 0.0, now_s)
        if self.moving is not None:
            inputs.surroundings.moving_received(self.moving, 0.0, now_s)

    def _imu_sample(self, tilt_rad: float) -> ImuSample:
        noise = 0.0 if self.imu_frozen else 1e-9 * (1 + self.ticks)
        return ImuSample(-G * math.sin(tilt_rad), 0.0, G * math.cos(tilt_rad), noise, 0.0, 0.0)
