"""The mission manager's persistent state: the content of its journal."""

from __future__ import annotations

from dataclasses import dataclass, replace

from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Action, Home, Kind, Mission, Waypoint
from robot_stack.core.safe_places import SafePlace
from robot_stack.mission.orders import EMPTY_QUEUE, OrderQueue, problem_of_queue
from robot_stack.mission.states import ACTIVE, STANDING, State, Trigger, target_of

HOME_NAME = "home"
_UNDOCK = Action.model_validate(Kind.UNDOCK.value)
_SERVED_IN = {State.DOCKING: Kind.DOCK, State.UNDOCKING: Kind.UNDOCK}


@dataclass(frozen=True, slots=True)
class Record:
    """The mission manager's state as journaled.

    mission: as it was at its start, independent of its file; None in IDLE.
    waypoint: index of the waypoint being driven to or served; equal to the number of stops once COMPLETED, and while an
    open route has been driven to its present end.
    failed_tries: tries of this waypoint that made no progress.
    homeward: the way home follows the mission's own waypoints.
    start: pose at which the mission was started, map frame; None until a pose was known.
    reason: cause of the state, for people.
    docking_begun: the docking or undocking of this waypoint was begun and has not succeeded.
    queue: orders that wait, that of the mission, and the last ones.
    safe_place: where the robot drives, or docks, instead because the battery is critical.
    leaving: it undocks from a charger before it drives to this waypoint.
    """

    state: State = State.IDLE
    mission: Mission | None = None
    waypoint: int = 0
    failed_tries: int = 0
    homeward: bool = False
    passenger_attached: bool = False
    start: Pose2 | None = None
    reason: str = ""
    docking_begun: bool = False
    queue: OrderQueue = EMPTY_QUEUE
    safe_place: SafePlace | None = None
    leaving: bool = False

    @property
    def stops(self) -> tuple[Waypoint, ...]:
        """The mission's waypoints, and home or a safe place as the last if the robot is sent there.

        While the robot leaves a charger, the next waypoint has the undocking in place of its own action.
        """
        stops, current = self._route, self.waypoint
        if not self.leaving or current >= len(stops):
            return stops
        return (*stops[:current], stops[current].model_copy(update={"action": _UNDOCK}), *stops[current + 1 :])

    @property
    def _route(self) -> tuple[Waypoint, ...]:
        if self.mission is None:
            return ()
        waypoints = self.mission.waypoints
        if self.safe_place is not None:
            return (*waypoints[: self.waypoint], _stop_at(self.safe_place, self.safe_place.name))
        return (*waypoints, _stop_at(self.mission.home, HOME_NAME)) if self.homeward else waypoints

    @property
    def current(self) -> Waypoint | None:
        """The waypoint being driven to or served."""
        return self.stops[self.waypoint] if self.waypoint < len(self.stops) else None


def _stop_at(home: Home, name: str) -> Waypoint:
    action = Action.model_validate({Kind.DOCK.value: home.dock} if home.dock else Kind.PARK.value)
    return Waypoint(x=home.x, y=home.y, yaw=home.yaw, name=name, action=action)


def problem_of(record: Record) -> str:
    """Why a record is invalid, empty if it is valid: an invalid journal is not used."""
    if record.state in ACTIVE and record.mission is None:
        return f"state {record.state.value} without a mission"
    last = len(record.stops) if _may_be_at_end(record) else len(record.stops) - 1
    if record.state in ACTIVE and not 0 <= record.waypoint <= last:
        return f"waypoint {record.waypoint} of {len(record.stops)}"
    served = _SERVED_IN.get(record.state)
    if served is not None and (record.current is None or record.current.action.kind is not served):
        return f"state {record.state.value} at a waypoint that does not ask to {served.value}"
    if record.start is not None and not record.start.is_finite():
        return "start pose is not finite"
    return problem_of_queue(record.queue, record.state in ACTIVE)


def _may_be_at_end(record: Record) -> bool:
    """All waypoints of an order's own route may be served: more may follow. Closed in a pause, it ends at RESUME."""
    order = record.queue.current
    if order is None:
        return False
    return order.open if record.state is State.WAITING else bool(order.route) and record.state in STANDING


def restored(record: Record) -> Record:
    """The record after a restart: an active mission becomes PAUSED, one that ended is dropped."""
    if record.state not in ACTIVE:
        return Record(passenger_attached=record.passenger_attached, queue=record.queue)
    target = target_of(State.IDLE, Trigger.RESTORED)
    assert target is not None
    if record.current is None:
        where = "at the end of its open route"
    else:
        where = f"{'at' if record.docking_begun else 'on the way to'} {record.current.name!r}"
    reason = f"restarted while {record.state.value} {where}; RESUME goes on, ABORT ends the mission"
    return replace(record, state=target, reason=reason)
