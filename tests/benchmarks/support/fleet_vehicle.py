"""A robot of a fleet with a kinematic body: the kernels of fleet agent and mission manager, with their journals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final

from robot_stack.contract.states import DockingState
from robot_stack.core.config import load
from robot_stack.core.departure import DepartureParams
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2, wrap_angle
from robot_stack.core.goals import SendGoal
from robot_stack.core.limits import SpeedLimit
from robot_stack.core.mission import Kind, Mission
from robot_stack.core.mission_library import MissionError
from robot_stack.core.navigation_waits import load_navigation_waits
from robot_stack.core.robot import Robot, load_robot
from robot_stack.fleet import progress
from robot_stack.fleet.factsheet import factsheet
from robot_stack.fleet.kernel import FleetKernel
from robot_stack.fleet.link import Topic
from robot_stack.fleet.nodes.journal_file import JournalFile
from robot_stack.fleet.params import FleetParams
from robot_stack.fleet.record import Record
from robot_stack.fleet.robot import FLEET, Battery, MissionView, Queue, RobotView, Safety
from robot_stack.fleet.vehicle import Vehicle
from robot_stack.mission import events as ev
from robot_stack.mission import own_route
from robot_stack.mission.journal import SqliteJournal
from robot_stack.mission.kernel import MissionKernel
from robot_stack.mission.orders import Operation, Origin, QueueReport
from robot_stack.mission.params import MissionParams
from robot_stack.mission.perform import Journal, Performer, load_record
from robot_stack.mission.record import Record as MissionRecord

_SPEED_MPS: Final = 1.0
_YAW_RATE_RADPS: Final = 1.0
_DOCKING_S: Final = 15.0
_DRAIN: Final = 1.0 / 14_400.0  # of the battery, each second of driving
_CHARGE: Final = 1.0 / 3_600.0


@cache
def _configured() -> tuple[FleetParams, MissionParams, DepartureParams, dict[str, str], Robot]:
    """As the nodes have it."""
    mission = load(MissionParams, "mission_manager").with_waits(load_navigation_waits().longest_s)
    docks: dict[str, str] = {name: dock.kind for name, dock in load_docks().docks.items()}
    return load(FleetParams, "fleet_agent"), mission, load(DepartureParams, "departure"), docks, load_robot()


class _Memory:
    """The mission manager's journal without a disk."""

    def load(self) -> MissionRecord:
        return MissionRecord()

    def save(self, record: MissionRecord) -> None:
        pass


class FleetVehicle:
    """One robot, with a queue that staff have released. ``tick`` returns what it publishes.

    folder: for the journals, which a restarted robot goes on from; None = in memory. docks: kind by id, in the place of
    the configured ones. params: of FleetParams, likewise.
    """

    def __init__(
        self,
        serial: str,
        pose: Pose2,
        folder: Path | None = None,
        *,
        docks: dict[str, str] | None = None,
        params: Mapping[str, float] | None = None,
    ) -> None:
        fleet, mission, departure, configured, robot = _configured()
        identity = fleet.identity.model_copy(update={"serial_number": serial})
        self.params = fleet.model_copy(update={"identity": identity, **(params or {})})
        docks = configured if docks is None else docks
        self.pose, self.twist, self.charge = pose, ZERO_TWIST, 1.0
        self._goal: SendGoal | None = None
        self._docking: tuple[int, Kind, str] | None = None
        self._docked_in_s = 0.0
        self._dock_state, self._docks = DockingState.IDLE, docks
        self._loaded = self._charging = False
        self._now_s = math.nan
        self._agent_journal = JournalFile(str(folder / "fleet_agent.json")) if folder is not None else None
        agent_record = self._agent_journal.load()[0] if self._agent_journal is not None else Record()
        journal: Journal = SqliteJournal(folder / "mission.db") if folder is not None else _Memory()
        record, _ = load_record(journal)
        vehicle = Vehicle.of(self.params, robot, docks, "1")
        self.agent = FleetKernel(self.params, vehicle, factsheet(robot, vehicle, self.params), agent_record)
        self._kernel = MissionKernel(mission, departure, record, docks=docks)
        self._performer = Performer(self._kernel, journal, self)
        self._mission: MissionView | None = None
        self._queue: Queue | None = None
        self._started = False

    def connected(self) -> None:
        self.agent.connected()

    def tick(self, now_s: float, unix_s: float) -> dict[Topic, bytes]:
        """After a time of any length, about 0.1 s."""
        self.drive(now_s, unix_s)
        self.agent.tick(self.view(), now_s, unix_s)
        if self._agent_journal is not None and self._agent_journal.save(self.agent.record):
            return {}
        outputs = self.agent.take()
        if outputs.request is not None:
            self.agent.answered(outputs.request, *self.edit(outputs.request, unix_s))
        return outputs.messages

    def drive(self, now_s: float, unix_s: float) -> None:
        """A tick without the agent: of the body and the mission manager."""
        dt_s = 0.0 if math.isnan(self._now_s) else now_s - self._now_s
        self._now_s = now_s
        self._move(dt_s)
        if not self._started:
            self._started = True
            self._performer.start_up(self._inputs(unix_s), now_s)
            self._handle(ev.EditQueue(Operation.RELEASE, origin=Origin.CLI), unix_s)
        self._handle(ev.Tick(), unix_s)

    def edit(self, request: progress.Request, unix_s: float) -> tuple[bool, str]:
        """The mission manager's answer to the agent."""
        waypoints = [
            {
                "name": stop.name,
                "x": stop.x,
                "y": stop.y,
                "yaw": stop.yaw,
                "action": own_route.action_of(stop.kind.value, stop.wait_s, stop.dock_id),
            }
            for stop in request.stops
        ]
        edit = ev.edit_queue(
            request.operation,
            _no_mission,
            order_id=request.order_id,
            mission_id=request.order_id,
            origin=FLEET,
            priority=100,
            earliest_s=0.0,
            steps=0,
            waypoints=waypoints,
            first=request.first,
            more_follows=request.open,
        )
        self._handle(edit, unix_s)
        answer = self._kernel.queue_answer
        return answer.success, answer.message

    # --- body --------------------------------------------------------------------------------------------------------

    def _move(self, dt_s: float) -> None:
        before = self.pose
        if self._docking is not None:
            self._docked_in_s -= dt_s
        elif self._goal is not None:
            self._drive(self._goal, dt_s)
        moved_m = self.pose.distance_to(before)
        turned = wrap_angle(self.pose.yaw - before.yaw)
        self.twist = Twist2(moved_m / dt_s, 0.0, turned / dt_s) if dt_s > 0.0 else ZERO_TWIST
        self.charge += dt_s * (_CHARGE if self._charging else -_DRAIN if moved_m else 0.0)
        self.charge = min(max(self.charge, 0.0), 1.0)

    def _drive(self, goal: SendGoal, dt_s: float) -> None:
        left_m, turn = self.pose.distance_to(goal.pose), wrap_angle(goal.pose.yaw - self.pose.yaw)
        limit = SpeedLimit(_SPEED_MPS, _YAW_RATE_RADPS).slower(goal.limit)
        step_m, step_rad = limit.linear_mps * dt_s, limit.angular_radps * dt_s
        share = 1.0 if left_m <= step_m else step_m / left_m
        yaw = self.pose.yaw + max(-step_rad, min(step_rad, turn))
        dx, dy = goal.pose.x - self.pose.x, goal.pose.y - self.pose.y
        self.pose = Pose2(self.pose.x + share * dx, self.pose.y + share * dy, wrap_angle(yaw))

    def _dock(self, unix_s: float) -> None:
        """Ends the docking or undocking whose time is over."""
        if self._docking is None or self._docked_in_s > 0.0:
            return
        (call, kind, dock), self._docking = self._docking, None
        docks = kind is Kind.DOCK
        self._dock_state = DockingState.DOCKED if docks else DockingState.IDLE
        if self._loaded or (docks and self._docks[dock] == "wheelchair"):
            self._loaded = docks
            self._handle(ev.PassengerChanged(docks), unix_s)
        self._charging = docks and self._docks[dock] == "charger"
        self._handle(ev.DockingEnded(call, success=True), unix_s)

    # --- mission manager ---------------------------------------------------------------------------------------------

    def _handle(self, event: ev.Event, unix_s: float) -> None:
        if isinstance(event, ev.Tick):
            self._dock(unix_s)
        self._performer.handle(event, self._inputs(unix_s), self._now_s)

    def _inputs(self, unix_s: float) -> ev.Inputs:
        return ev.Inputs(
            pose=self.pose,
            twist=self.twist,
            emergency_stop=False,
            safety_known=True,
            faults=(),
            battery=self.charge,
            planned=self._goal is not None,
            navigation_served=True,
            docking_served=True,
            docking_state=self._dock_state,
            charging=self._charging,
            clock_s=unix_s,
        )

    def view(self) -> RobotView:
        return RobotView(
            pose=self.pose,
            quality=1.0,
            twist=self.twist,
            battery=Battery(100.0 * self.charge, 48.0, self._charging),
            safety=Safety(False, ()),
            mission=self._mission,
            queue=self._queue,
            loaded=self._loaded,
        )

    # --- its outputs -------------------------------------------------------------------------------------------------

    def send_goal(self, goal: SendGoal) -> None:
        self._goal = goal

    def cancel_goal(self, everything: bool) -> None:
        self._goal = None

    def start_docking(self, call: int, kind: Kind, dock_id: str) -> None:
        self._docking, self._docked_in_s = (call, kind, dock_id), _DOCKING_S
        self._performer.handle(ev.DockingAccepted(call), self._inputs(0.0), self._now_s)

    def cancel_docking(self, everything: bool) -> None:
        self._docking = None

    def publish_emergency_stop(self, active: bool) -> None:
        pass

    def warn_of_departure(self, remaining_s: float) -> None:
        pass

    def publish_status(self, status: ev.Status) -> None:
        mission_id = status.mission.id if status.mission is not None else ""
        self._mission = MissionView(status.state, mission_id, status.waypoints_completed, status.reason)

    def publish_queue(self, report: QueueReport) -> None:
        queue = report.queue
        self._queue = Queue(
            report.held_by,
            report.reason,
            queue.current.id if queue.current else "",
            frozenset(order.id for order in queue.orders),
            {order.id: int(order.state) for order in queue.ended},
            report.paused_by.value if report.paused_by else "",
            frozenset(order.id for order in queue.orders if not order.earliest_s),
        )


def _no_mission(mission_id: str) -> Mission:
    raise MissionError(f"there is no mission {mission_id!r}")
