"""A docking without physics: a robot that executes commands with a delay, a dock, a latch and a camera."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from robot_stack.contract import frames
from robot_stack.contract.states import DockingState
from robot_stack.core.camera import mounting
from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.docks import Dock, load_docks
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.goals import GoalStatus, NavigationEnded, SendGoal
from robot_stack.core.robot import load_robot
from robot_stack.docking.controller import DockingController
from robot_stack.docking.latch import LatchCommand, LatchInputs
from robot_stack.docking.params import DockingParams
from robot_stack.docking.results import Result
from robot_stack.docking.sighting import Marker
from robot_stack.docking.situation import Output, Safety, Situation

TICK_S = 0.05
_IMAGE_EVERY = 2  # ticks
_IMAGE_DELAY = 2  # ticks
_LATCH_TICKS = 8
_PARAMS = load(DockingParams, "docking_controller")
_DOCKS = load_docks()
_ROBOT = load_robot()
CAMERAS = {frame: mounting(_ROBOT, frame) for frame in (frames.FRONT_CAMERA, frames.REAR_CAMERA)}


def params() -> DockingParams:
    return _PARAMS


def dock(name: str) -> Dock:
    return _DOCKS.docks[name]


def planar(pose: Pose2) -> np.ndarray:
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.array([[c, -s, 0.0, pose.x], [s, c, 0.0, pose.y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def markers_at(dock_in_base: Pose2, dock: Dock, stamp_s: float, quality: float = 0.999) -> list[Marker]:
    """Returns the markers of a dock as an ideal camera of the robot measures them."""
    frame = dock.camera_frame
    camera_from_base = np.linalg.inv(CAMERAS[frame])
    board = camera_from_base @ planar(dock_in_base)
    return [Marker(stamp_s, frame, name, board @ place.pose(), quality) for name, place in dock.markers.items()]


@dataclass
class Faults:
    """Faults that a test can inject while a docking runs."""

    blind: bool = False  # images without markers
    camera_dead: bool = False  # no images
    odometry_dead: bool = False
    latch_dead: bool = False  # the engine cannot be read
    latch_stuck: bool = False
    no_confirm: bool = False
    stuck_wheels: bool = False
    force_n: float = 12.0
    quality: float = 0.999
    located: bool = True
    no_navigation: bool = False
    no_charge: bool = False  # the charging contacts give no power
    charge_for_s: float = math.inf  # of every 3 s in which they touch


@dataclass
class Bench:
    """A simulated docking. start: base_link in the frame of the dock pose (docked: 0, 0, 0)."""

    name: str = "chair_1"
    start: Pose2 = field(default_factory=lambda: Pose2(-1.5, 0.3, 0.2))
    dock_in_odom: Pose2 = field(default_factory=lambda: Pose2(3.0, -2.0, 1.0))
    noise_m: float = 0.0
    seed: int = 1
    faults: Faults = field(default_factory=Faults)
    departure: Departure = field(default_factory=lambda: Departure(load(DepartureParams, "departure"), announced=True))

    def __post_init__(self) -> None:
        self.dock = dock(self.name)
        self.controller = DockingController(_PARAMS, CAMERAS, self.departure)
        self.base = self.dock_in_odom.compose(self.dock.dock_pose.pose()).compose(self.start)
        self.safety = Safety(known=True)
        self.now_s = 100.0
        self.ticks = 0
        self.outputs: list[Output] = []
        self.states: list[DockingState] = []
        self.results: list[Result] = []
        self.goals: list[SendGoal] = []
        self.commands: deque[Twist2] = deque([ZERO_TWIST], maxlen=2)
        self.images: deque[tuple[int, list[Marker]]] = deque()
        self.images_s = self.now_s
        self.latch_position = 0  # 0 open .. _LATCH_TICKS closed
        self.command = LatchCommand.HOLD
        self.random = np.random.default_rng(self.seed)
        self.at_staging = True
        self.step()
        self.step()

    # --- interface of the tests --------------------------------------------------------------------------------------

    @property
    def error(self) -> Pose2:
        """base_link in the frame of the true dock pose."""
        return self.base.relative_to(self.dock_in_odom.compose(self.dock.dock_pose.pose()))

    @property
    def state(self) -> DockingState:
        return self.controller.state

    def begin(self) -> Result | None:
        return self.controller.dock(self.name, self.dock)

    def run(self, until: Callable[[], bool], limit_s: float = 120.0) -> bool:
        for _ in range(round(limit_s / TICK_S)):
            self.step()
            if until():
                return True
        return False

    def run_to_end(self, limit_s: float = 300.0) -> Result:
        before = len(self.results)
        assert self.run(lambda: len(self.results) > before, limit_s), f"no result: {self.outputs[-1].text}"
        return self.results[-1]

    def reach(self, state: DockingState, limit_s: float = 120.0) -> None:
        assert self.run(lambda: self.state is state, limit_s), f"never {state}: {self.outputs[-1].text}"

    def end_goal(self, status: GoalStatus, code: int = 0, reason: str = "") -> None:
        """Navigation ends the newest goal."""
        self.controller.on_navigation(NavigationEnded(self.goals[-1].call, status, code, reason))

    def docked(self) -> Bench:
        assert self.begin() is None
        assert self.run_to_end().success
        return self

    # --- one tick ----------------------------------------------------------------------------------------------------

    def step(self) -> None:
        self.now_s += TICK_S
        self.ticks += 1
        self._drive()
        self._latch()
        if not self.faults.odometry_dead:
            self.controller.on_odometry(self.now_s, self.base)
        self._see()
        output = self.controller.tick(self.situation())
        self.outputs.append(output)
        if not self.states or self.states[-1] is not output.state:
            self.states.append(output.state)
        self.commands.append(output.twist or ZERO_TWIST)
        self.command = output.latch
        if output.result is not None:
            self.results.append(output.result)
        if output.goal is not None:
            self.goals.append(output.goal)

    def situation(self) -> Situation:
        f = self.faults
        staging = self.goals[-1].pose if self.goals else self.dock.staging.pose()
        located = staging if self.at_staging else staging.compose(Pose2(5.0, 0.0, 0.0))
        return Situation(
            now_s=self.now_s,
            located=located if f.located else None,
            odom=None if f.odometry_dead else self.base,
            twist=None if f.odometry_dead else self.commands[0],
            safety=self.safety,
            images_fresh=self.now_s - self.images_s < 0.5,
            latch=LatchInputs() if f.latch_dead else self.inputs(),
            force_n=f.force_n,
            navigation_served=not f.no_navigation,
            charging=not f.no_charge
            and self.now_s % 3.0 < f.charge_for_s
            and math.hypot(self.error.x, self.error.y) < 0.02,
        )

    def inputs(self) -> LatchInputs:
        closed = self.latch_position == _LATCH_TICKS
        return LatchInputs(True, closed and not self.faults.no_confirm, self.latch_position == 0)

    def _drive(self) -> None:
        if not self.faults.stuck_wheels:
            self.base = self.base.compose(exp_se2(self.commands[0], TICK_S))

    def _latch(self) -> None:
        if self.faults.latch_stuck:
            return
        step = {LatchCommand.CLOSE: 1, LatchCommand.OPEN: -1, LatchCommand.HOLD: 0}[self.command]
        self.latch_position = min(max(self.latch_position + step, 0), _LATCH_TICKS)

    def _see(self) -> None:
        if self.ticks % _IMAGE_EVERY == 0 and not self.faults.camera_dead:
            found = [] if self.faults.blind else self._picture()
            self.images.append((self.ticks + _IMAGE_DELAY, found))
        while self.images and self.images[0][0] <= self.ticks:
            _, found = self.images.popleft()
            self.images_s = self.now_s
            self.controller.on_markers(found)

    def _picture(self) -> list[Marker]:
        seen = self.dock_in_odom.relative_to(self.base)
        dx, dy, dyaw = self.noise_m * self.random.standard_normal(3)
        noisy = Pose2(seen.x + dx, seen.y + dy, seen.yaw + 4.0 * dyaw)
        approach_sign = 1.0 if self.dock.camera == "front" else -1.0
        ahead = approach_sign * seen.x > 0.4 and abs(math.atan2(approach_sign * seen.y, approach_sign * seen.x)) < 0.75
        return markers_at(noisy, self.dock, self.now_s, self.faults.quality) if ahead else []


def stopped(faults: tuple[str, ...] = ("COLLISION_IMMINENT",)) -> Safety:
    return Safety(known=True, stopped=True, faults=faults)


def emergency() -> Safety:
    return replace(Safety(known=True), emergency=True, faults=("ESTOP_PRESSED",))
