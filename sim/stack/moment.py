"""A moment of a recording as the start of a run: robot, wheelchair, battery, mission and people as recorded."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from robot_stack.contract import frames, topics
from robot_stack.contract.model import Topic
from robot_stack.contract.states import ACTIVE, DOCKING, MissionState
from robot_stack.core.config import ConfigError, load, validate
from robot_stack.core.geometry import Pose2, planar_pose
from robot_stack.core.kept_events import read_record
from robot_stack.core.mission import Kind
from robot_stack.core.mission_library import MissionError, mission_library
from robot_stack.mission.journal import SqliteJournal, journal_path
from robot_stack.mission.orders import Order, OrderQueue, OrderState, Origin
from robot_stack.mission.record import HOME_NAME, Record, problem_of
from robot_stack.mission.states import State
from robot_stack.supervisor.profile import WORLD_NODES
from sim.nodes.sim_world import SimWorldParams
from sim.plant.people import PREFIX
from sim.replay.recorded import Recorded, ReplayError, read_recording
from sim.run.scenario import Scenario
from sim.scheduler.decoding import decoder
from sim.settings import pose_settings, world_settings
from sim.stack.random_ride import place
from sim.stack.world import ScheduledWorld

EVENT_LEAD_S: Final = 10.0
"""An event is taken up this long before its first trigger."""
_BEGIN_S: Final = 1.0  # of any other recording: by then topics of 1 Hz are there
_LIMIT_S: Final = 1800.0
_WHEELCHAIR: Final = "wheelchair"
_ROWS: Final = (
    topics.SIM_GROUND_TRUTH,
    topics.SIM_BODIES,
    topics.CURRENT_POSE,
    topics.PASSENGER_ATTACHED,
    topics.BATTERY_STATE,
    topics.MISSION_STATUS,
    topics.MISSION_QUEUE,
    topics.DOCKING_STATUS,
    topics.PLAN,
    topics.GOAL_POSE,
)
# Parameters that describe the start of the recorded run, or follow from the scenario.
_OF_START: Final = ("start_", "attached_at_start", "passenger_mass_kg", "wheelchair_", "world", "seed")
_OF_WORLD: Final = frozenset(item.partition("=")[0] for item in world_settings(""))  # follow from the world
_EXPECTED: Final = "expected_processes"  # follows from the processes that run
_ALWAYS_LEFT_OUT: Final = (
    "the robot starts from rest, with the nodes' memories empty",
    "noise, delays and faults are drawn from the seed; faults that were active are not raised again",
    "maps are the present ones; missions, zones and parameters are those of the configuration in force",
)


@dataclass(frozen=True, slots=True)
class RecordedMoment:
    """The state at ``at_s`` after the first message of the recording. Poses in map.

    pose: of the robot. estimate: of the localization. chair: of the wheelchair's dock frame. charge: [0, 1]. None is
    unknown. record: of the mission manager, None without a mission.
    goal: of navigation without a mission. people: poses by name. seed, parameters: of a run on the scheduler.
    taken, left_out: what the run takes from the recording and what it does not, for people.
    """

    path: Path
    at_s: float
    pose: Pose2
    estimate: Pose2 | None = None
    attached: bool = False
    chair: Pose2 | None = None
    charge: float | None = None
    record: Record | None = None
    goal: Pose2 | None = None
    people: Mapping[str, Pose2] = field(default_factory=dict)
    seed: int | None = None
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    taken: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def resumes(self) -> bool:
        """The mission was under way and not paused."""
        return self.record is not None and self.record.state is not State.PAUSED

    def scenario(self, seed: int | None, world: str | None) -> Scenario:
        """The run from here on. seed, world: instead of the recorded ones. Raises ConfigError."""
        own = self.parameters.get("sim_world", {})
        default = load(SimWorldParams, "sim_world")
        mass_kg = float(own.get("passenger_mass_kg", default.passenger_mass_kg)) if self.attached else None
        data: dict[str, Any] = {
            "description": f"from {self.path} at {self.at_s:g} s",
            "world": world or str(own.get("world", default.world)),
            "seed": next(value for value in (seed, self.seed, default.seed) if value is not None),
            "limit_s": _LIMIT_S,
            "start": place(self.pose),
            "estimated_start": None if self.estimate is None else place(self.estimate),
            "passenger_mass_kg": mass_kg,
            "settings": list(self._settings(same_world=world is None)),
        }
        if self.record is not None and self.record.mission is not None:
            data["mission"] = self.record.mission.id
        elif self.goal is not None:
            data["goals"] = [place(self.goal)]
        return validate(Scenario, data, str(self.path))

    def _settings(self, *, same_world: bool) -> Iterator[str]:
        for node, values in self.parameters.items():
            for name, value in values.items():
                of_start = node in (*WORLD_NODES, "ndt_localization") and name.startswith(_OF_START)
                if not of_start and name != _EXPECTED and (same_world or f"{node}.{name}" not in _OF_WORLD):
                    yield f"{node}.{name}={json.dumps(value)}"
        if self.chair is not None and not self.attached:
            yield from pose_settings("sim_world.wheelchair", self.chair)

    def write_journal(self) -> None:
        """The mission, in the state folder of the environment, for the mission manager to be started there."""
        if self.record is not None:
            journal = SqliteJournal(journal_path())
            journal.save(self.record)
            journal.close()

    def prepare(self, world: ScheduledWorld) -> None:
        """Battery and people of a world that has been built and not stepped."""
        if self.charge is not None:
            world.sim.battery.charge = self.charge
        for walker in world.sim.world.people:
            if walker.name in self.people:
                walker.resume_at(self.people[walker.name])

    def lines(self) -> list[str]:
        """What is taken from the recording and what is not."""
        return [
            *(f"as recorded: {item}" for item in self.taken),
            *(f"not as recorded: {item}" for item in self.left_out),
        ]


def parse_moment(text: str) -> tuple[Path, float | None]:
    """FILE[@SECONDS]. Raises ConfigError."""
    if Path(text).exists() or "@" not in text:
        return Path(text), None
    name, _, seconds = text.rpartition("@")
    try:
        at_s = float(seconds)
    except ValueError:
        at_s = math.nan
    if not 0.0 <= at_s < math.inf:
        raise ConfigError(f"--from {text}: @ is followed by seconds since the recording's begin, is {seconds!r}")
    return Path(name), at_s


def read_moment(path: Path, at_s: float | None) -> tuple[Recorded, float]:
    """The recording up to the moment, and the moment in s since its first message.

    at_s: None for ``EVENT_LEAD_S`` before the first trigger of an event, else 1 s. Raises ConfigError.
    """
    try:
        if at_s is None:
            at_s = _default_s(path, read_recording(path, ()))
        return read_recording(path, _ROWS, at_s), at_s
    except ReplayError as error:
        raise ConfigError(f"--from {error}") from None


def moment_in(recorded: Recorded, at_s: float) -> RecordedMoment:
    """The moment at the end of what was read, with missions of the configuration in force. Raises ConfigError."""
    return _Reader(recorded, at_s).moment()


def _default_s(path: Path, recorded: Recorded) -> float:
    event = read_record(path)
    if event is None:
        return _BEGIN_S
    return max(event.triggers[0].ros_s - 1e-9 * recorded.begin_ns - EVENT_LEAD_S, _BEGIN_S)


class _Reader:
    """Collects the parts of a moment and the two lists for people."""

    def __init__(self, recorded: Recorded, at_s: float) -> None:
        self._recorded, self._at_s = recorded, at_s
        self._taken: list[str] = []
        self._left_out: list[str] = list(recorded.damages)

    def moment(self) -> RecordedMoment:
        recorded = self._recorded
        truth = self._latest(topics.SIM_GROUND_TRUTH)
        estimate = self._estimate()
        pose = estimate if truth is None else planar_pose(truth.pose.pose.position, truth.pose.pose.orientation)
        if pose is None:
            names = f"{topics.SIM_GROUND_TRUTH.name} or {topics.CURRENT_POSE.name}"
            raise ConfigError(f"--from {recorded.path}: no pose of the robot within {self._at_s:g} s on {names}")
        self._taken.append(
            f"robot at x {pose.x:.2f} m, y {pose.y:.2f} m, {math.degrees(pose.yaw):.0f} deg, "
            + ("as the localization had it" if truth is None else "the ground truth")
        )
        if truth is None:
            self._left_out.append("the true pose of the robot")
        if "world" not in recorded.parameters.get("sim_world", {}):
            self._left_out.append("the world: the recording names none")
        bodies = self._bodies()
        attached, record = self._attached(), self._record()
        if record is not None:
            record = replace(record, passenger_attached=attached)
            if problem := problem_of(record):
                self._left_out.append(f"the mission, which is inconsistent at this moment: {problem}")
                record = None
        moment = RecordedMoment(
            path=recorded.path,
            at_s=self._at_s,
            pose=pose,
            estimate=estimate,
            attached=attached,
            chair=bodies.get(_WHEELCHAIR),
            charge=self._charge(),
            record=record,
            goal=None if record is not None else self._goal(),
            people={name: pose for name, pose in bodies.items() if name.startswith(PREFIX)},
            seed=recorded.seed,
            parameters=recorded.parameters,
        )
        return replace(moment, taken=tuple(self._taken), left_out=(*self._left_out, *_ALWAYS_LEFT_OUT))

    def _latest(self, row: Topic) -> Any:
        items = self._recorded.of(row)
        if not items or row.name in self._recorded.changed:
            return None
        return decoder(row.type)(items[-1].data)

    def _estimate(self) -> Pose2 | None:
        message = self._latest(topics.CURRENT_POSE)
        if message is None:
            self._left_out.append("the localization's pose: it starts at the true one")
            return None
        return planar_pose(message.pose.position, message.pose.orientation)

    def _bodies(self) -> dict[str, Pose2]:
        message = self._latest(topics.SIM_BODIES)
        if message is None:
            self._left_out.append("people and a standing wheelchair: they start where the world has them")
            return {}
        self._taken.append("people at their places, from where they walk on while the stack starts")
        return {
            item.child_frame_id: planar_pose(item.transform.translation, item.transform.rotation)
            for item in message.transforms
            if item.child_frame_id != frames.BASE_LINK
        }

    def _attached(self) -> bool:
        message, mission = self._latest(topics.PASSENGER_ATTACHED), self._latest(topics.MISSION_STATUS)
        if message is None and mission is None:
            self._left_out.append("whether a wheelchair is attached: the run starts without one")
            return False
        attached = bool(mission.passenger_attached if message is None else message.data)
        self._taken.append("a wheelchair is attached" if attached else "no wheelchair is attached")
        if attached and "passenger_mass_kg" not in self._recorded.parameters.get("sim_world", {}):
            self._left_out.append("the passenger's mass: it is that of config/sim_world.yaml")
        return attached

    def _charge(self) -> float | None:
        message = self._latest(topics.BATTERY_STATE)
        if message is None or not 0.0 <= message.percentage <= 1.0:
            self._left_out.append("the battery's charge")
            return None
        self._taken.append(f"battery {message.percentage:.0%}")
        return float(message.percentage)

    def _goal(self) -> Pose2 | None:
        """The goal that navigation drives to."""
        plan, goal = self._latest(topics.PLAN), self._latest(topics.GOAL_POSE)
        if plan is None or not plan.poses or goal is None or not goal.header.frame_id:
            return None
        self._taken.append(f"goal x {goal.pose.position.x:.2f} m, y {goal.pose.position.y:.2f} m, sent again")
        return planar_pose(goal.pose.position, goal.pose.orientation)

    def _record(self) -> Record | None:
        """The mission manager's record as its status shows it."""
        status = self._latest(topics.MISSION_STATUS)
        if status is None:
            self._left_out.append("the mission: no status of it is recorded by then")
            return None
        if status.state not in ACTIVE:
            self._taken.append("no mission under way")
            return None
        try:
            mission = mission_library().find(status.mission_id)
        except MissionError as error:
            self._left_out.append(f"the mission: {error}")
            return None
        homeward = status.current_waypoint == HOME_NAME and status.total_waypoints > len(mission.waypoints)
        if status.total_waypoints != len(mission.waypoints) + homeward:
            self._left_out.append(
                f"the mission {mission.id}: the recorded route has {status.total_waypoints} waypoints and the mission "
                f"file {len(mission.waypoints)} (a safe place, or a route of an order)"
            )
            return None
        paused = status.state == MissionState.PAUSED
        record = Record(
            state=State.PAUSED if paused else State.RUNNING,
            mission=mission,
            waypoint=status.waypoints_completed,
            homeward=homeward,
            reason=status.reason,
            queue=self._queue(),
        )
        self._taken.append(
            f"mission {mission.id}, {status.waypoints_completed} waypoints done, next {status.current_waypoint}"
            + (", paused" if paused else ", resumed by the run")
        )
        return replace(record, docking_begun=self._docks(record))

    def _docks(self, record: Record) -> bool:
        docking = self._latest(topics.DOCKING_STATUS)
        if docking is None or record.current is None:
            return False
        kind = record.current.action.kind
        return kind in (Kind.DOCK, Kind.UNDOCK) and docking.state in DOCKING

    def _queue(self) -> OrderQueue:
        """With the order of the mission under way. Waiting orders come without their missions."""
        message = self._latest(topics.MISSION_QUEUE)
        if message is None:
            return OrderQueue()
        if message.orders:
            self._left_out.append(f"{len(message.orders)} waiting orders")
        if not message.current:
            return OrderQueue()
        order = message.current[0]
        try:
            origin = Origin(order.origin)
        except ValueError:
            return OrderQueue()
        return OrderQueue(
            current=Order(order.id, order.mission_id, origin, priority=order.priority, state=OrderState.UNDER_WAY)
        )
