"""One robot among moving bodies, in simulated time: sensors, perception, safety monitor and drive, each at its rate.

Each node's phase is drawn from the seed, and each message has the delay measured on the whole stack.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from robot_stack.contract import topics
from robot_stack.contract.states import DockingState
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.robot import Robot, load_robot
from robot_stack.drive.arbitration import Source
from robot_stack.safety.arbiter import Verdict
from robot_stack.safety.collision import Outline, outline_of
from sim.camera.history import BASE
from sim.lidar.scene import WHEELCHAIR
from sim.lidar.shapes import Shape
from tests.benchmarks.support import people_senses as senses
from tests.benchmarks.support.people_robot import ACTUATION_S, DrivenRobot
from tests.benchmarks.support.people_terrain import LEVEL_TERRAIN, Terrain, level

STEP_S = 0.005
# docs/figures.md: points_to_obstacles_ms_p95 28.0, plus the transport of the LiDAR driver's message.
PERCEPTION_S = 0.035
TRANSPORT_S = 0.002
# Mean delay from a body's position to braking: half a turn of the LiDAR, half a tick of monitor and drive.
_TICKS_S = 0.01 + 0.5 / topics.WHEEL_COMMANDS.nominal_rate_hz
REACTION_S = 0.5 * senses.SWEEP_S + PERCEPTION_S + TRANSPORT_S + _TICKS_S + ACTUATION_S
_REQUEST_S, _BEGIN_S = 0.05, 100.0
_SETTLE_S, _DRIVE_IN_MPS, _CREEP_MPS, _CREEP_M = 1.0, 0.5, 0.1, 0.4
_TOPIC = {Source.TELEOP: topics.TELEOP_CMD_VEL, Source.DOCKING: topics.DOCKING_CMD_VEL}


class Stage:
    """``advance`` moves everything by one step of 5 ms.

    poses: in map, of the moving bodies; written by the caller. chair: the robot carries wheelchair and passenger. dock:
    pose of a wheelchair on the robot's final approach. guarded: if False, the safety monitor's limit is ignored.
    terrain: the ground under the robot; level by default.
    """

    def __init__(
        self,
        seed: int,
        fixed: Iterable[Shape],
        movers: Mapping[str, Iterable[Shape]],
        *,
        chair: bool = False,
        dock: Pose2 | None = None,
        guarded: bool = True,
        terrain: Terrain = LEVEL_TERRAIN,
    ) -> None:
        self._random = np.random.default_rng([seed, 1])
        self.robot: Robot = load_robot()
        self.outline: Outline = outline_of(self.robot.footprint_with_chair if chair else self.robot.footprint)
        self.chair, self.dock, self._guarded = chair, dock, guarded
        self.now_s = _BEGIN_S
        self.poses: dict[str, Pose2] = {}
        self.body = DrivenRobot(self.robot, chair)
        self.requested, self.source = Twist2(0.0, 0.0, 0.0), Source.TELEOP
        self._terrain, self._wheels = terrain, np.array(self.robot.module_positions_m())
        self._castors = senses.castors()
        solid = [*terrain.shapes, *fixed]
        self._tracker = senses.SimulatedSensors(self.robot, solid, movers, seed, terrain.rects)
        self._perception = senses.Perception(self.robot, chair, self._random)
        self.params = senses.safety_params()
        self.monitor = senses.monitor(self.robot, self.params, chair, self.now_s)
        self.verdict: Verdict = self.monitor.step(self.now_s)
        self._where = senses.Whereabouts()
        self._steps = 0
        self._messages: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._tasks = self._nodes()

    def advance(self) -> None:
        self._steps += 1
        self.now_s = _BEGIN_S + self._steps * STEP_S
        self.body.move(self.now_s, STEP_S)
        self._note()
        for period, phase, task in self._tasks:
            if self._steps % period == phase:
                task()
        while self._messages and self._messages[0][0] <= self.now_s:
            heapq.heappop(self._messages)[2]()

    def drive_in(self, way_m: float = 3.0) -> None:
        """Drives straight to the start so that the sensors see the ground on the way; no limit applies.

        Without this way the ground before the chair is unseen, and the robot is not permitted to drive ahead.
        """
        guarded, self._guarded = self._guarded, False
        self.body.pose = self.body.pose.compose(Pose2(-way_m, 0.0, 0.0))
        driven_m = 0.0
        while driven_m < way_m:
            speed_mps = _DRIVE_IN_MPS if way_m - driven_m > _CREEP_M else _CREEP_MPS
            self.requested = Twist2(speed_mps, 0.0, 0.0) if self.now_s > _BEGIN_S + _SETTLE_S else ZERO_TWIST
            self.advance()
            driven_m += self.body.twist.speed() * STEP_S
        self.requested = ZERO_TWIST
        while self.body.twist != ZERO_TWIST:
            self.advance()
        self._guarded = guarded
        self.monitor = senses.monitor(self.robot, self.params, self.chair, self.now_s)  # discards its state

    def seen_from_robot(self, name: str) -> Pose2:
        """The pose of a mover in base_link."""
        return self.poses[name].relative_to(self.body.pose)

    def _nodes(self) -> list[tuple[int, int, Callable[[], None]]]:
        rates = (
            (1.0 / topics.JOINT_STATES.nominal_rate_hz, self._joint_states),
            (0.5 * senses.SWEEP_S, self._half_sweep),
            (senses.SWEEP_S, self._overhead),
            (1.0 / self.params.tick_hz, self._judge),
            (1.0 / topics.WHEEL_COMMANDS.nominal_rate_hz, self._drive),
            (_REQUEST_S, self._requested),
        )
        periods = [(round(period_s / STEP_S), task) for period_s, task in rates]
        return [(period, int(self._random.integers(period)), task) for period, task in periods]

    def _after(self, delay_s: float, task: Callable[[], None]) -> None:
        heapq.heappush(self._messages, (self.now_s + delay_s, next(self._order), task))

    def _note(self) -> None:
        terrain = self._terrain
        base = terrain.standing(self.body.pose, self._wheels)
        self._where.add(BASE, self.now_s, base)
        if terrain.shapes or len(terrain.rects):
            self._perception.attitude(terrain.attitude(base), self.now_s)
        if self.chair:
            chair = self.body.pose.compose(senses.chair_ahead())
            self._where.add(WHEELCHAIR, self.now_s, terrain.standing(chair, self._castors))
        elif self.dock is not None:
            self._where.add(WHEELCHAIR, self.now_s, level(self.dock))
        for name, pose in self.poses.items():
            self._where.add(name, self.now_s, level(pose))

    # --- nodes -------------------------------------------------------------------------------------------------------

    def _joint_states(self) -> None:
        states, twist = self.body.joint_states(), self.body.twist
        self._perception.odometry(twist, 1.0 / topics.JOINT_STATES.nominal_rate_hz, self.now_s)
        self._after(TRANSPORT_S, lambda: senses.joint_states(self.monitor, states, self.now_s))

    def _half_sweep(self) -> None:
        points, stamp_s = self._tracker.half_sweep(self.now_s, self._where.tracks()), self.now_s

        def deliver() -> None:
            scene = self._perception.scene(points, stamp_s)
            if scene is not None:
                observation, latency_s = self.monitor.observation, self.now_s - stamp_s
                observation.obstacles(scene.obstacles, latency_s, self.now_s)
                observation.surroundings.unseen_received(scene.unseen, latency_s, self.now_s)
                observation.surroundings.no_ground_received(scene.no_ground, latency_s, self.now_s)
                observation.surroundings.moving_received(scene.moving, latency_s, self.now_s)

        self._after(PERCEPTION_S, deliver)

    def _overhead(self) -> None:
        points, stamp_s = self._tracker.frame(self.now_s, self._where.tracks()), self.now_s
        self._after(PERCEPTION_S, lambda: self._perception.overhead(points, stamp_s))

    def _judge(self) -> None:
        observation = self.monitor.observation
        observation.commands.limited(self.body.set_point, self.now_s)
        if self.dock is not None:
            observation.docking(DockingState.FINE_ALIGN, self.now_s)
            observation.surroundings.dock(self.dock.relative_to(self.body.pose), 0.0, self.now_s)
        verdict = self.verdict = self.monitor.step(self.now_s)
        if self._guarded:
            self._after(TRANSPORT_S, lambda: self.body.obey(verdict))
        else:
            self.body.free()

    def _drive(self) -> None:
        self.body.tick(self.now_s)

    def _requested(self) -> None:
        requested, source, sent_s = self.requested, self.source, self.now_s

        def deliver() -> None:
            self.body.command(source, requested, sent_s + TRANSPORT_S)
            self.monitor.observation.commands.request(_TOPIC[source].name, requested, sent_s + TRANSPORT_S)

        self._after(TRANSPORT_S, deliver)
