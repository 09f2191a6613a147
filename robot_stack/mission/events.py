"""Events and inputs of the mission manager, and the effects of its decisions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.goals import NavigationEvent, SendGoal
from robot_stack.core.mission import Kind, Mission, Waypoint
from robot_stack.core.mission_library import MissionError
from robot_stack.mission import own_route
from robot_stack.mission.orders import OF_ORIGIN, WITH_ORDER, Operation, Order, Origin, QueueReport
from robot_stack.mission.record import Record

START_MISSION = "START_MISSION"
PAUSE = "PAUSE"
RESUME = "RESUME"
ABORT = "ABORT"
EMERGENCY_STOP = "EMERGENCY_STOP"
COMMANDS = (START_MISSION, PAUSE, RESUME, ABORT, EMERGENCY_STOP)


@dataclass(frozen=True, slots=True)
class Inputs:
    """The robot's state at an event.

    pose: base_link in map; None while stale or never received.
    twist: wheel odometry in base_link; None while stale.
    emergency_stop: from the first ``true`` until both keys have released it.
    safety_known: /safety/status is fresh.
    faults: active fault codes of /safety/status.
    battery: state of charge [0, 1]; NaN = unknown.
    planned: the navigation controller has a plan: it drives, or will.
    navigation_served: a server offers the navigation action.
    docking_served: a server offers the docking actions.
    docking_state: state of /docking/status, empty while stale.
    navigation_text: navigation's status text, for people; not used for decisions.
    door: the door for which the robot waits, with what it needs, for people; else empty.
    charging: the battery is being charged. manual: a person drives, by /teleop/cmd_vel.
    setting_out: navigation or docking is warning people of a start.
    clock_s: the node's clock, for the earliest times of orders; NaN = unknown.
    """

    pose: Pose2 | None
    twist: Twist2 | None
    emergency_stop: bool
    safety_known: bool
    faults: tuple[str, ...]
    battery: float
    planned: bool
    navigation_served: bool = False
    docking_served: bool = False
    docking_state: str = ""
    navigation_text: str = ""
    door: str = ""
    charging: bool = False
    manual: bool = False
    setting_out: bool = False
    clock_s: float = math.nan


@dataclass(frozen=True, slots=True)
class Command:
    """An operator's command. START_MISSION carries the mission of the requested id, or the problem with it."""

    name: str
    mission: Mission | None = None
    problem: str = ""


def command(name: str, find: Callable[[], Mission]) -> Command:
    """find: returns the requested mission; called for START_MISSION only. A MissionError is the command's problem."""
    if name != START_MISSION:
        return Command(name)
    try:
        return Command(name, find())
    except MissionError as error:
        return Command(name, problem=str(error))


@dataclass(frozen=True, slots=True)
class EditQueue:
    """A request to change the queue. ADD and REPLACE carry the order with its mission, or the problem with it.

    operation: None if there is no such operation. order_id: except for ADD and REPLACE.
    steps: for MOVE, negative = earlier. origin: of the request; None if it is unknown.
    part, first, open: for EXTEND, the waypoints, the index of the first one in the route, and whether more may follow.
    """

    operation: Operation | None
    order: Order | None = None
    problem: str = ""
    order_id: str = ""
    steps: int = 0
    origin: Origin | None = None
    part: tuple[Waypoint, ...] = ()
    first: int = 0
    open: bool = False


def edit_queue(
    operation: int,
    find: Callable[[str], Mission],
    *,
    order_id: str,
    mission_id: str,
    origin: str,
    priority: int,
    earliest_s: float,
    steps: int,
    waypoints: Sequence[Mapping[str, Any]] = (),
    first: int = 0,
    more_follows: bool = False,
) -> EditQueue:
    """find: returns the mission of an id; called for a new order without waypoints.

    A MissionError is the request's problem. waypoints: as in a mission file.
    """
    try:
        asked = Operation(operation)
    except ValueError:
        return EditQueue(None, problem=f"there is no operation {operation}")
    origin_of = next((item for item in Origin if item.value == origin), None)
    if asked not in (*WITH_ORDER, *OF_ORIGIN):
        return EditQueue(asked, order_id=order_id, steps=steps, origin=origin_of)
    if origin_of is None:
        return EditQueue(asked, problem=f"there is no origin {origin[:64]!r}; known: {', '.join(Origin)}")
    try:
        if asked in OF_ORIGIN:
            part = own_route.part_of(waypoints) if asked is Operation.EXTEND else ()
            return EditQueue(asked, order_id=order_id, origin=origin_of, part=part, first=first, open=more_follows)
        mission = own_route.own_mission(mission_id, waypoints) if waypoints else find(mission_id)
    except MissionError as error:
        return EditQueue(asked, problem=str(error))
    if more_follows and not waypoints:
        return EditQueue(asked, problem="an open order carries its route: a mission file has no next part")
    route = own_route.digest(mission) if waypoints else ""
    order = Order(
        order_id, mission_id, origin_of, priority, earliest_s, mission=mission, route=route, open=more_follows
    )
    return EditQueue(asked, order, origin=origin_of)


@dataclass(frozen=True, slots=True)
class EmergencyStopBegan:
    """The emergency stop has just become active."""


@dataclass(frozen=True, slots=True)
class PassengerChanged:
    attached: bool


@dataclass(frozen=True, slots=True)
class DockingAccepted:
    """The docking controller accepted the goal of StartDocking number ``call``."""

    call: int


@dataclass(frozen=True, slots=True)
class DockingFeedback:
    """tries: number of the present attempt from 1, 0 = unknown."""

    call: int
    state: str
    tries: int


@dataclass(frozen=True, slots=True)
class DockingEnded:
    """The goal of StartDocking number ``call`` has ended: succeeded, failed, cancelled, rejected or unknown.

    reason: the failure in words. safety_stop: it failed because the robot had to stand.
    """

    call: int
    success: bool
    reason: str = ""
    safety_stop: bool = False


@dataclass(frozen=True, slots=True)
class JournalFailed:
    """The last SaveRecord failed; the effects after it were not executed."""

    problem: str


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed."""


DockingEvent = DockingAccepted | DockingFeedback | DockingEnded
Event = (
    Command | EditQueue | EmergencyStopBegan | PassengerChanged | NavigationEvent | DockingEvent | JournalFailed | Tick
)


@dataclass(frozen=True, slots=True)
class Status:
    """Content of /mission/status, and the state of the external display."""

    state: str
    mission: Mission | None
    current_waypoint: str
    waypoints_completed: int
    total_waypoints: int
    progress: float
    eta_s: float
    passenger_attached: bool
    reason: str
    last_command: str
    last_command_accepted: bool
    display: int


@dataclass(frozen=True, slots=True)
class SaveRecord:
    """Write the record to the journal. On failure: drop the effects after this one and report JournalFailed."""

    record: Record


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """Cancels the navigation controller's goal: the robot comes to rest.

    everything: also the goals of other clients, which may be those of a node that crashed.
    """

    everything: bool = False


@dataclass(frozen=True, slots=True)
class StartDocking:
    """Sends a goal to the docking controller.

    call: number of this goal, repeated in its events. kind: DOCK or UNDOCK.
    dock_id: key in config/docks.yaml; empty = undock wherever the robot is docked.
    """

    call: int
    kind: Kind
    dock_id: str


@dataclass(frozen=True, slots=True)
class CancelDocking:
    """Cancels the docking controller's goal: it stops the robot and then ends the goal.

    everything: all goals from before now, of any client: they may be those of a mission manager that crashed.
    """

    everything: bool = False


@dataclass(frozen=True, slots=True)
class PublishEmergencyStop:
    active: bool


@dataclass(frozen=True, slots=True)
class WarnOfDeparture:
    """Publishes the departure warning. remaining_s: until the robot starts, 0 as it does."""

    remaining_s: float


@dataclass(frozen=True, slots=True)
class ReportStatus:
    status: Status


@dataclass(frozen=True, slots=True)
class ReportQueue:
    report: QueueReport


Effect = (
    SaveRecord
    | SendGoal
    | CancelGoal
    | StartDocking
    | CancelDocking
    | PublishEmergencyStop
    | WarnOfDeparture
    | ReportStatus
    | ReportQueue
)
