"""The whole robot on the scheduler with operations and observations for tests. Truth is read from the world."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Bool

from custom_msgs.action import Dock, Undock
from custom_msgs.msg import UICommand
from robot_stack.contract import actions, frames, services, topics
from robot_stack.core.docks import Dock as DockRow
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped
from robot_stack.supervisor.lifecycle import State
from sim.run.scenario import Scenario
from sim.settings import pose_settings
from sim.stack.run import RunOptions, ScheduledRun
from sim.worldfile import Place
from tests.simulated.shared import shareable
from tests.simulated.story import Goal, Story

DOCK = "chair_1"
_STICK_PERIOD_S = 0.05
_SOURCE_PERIOD_S = 0.2
_STANDSTILL_MPS, _STANDSTILL_RADPS = 0.01, 0.02
_DOCKING_LIMIT_S = 60.0
# From the end of a process until all others have discovered the restarted one.
_KNOWN_AFTER_S = 1.0
_OPERATED = (
    topics.EMERGENCY_STOP,
    topics.TELEOP_CMD_VEL,
    topics.UI_COMMAND,
    topics.GOAL_POSE,
    topics.PASSENGER_ATTACHED,
)


class Stage(Story):
    """A robot that may drive. Use ``stack`` and ``world`` for functions without a method here.

    expected_failures: processes that may end by themselves. touches: what the robot may touch.
    """

    def __init__(self, ride: ScheduledRun) -> None:
        tool = ride.stack.test_tool
        super().__init__(ride.stack.scheduler, tool.port)
        self.ride, self.stack = ride, ride.stack
        self.expected_failures: set[str] = set()
        self.touches: set[str] = set()
        self.safety = self.listen(topics.SAFETY_STATUS)
        self.limit = self.listen(topics.VELOCITY_LIMIT)
        self.mission = self.listen(topics.MISSION_STATUS)
        self.commands = self.listen(topics.WHEEL_COMMANDS)
        self.odom = self.listen(topics.ODOM)
        self.pose = self.listen(topics.CURRENT_POSE)
        self.quality = self.listen(topics.LOCALIZATION_QUALITY)
        self.passenger = self.listen(topics.PASSENGER_ATTACHED)
        self.docking = self.listen(topics.DOCKING_STATUS)
        self.navigation = self.listen(topics.NAVIGATION_STATUS)
        self.plan = self.listen(topics.PLAN)
        for row in _OPERATED:
            self.publisher(row)
        self._stick: TwistStamped | None = None
        self._begun = False

    def begin_ride(self) -> None:
        """Runs until the robot may drive."""
        self.ride.start()
        self._begun = True
        self.scheduler.every(round(1e9 * _STICK_PERIOD_S), self._hold_stick)
        self.scheduler.every(round(1e9 * _SOURCE_PERIOD_S), self.ride.repeat_stop_source)

    def assert_well(self) -> None:
        """Checks at the end of each test that no unexpected process failed and nothing unexpected was touched."""
        failed = [item for item in self.scheduler.failures if item.process not in self.expected_failures]
        assert not failed, "\n".join(f"{1e-9 * item.time_ns:.3f} s {item.process}: {item.text}" for item in failed)
        touched = set(self.world.sim.world.touched) - self.touches
        assert not touched, f"the robot touched {', '.join(sorted(touched))}"

    def describe(self) -> str:
        if not self._begun:
            return super().describe()
        state = self.safety.last
        limit = self.limit.last
        at = self.at()
        return (
            f"{super().describe()}; {state.safety_state} {list(state.active_faults)}; "
            f"limit {limit.max_linear_velocity:.2f} m/s {limit.reason!r}; mission {self.mission.last.state} "
            f"{self.mission.last.reason!r}; {self.speed_mps:.2f} m/s at {at.x:.2f} {at.y:.2f} m "
            f"{math.degrees(at.yaw):.0f} deg; not ready: {self.stack.supervision.waiting()}"
        )

    # --- truth -------------------------------------------------------------------------------------------------------

    @property
    def world(self) -> Any:
        return self.ride.world

    @property
    def speed_mps(self) -> float:
        """True speed over ground."""
        vx, vy, _ = self.world.sim.world.truth().linear_mps
        return math.hypot(vx, vy)

    @property
    def stands(self) -> bool:
        return (
            self.speed_mps < _STANDSTILL_MPS and abs(self.world.sim.world.truth().angular_radps[2]) < _STANDSTILL_RADPS
        )

    @property
    def z_m(self) -> float:
        return float(self.world.sim.world.truth().position_m[2])

    def at(self) -> Pose2:
        """The true pose of the robot."""
        return self.world.sim.world.truth().pose()

    def wheelchair(self) -> Pose2:
        """The true pose of the wheelchair."""
        bodies = dict(self.world.sim.world.bodies())
        x, y, _, w, i, j, k = bodies["wheelchair"]
        return Pose2(float(x), float(y), math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k)))

    def estimate_error_m(self) -> float:
        """Error of the newest pose, while the robot stands."""
        return self.at().distance_to(pose_from_msg(self.pose.last.pose))

    # --- waits -------------------------------------------------------------------------------------------------------

    def wait_stands(self, limit_s: float = 10.0) -> None:
        self.wait(lambda: self.stands, "the robot stands", limit_s)

    def wait_faster(self, speed_mps: float, limit_s: float = 10.0) -> None:
        self.wait(lambda: self.speed_mps > speed_mps, f"more than {speed_mps} m/s", limit_s)

    def wait_safety(self, state: str, fault: str = "", limit_s: float = 10.0) -> Any:
        return self.safety.wait(
            lambda message: message.safety_state == state and (not fault or fault in message.active_faults),
            f"safety state {state} {fault}",
            limit_s,
        )

    def wait_mission(self, state: str, limit_s: float = 10.0) -> Any:
        return self.mission.wait(lambda message: message.state == state, f"mission state {state}", limit_s)

    def safety_states(self, since_s: float) -> set[str]:
        return {message.safety_state for message in self.safety.since(since_s)}

    def assert_wheels_rest(self, duration_s: float) -> None:
        """Checks that wheel commands and true speed are zero for the duration."""
        begun_s = self.now_s
        self.stays(lambda: self.stands, "the robot stands", duration_s)
        commands = self.commands.since(begun_s)
        assert len(commands) > 10.0 * duration_s, "wheel commands go on while the robot stands"
        assert all(module.drive_velocity == 0.0 for command in commands for module in command.modules)

    # --- operations --------------------------------------------------------------------------------------------------

    def drive(self, vx_mps: float, vy_mps: float = 0.0, omega_radps: float = 0.0) -> None:
        """Commands the twist at 20 Hz until ``let_go``. The first command is zero, as from a joystick."""
        if self._stick is None:
            self._stick = TwistStamped()
            self.run(2.0 * _STICK_PERIOD_S)
        message = TwistStamped()
        message.twist.linear.x, message.twist.linear.y, message.twist.angular.z = vx_mps, vy_mps, omega_radps
        self._stick = message

    def drive_at(self, speed_mps: float, limit_s: float = 10.0) -> None:
        """Drives ahead until the robot has nearly that speed."""
        self.drive(speed_mps)
        self.wait_faster(0.9 * speed_mps, limit_s)

    def let_go(self) -> None:
        """Returns when the drive considers the stick released."""
        self._stick = TwistStamped()
        self.run(2.0 * _STICK_PERIOD_S)
        self._stick = None
        self.run(2.0 * topics.TELEOP_CMD_VEL.stale_limit_s)

    def estop(self, pressed: bool) -> None:
        self.ride.emergency_stop(pressed)

    def reset(self) -> Any:
        return self.call(services.SAFETY_RESET)

    def release(self) -> None:
        """Releases the stop and resets the monitor, which must accept it."""
        self.estop(False)
        self.run(0.5)
        answer = self.reset()
        assert answer.success, f"{answer.message}; {self.describe()}"

    def command(self, command_type: str, mission_id: str = "") -> None:
        self.publish(topics.UI_COMMAND, UICommand(command_type=command_type, mission_id=mission_id))

    def go(self, pose: Pose2) -> None:
        self.publish(topics.GOAL_POSE, pose_stamped(pose, frames.MAP, self.ride.stamp()))

    def board(self, aboard: bool) -> None:
        """Reports a passenger to the nodes; no wheelchair is latched."""
        self.publish(topics.PASSENGER_ATTACHED, Bool(data=aboard))

    # --- processes ---------------------------------------------------------------------------------------------------

    def kill(self, name: str) -> None:
        """SIGKILL."""
        self.scheduler.processes[name].kill()

    def hang(self, name: str, duration_s: float) -> None:
        """SIGSTOP, and SIGCONT after the duration."""
        self.scheduler.processes[name].hang(duration_s)

    def wait_restarted(self, name: str, limit_s: float = 20.0) -> None:
        """Waits until the supervisor has restarted the process and the others have discovered it."""
        process = self.scheduler.processes[name]
        self.wait(
            lambda: process.running and self.stack.supervision.state(name) is State.READY,
            f"{name} runs again",
            limit_s,
        )
        self.run(_KNOWN_AFTER_S)

    # --- docking -----------------------------------------------------------------------------------------------------

    @property
    def dock(self) -> DockRow:
        return load_docks().docks[DOCK]

    def begin_docking(self) -> Goal:
        return self.begin(actions.DOCK, Dock.Goal(dock_id=DOCK))

    def begin_undocking(self) -> Goal:
        return self.begin(actions.UNDOCK, Undock.Goal())

    def be_docked(self) -> None:
        result = self.begin_docking().wait(_DOCKING_LIMIT_S)
        assert result.success, result.reason

    def wait_docking(self, state: str, limit_s: float = _DOCKING_LIMIT_S) -> None:
        self.docking.wait(lambda message: message.state == state, f"docking state {state}", limit_s)

    def docking_error(self) -> tuple[float, float]:
        """(m, rad) of base_link relative to the dock pose at the true wheelchair."""
        off = self.at().relative_to(self.wheelchair().compose(self.dock.dock_pose.pose()))
        return math.hypot(off.x, off.y), abs(off.yaw)

    def _hold_stick(self) -> None:
        if self._stick is not None:
            self.publisher(topics.TELEOP_CMD_VEL).publish(self._stick)


@shareable
@contextmanager
def staged(
    world: str = "flat",
    *settings: str,
    start: Pose2 | None = None,
    wrong_by: Pose2 = IDENTITY,
    seed: int = 1,
    light: bool = True,
    black_box: bool = False,
    digest: bool = False,
) -> Iterator[Stage]:
    """A robot that is ready to drive.

    wrong_by: the estimated start relative to the true one. light: few LiDAR beams, and images only while docking.
    black_box: see ``StackSetup``. digest: see ``RunOptions``.
    """
    assumed = () if start is None else pose_settings("ndt_localization.start", start.compose(wrong_by))
    scenario = Scenario(
        description="a story",
        world=world,
        seed=seed,
        limit_s=3600.0,
        start=None if start is None else Place(x_m=start.x, y_m=start.y, yaw_deg=math.degrees(start.yaw)),
        settings=["sim_world.people=false", *assumed, *settings],
    )
    # Tests run in parallel: each keeps to one core.
    options = RunOptions(light=light, parallel=False, black_box=black_box, digest=digest)
    with ScheduledRun(scenario, seed, options) as ride:
        stage = Stage(ride)
        stage.begin_ride()
        yield stage
        stage.assert_well()


@shareable
@contextmanager
def staged_before_chair(start: Pose2, *settings: str, seed: int = 1) -> Iterator[Stage]:
    """On even asphalt near the staging pose; the localization starts exactly at the staging pose."""
    row = load_docks().docks[DOCK]
    staging = row.staging.pose()
    chair = staging.compose(Pose2(1.5, 0.0, 0.0)).compose(row.dock_pose.pose().inverse())
    with staged(
        "flat",
        *pose_settings("sim_world.wheelchair", chair),
        *pose_settings("ndt_localization.start", staging),
        *settings,
        start=staging.compose(start),
        seed=seed,
    ) as stage:
        yield stage


@shareable
@contextmanager
def docked(start: Pose2) -> Iterator[Stage]:
    """As ``staged_before_chair``, with the wheelchair attached."""
    with staged_before_chair(start) as stage:
        stage.be_docked()
        yield stage
