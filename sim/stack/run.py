"""Runs a scenario on the deterministic scheduler: requests, events, notes, figures and the digest of it all."""

from __future__ import annotations

import gc
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PlanPath
from std_msgs.msg import Bool

from custom_msgs.msg import MissionStatus, SafetyStatus, SwerveModuleCommandArray, UICommand
from robot_stack.contract import frames, services, topics
from robot_stack.contract.states import ENDED, DockingState
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped, time_to_s, twist_from_msg, twist_stamped
from robot_stack.middleware.emergency_stop import StopSource
from robot_stack.middleware.interfaces import interface_class
from sim.nodes.camera_driver import CameraDriverNode
from sim.plant.fault_table import FaultRefused
from sim.run.ride import Ride
from sim.run.ride_notes import RideNotes
from sim.run.run_log import Four, Moment, RunLog, motion_figures
from sim.run.scenario import Event, Scenario
from sim.scheduler.events import NANOSECONDS
from sim.scheduler.observers import Digest, Observer, Recording
from sim.scheduler.process import Process
from sim.scheduler.scheduler import Failure
from sim.settings import FEW_BEAMS, pose_settings, world_settings
from sim.stack.faults import PlannedFault
from sim.stack.invariants import Broken, Invariants
from sim.stack.moment import RecordedMoment
from sim.stack.recording import record_run
from sim.stack.stack import SimulatedStack, StackSetup

_READY_S = 60.0
# Until the mission manager has received the safety status that lets the robot drive.
_RESUME_AFTER_S = 0.5
_TELEOP_PERIOD_S = 0.05
_PROGRESS_PERIOD_S = 1.0
# Distance at which a standing robot counts as having reached its goal.
_AT_GOAL_M, _AT_GOAL_RAD, _STANDING_MPS = 0.05, math.radians(2.0), 0.005


class RunFailed(RuntimeError):
    """The run could not be carried out. The message has the reason."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """light: 16 rings' worth of LiDAR beams, and pictures only while docking, for runs without perception in focus.

    record: the folder of an MCAP recording, None for none. parallel: jobs and sensors may use both cores. until_s: ends
    the run before the scenario does. faults: raised beside those of the scenario. black_box: see ``StackSetup``.
    moment: of a recording, from which the scenario goes on. digest: False leaves out the messages, which saves a
    twentieth of the time.
    """

    light: bool = False
    record: Path | None = None
    parallel: bool = True
    until_s: float = math.inf
    faults: tuple[PlannedFault, ...] = ()
    black_box: bool = False
    moment: RecordedMoment | None = None
    digest: bool = True


@dataclass(slots=True)
class RunResult:
    """digest: of all messages and the ground truth. failures: processes that ended by themselves.

    broken: invariants that did not hold, in the order of time.
    """

    digest: str
    messages: int
    simulated_s: float
    figures: dict[str, Any]
    run_log: RunLog
    ride: Ride
    failures: list[Failure] = field(default_factory=list)
    broken: list[Broken] = field(default_factory=list)


class ScheduledRun:
    """A context manager. ``stack`` may be used to inject more than the scenario does, before ``run`` and during it.

    progress: called once per simulated second with the run.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        options: RunOptions | None = None,
        progress: Callable[[ScheduledRun], None] = lambda _: None,
        log: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.scenario, self.options = scenario, options or RunOptions()
        self._progress, self._log = progress, log
        setup = StackSetup(
            seed,
            _settings(scenario, light=self.options.light),
            tuple(scenario.only),
            black_box=self.options.black_box,
            prepare=None if self.options.moment is None else self.options.moment.prepare,
        )
        self.stack = SimulatedStack(setup, parallel=self.options.parallel)
        self.run_log = RunLog()
        self._waiting = sorted(scenario.events, key=lambda item: item.at_s, reverse=True)
        self._script = sorted(scenario.twists, key=lambda item: item.at_s)
        self._goals = [goal.pose() for goal in scenario.goals]
        self._goal: Pose2 | None = None
        self._begun_s: float | None = None
        self._wheel_radius_m = 0.0
        # (pose in odom, true pose) at the start and now.
        self._odometry: tuple[tuple[Pose2, Pose2], tuple[Pose2, Pose2]] | None = None

    def __enter__(self) -> ScheduledRun:
        stack = self.stack
        stack.__enter__()
        if self.options.moment is not None:
            self.options.moment.write_journal()
        scheduler = stack.scheduler
        self.digest = Digest((str(stack.folder).encode(), str(scheduler.runtime_folder).encode()))
        if self.options.digest:
            scheduler.add_observer(self.digest)
        self.invariants = Invariants(stack)
        scheduler.add_observer(self.invariants)
        self.notes = RideNotes(stack.test_tool.subscribe)
        self._recording = self._record(self.options.record)
        for row, callback in (
            (topics.WHEEL_COMMANDS, self._on_wheel_commands),
            (topics.CMD_VEL_LIMITED, self._on_requested),
            (topics.CURRENT_POSE, self._on_estimate),
            (topics.PLAN, self._on_plan),
            (topics.SAFETY_STATUS, self._on_safety),
            (topics.ODOM, self._on_odometry),
        ):
            stack.test_tool.subscribe(row, callback)
        operator, advertise = stack.operator, stack.advertise
        self._commands, self._goal_pose = advertise(topics.UI_COMMAND), advertise(topics.GOAL_POSE)
        self._teleop, self._passenger = advertise(topics.TELEOP_CMD_VEL), advertise(topics.PASSENGER_ATTACHED)
        stop, sources = advertise(topics.EMERGENCY_STOP), advertise(topics.EMERGENCY_STOP_SOURCES)
        self._stop = StopSource(operator.port.name, operator.port.process_id, stop, sources, self._stamp)
        self._reset = operator.port.client(services.SAFETY_RESET.type, services.SAFETY_RESET.name)
        if self.options.light:
            scheduler.add_observer(_PicturesWhileDocking(self))
        return self

    def __exit__(self, *arguments: object) -> None:
        if self._recording is not None:
            self._recording.close()
        self.stack.__exit__(*arguments)
        gc.unfreeze()

    # --- the run -----------------------------------------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """Simulated time since the robot could drive; 0 before."""
        return 0.0 if self._begun_s is None else self.stack.scheduler.now_s - self._begun_s

    @property
    def mission(self) -> MissionStatus | None:
        return self.notes.mission

    @property
    def safety(self) -> SafetyStatus | None:
        return self.notes.safety

    def run(self) -> RunResult:
        """Raises RunFailed, SimulationDiverged, FaultRefused, ValueError for an event that names no process."""
        self.start()
        self.ride()
        return self.result()

    def ride(self) -> bool:
        """From ``start`` to the end. Returns True if the mission, or the last goal, ended the run."""
        scheduler = self.stack.scheduler
        return scheduler.run(scheduler.now_s + min(self.scenario.limit_s, self.options.until_s), self._over)

    def start(self) -> None:
        """Runs until the robot may drive; from there on the scenario's time counts. Raises RunFailed."""
        scheduler = self.stack.scheduler
        if not scheduler.run_for(_READY_S, self._may_drive):
            if scheduler.events.stopped:
                raise RunFailed("stopped before the robot could drive")
            state = "" if self.safety is None else f"{self.safety.safety_state} {' '.join(self.safety.active_faults)}"
            raise RunFailed(f"not fit to drive after {_READY_S:.0f} s: {state} {self.stack.supervision.waiting()}")
        self._wheel_radius_m = self.world.node.robot.wheel_radius_m
        gc.collect()
        gc.freeze()  # present objects stay: exclude them from garbage collection during the run
        self._begun_s = scheduler.now_s
        self.invariants.begin()
        for fault in self.options.faults:
            scheduler.at(scheduler.now_ns + round(fault.at_s * NANOSECONDS), self._raise, fault)
        self.notes.begin()
        if self.scenario.passenger_mass_kg is not None:
            self._passenger.publish(Bool(data=True))
        moment = self.options.moment
        if moment is not None and moment.record is not None:
            if moment.resumes:
                scheduler.at(scheduler.now_ns + round(_RESUME_AFTER_S * NANOSECONDS), self.command, UICommand.RESUME)
        elif self.scenario.mission is not None:
            self.start_mission(self.scenario.mission)
        self._every(1.0 / topics.SIM_GROUND_TRUTH.nominal_rate_hz, self._note_truth)
        self._every(_TELEOP_PERIOD_S, self._act)
        self._every(_PROGRESS_PERIOD_S, lambda: self._progress(self))

    def result(self) -> RunResult:
        scheduler = self.stack.scheduler
        goal = self.scenario.goals[-1].pose() if self.scenario.goals else None
        figures = motion_figures(self.run_log, goal)
        figures["mission_state"] = self.mission.state if self.mission is not None else ""
        figures["mission_reason"] = self.mission.reason if self.mission is not None else ""
        figures["emergency_stop"] = self.safety is not None and self.safety.safety_state == self.safety.EMERGENCY_STOP
        figures["touched"] = ", ".join(self.world.sim.world.touched)
        truth = self.world.sim.world.truth()
        figures["odometry_error_m"] = self._odometry_error_m()
        alarms = {int(code) for code in self.world.sim.world.drives.alarm_codes if code}
        figures["drive_alarms"] = ", ".join(f"0x{code:04X}" for code in sorted(alarms))
        self.digest.add(struct.pack("<7d", *truth.position_m, *truth.quaternion_xyzw))
        return RunResult(
            self.digest.hexdigest(),
            self.digest.messages,
            self.now_s,
            figures,
            self.run_log,
            self.notes.ride,
            list(scheduler.failures),
            list(self.invariants.broken),
        )

    @property
    def world(self) -> Any:
        assert self.stack.world is not None
        return self.stack.world

    def _may_drive(self) -> bool:
        safety = self.safety
        return safety is not None and safety.safety_state == safety.NORMAL and self.stack.supervision.all_ready()

    def wants_pictures(self) -> bool:
        """Before the ride, so that every node becomes ready, and while docking."""
        return self._begun_s is None or self.notes.docking_now()

    def _over(self) -> bool:
        mission = self.mission
        if self._waiting:
            return False
        if self.scenario.mission is not None:
            return mission is not None and mission.state in ENDED and self.now_s > 1.0
        return bool(self.scenario.goals) and not self._goals and self._arrived()

    def _every(self, period_s: float, callback: Callable[[], None]) -> None:
        period_ns = round(period_s * NANOSECONDS)
        scheduler = self.stack.scheduler
        scheduler.every(period_ns, callback, start_ns=scheduler.now_ns + period_ns)

    # --- acting ------------------------------------------------------------------------------------------------------

    def start_mission(self, mission_id: str) -> None:
        command = UICommand(command_type=UICommand.START_MISSION, mission_id=mission_id)
        command.header.stamp = self._stamp()
        self._commands.publish(command)

    def command(self, command_type: str) -> None:
        """Sends PAUSE, RESUME or ABORT like the touch screen."""
        message = UICommand(command_type=command_type)
        message.header.stamp = self._stamp()
        self._commands.publish(message)

    def go(self, pose: Pose2) -> None:
        self._goal = pose
        self._goal_pose.publish(pose_stamped(pose, frames.MAP, self._stamp()))

    def drive(self, twist: Twist2) -> None:
        self._teleop.publish(twist_stamped(twist, frames.BASE_LINK, self._stamp()))

    def emergency_stop(self, active: bool) -> None:
        self._stop.publish(active)

    def repeat_stop_source(self) -> None:
        """Call at the rate of /emergency_stop/sources while a press must not pass for one of a dead source."""
        self._stop.repeat()

    def stamp(self) -> Any:
        """The present time on the operator's ROS clock."""
        return self._stamp()

    def reset(self) -> None:
        """Requests the release of an emergency stop; the answer goes to the log."""

        def on_answer(answer: Any) -> None:
            self._note_event(f"reset {'granted' if answer.success else 'refused'}: {answer.message}")

        self._reset.call(interface_class(services.SAFETY_RESET.type).Request(), on_answer)

    def _act(self) -> None:
        now_s = self.now_s
        while self._waiting and self._waiting[-1].at_s <= now_s:
            self._do(self._waiting.pop())
        if self._goals and self._arrived():
            self.go(self._goals.pop(0))
        if self._script:
            begun = [item for item in self._script if item.at_s <= now_s]
            self.drive(begun[-1].twist() if begun else ZERO_TWIST)

    def _do(self, event: Event) -> None:
        done = event.describe()
        if event.fault is not None:
            done = self.stack.faults.inject(event.fault, event.target, event.value, event.duration_s)
        elif event.estop is not None:
            self.emergency_stop(event.estop)
        elif event.reset is not None:
            self.reset()
        elif event.goal_again is not None:
            if self._goal is not None:
                self.go(self._goal)
        elif event.passenger is not None:
            self._passenger.publish(Bool(data=event.passenger))
        elif event.kill is not None:
            self._process(event.kill).kill()
        self._note_event(done)

    def _process(self, name: str) -> Process:
        processes = self.stack.scheduler.processes
        if name not in processes:
            raise ValueError(f"kill: no process {name!r} in this stack; there are {', '.join(sorted(processes))}")
        return processes[name]

    def _raise(self, fault: PlannedFault) -> None:
        """Raises a planned fault; an impossible one, e.g. of a process that is gone, is recorded."""
        try:
            done = self.stack.faults.inject(fault.kind, fault.target, fault.value, fault.duration_s)
        except FaultRefused as error:
            done = f"refused: {error}"
        self._note_event(f"{fault.kind} {fault.target}: {done}")

    def _note_event(self, text: str) -> None:
        self.run_log.events.append((self.now_s, text))
        self._log(f"{self.now_s:7.2f} s  {text}")

    def _arrived(self) -> bool:
        """At the present goal, standing; true before the first."""
        goal = self._goal
        if goal is None:
            return True
        if not self.run_log.moments or self.run_log.moments[-1].twist.speed() > _STANDING_MPS:
            return False
        error = self.run_log.moments[-1].pose.relative_to(goal)
        return math.hypot(error.x, error.y) < _AT_GOAL_M and abs(error.yaw) < _AT_GOAL_RAD

    def _stamp(self) -> Any:
        nanoseconds = self.stack.operator.port.now_ns()
        stamp = UICommand().header.stamp
        stamp.sec, stamp.nanosec = divmod(nanoseconds, NANOSECONDS)
        return stamp

    # --- noting ------------------------------------------------------------------------------------------------------

    def _note_truth(self) -> None:
        truth = self.world.sim.world.truth()
        vx, vy, _ = truth.linear_mps
        speeds = self._wheel_radius_m * truth.joint_speeds_radps[list(frames.DRIVE_AXES)]
        angles = truth.joint_positions_rad[list(frames.STEER_AXES)]
        twist = Twist2(vx, vy, truth.angular_radps[2])
        moment = Moment(self.now_s, truth.pose(), twist, _four(speeds.tolist()), _four(angles.tolist()))
        self.run_log.moments.append(moment)

    def _on_odometry(self, message: Odometry) -> None:
        if self.run_log.moments:
            poses = pose_from_msg(message.pose.pose), self.run_log.moments[-1].pose
            self._odometry = (self._odometry[0], poses) if self._odometry else (poses, poses)

    def _odometry_error_m(self) -> float:
        """Error of the wheel odometry since the start, m; NaN without odometry."""
        if not self._odometry:
            return math.nan
        (first, first_truth), (last, truth) = self._odometry
        return last.relative_to(first).distance_to(truth.relative_to(first_truth))

    def _on_wheel_commands(self, message: SwerveModuleCommandArray) -> None:
        if self._begun_s is not None:
            speeds = _four([module.drive_velocity for module in message.modules])
            angles = _four([module.steering_angle for module in message.modules])
            self.run_log.commands.append((self.now_s, speeds, angles))

    def _on_requested(self, message: TwistStamped) -> None:
        if self._begun_s is not None:
            self.run_log.requested.append((self.now_s, twist_from_msg(message.twist)))

    def _on_estimate(self, message: PoseStamped) -> None:
        if self._begun_s is not None:
            start_s = self.stack.scheduler.clock_start_ns / NANOSECONDS + self._begun_s
            self.run_log.estimates.append((time_to_s(message.header.stamp) - start_s, pose_from_msg(message.pose)))

    def _on_plan(self, message: PlanPath) -> None:
        if self._begun_s is not None and self.notes.ride.plans:
            self.run_log.plans.append((self.now_s, self.notes.ride.plans[-1][1]))

    def _on_safety(self, message: SafetyStatus) -> None:
        if self._begun_s is not None:
            faults = f" ({', '.join(message.active_faults)})" if message.active_faults else ""
            self.run_log.log_state(self.now_s, f"{message.safety_state}{faults}")

    def _record(self, folder: Path | None) -> Recording | None:
        if folder is None:
            return None
        clock_start_ns = self.stack.scheduler.clock_start_ns
        recording = record_run(
            folder,
            clock_start_ns,
            lambda: self.notes.docking.state if self.notes.docking else DockingState.IDLE,
            self.stack.setup.seed,
            self.stack.plan.parameters,
        )
        self.stack.scheduler.add_observer(recording)
        return recording


class _PicturesWhileDocking(Observer):
    """Gives each life of the camera driver the condition under which it renders."""

    def __init__(self, run: ScheduledRun) -> None:
        self._run = run

    def on_life_change(self, time_ns: int, process: str, change: object) -> None:
        if process == "camera_driver":
            for node in self._run.stack.scheduler.processes[process].nodes:
                if isinstance(node, CameraDriverNode):
                    node.wants_pictures = self._run.wants_pictures


def _settings(scenario: Scenario, *, light: bool) -> tuple[str, ...]:
    start, passenger = scenario.start_pose(), scenario.passenger_mass_kg
    estimated = start if scenario.estimated_start is None else scenario.estimated_start.pose()
    return (
        *world_settings(scenario.world),
        *pose_settings("sim_world.start", start),
        f"sim_world.attached_at_start={'false' if passenger is None else 'true'}",
        *([] if passenger is None else [f"sim_world.passenger_mass_kg={passenger}"]),
        *pose_settings("ndt_localization.start", estimated),
        *(FEW_BEAMS if light else ()),
        *scenario.settings,
    )


def _four(values: list[float]) -> Four:
    a, b, c, d = (float(value) if math.isfinite(value) else 0.0 for value in values)
    return a, b, c, d
