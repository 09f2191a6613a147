"""Instant actions (VDA 5050 2.1.0, 6.8 and 6.9; 3.0.0, 6.2): what each of them does at once, and what it waits for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

from robot_stack.core.geometry import Pose2
from robot_stack.fleet import progress
from robot_stack.fleet.errors import Error, ErrorType, Refused, shortened
from robot_stack.fleet.order import MAX_ID_LENGTH, Action
from robot_stack.fleet.record import ActionState, Phase, Record, Status, digest
from robot_stack.fleet.robot import FLEET, RobotView
from robot_stack.fleet.vehicle import Vehicle
from robot_stack.fleet.version import Version

MAX_STATES: Final = 50
_PAST_ACTIONS: Final = 200
_TYPE_LENGTH: Final = 64
_FARTHEST_M: Final = 10_000.0
_LARGEST_YAW: Final = 3.1416

_NO_ZONES: Final = "the zones of the site are set on the robot; the factsheet has no supportedZones"
_NOT_HERE: Final = "maps are installed on the robot"
# Named in the refusal; every other type is unknown.
REFUSED: Final = {
    "startCharging": "an action of the node before a charger",
    "stopCharging": "the site has no charger",
    "logReport": "the robot keeps the last minute before each fault by itself; staff fetch recordings",
    "enableMap": _NOT_HERE,
    "downloadMap": _NOT_HERE,
    "deleteMap": _NOT_HERE,
    # From 3.0 on.
    "downloadZoneSet": _NO_ZONES,
    "enableZoneSet": _NO_ZONES,
    "deleteZoneSet": _NO_ZONES,
    "clearZoneActions": _NO_ZONES,
    "trigger": "the robot has no action waitForTrigger",
    "retry": "a failed action is not tried again",
    "skipRetry": "a failed action is not tried again",
    "startHibernation": "staff switch the robot off",
    "stopHibernation": "the robot does not hibernate",
    "shutdown": "staff switch the robot off",
    "updateCertificate": "staff install certificates on the robot",
}
_COMMON: Final = ("cancelOrder", "startPause", "stopPause", "stateRequest", "factsheetRequest")
_SUPPORTED: Final = {
    Version.V2: (*_COMMON, "initPosition"),
    Version.V3: (*_COMMON, "initializePosition", "clearInstantActions"),
}


def supported(vehicle: Vehicle) -> tuple[str, ...]:
    kinds = _SUPPORTED[vehicle.version]
    return (*kinds, "stopCharging") if vehicle.chargers else kinds


@dataclass(frozen=True, slots=True)
class Begun:
    """After the start of an action. send_state, send_factsheet: requested. pose: to be set."""

    record: Record
    send_state: bool = False
    send_factsheet: bool = False
    pose: Pose2 | None = None


def is_known(record: Record, action: Action) -> bool:
    """The same actionId again is the same action."""
    order = record.order
    shown = (*record.instant, *(order.actions if order is not None else ()))
    return any(one.id == action.id for one in shown) or digest(action.id) in record.past_actions


def without_ended(record: Record) -> Record:
    """The actions that have ended are not shown any more, but known."""
    return _forgotten(record, tuple(one for one in record.instant if one.status.ended))


def begin(record: Record, action: Action, robot: RobotView, vehicle: Vehicle) -> Begun:
    """Raises Refused for an action that cannot be carried out; ``failed`` records it then."""
    kinds = supported(vehicle)
    if action.type not in kinds:
        why = REFUSED.get(action.type, f"unknown; supported: {', '.join(kinds)}")
        raise _refused(action, f"{action.type[:MAX_ID_LENGTH]}: {why}")
    state = _state(action, Status.RUNNING)
    begun = Begun(_with(record, state))
    match action.type:
        case "stateRequest":
            return replace(begun, record=_with(record, _finished(state)), send_state=True)
        case "factsheetRequest":
            return replace(begun, record=_with(record, _finished(state)), send_factsheet=True)
        case "cancelOrder":
            wanted_id = action.parameters.get("orderId") if vehicle.version is Version.V3 else None
            return replace(begun, record=_cancel(record, state, wanted_id))
        case "clearInstantActions":
            return replace(begun, record=_with(without_ended(record), _finished(state)))
        case "stopCharging":
            if record.order is None or not record.order.charges:
                raise _refused(action, "stopCharging: no order has docked the robot to a charger")
            leaving = progress.leaving_charger(record.order, action.id)
            return replace(begun, record=begun.record.model_copy(update={"order": leaving}))
        case "startPause":
            if record.order is None or not record.order.under_way:
                raise _refused(action, "there is no order to pause")
            return begun
        case "stopPause":
            paused = robot.queue is not None and robot.queue.paused_by == FLEET
            if not paused and wanted(record) != "startPause":
                raise _refused(action, "the fleet has not paused the robot; a person's pause is ended by a person")
            return begun
        case _:
            if record.order is not None and record.order.under_way:
                raise _refused(action, "the pose is not set while an order is under way")
            pose = _init_pose(action, robot, vehicle)
            node = str(action.parameters["lastNodeId"])
            moved = begun.record.model_copy(update={"last_node": node, "last_sequence_id": 0})
            return replace(begun, record=moved, pose=pose)


def failed(record: Record, action: Action, why: str) -> Record:
    return _with(record, _state(action, Status.FAILED, why))


def _state(action: Action, status: Status, result: str = "") -> ActionState:
    """The type of an unknown action may be long."""
    kind = shortened(action.type, _TYPE_LENGTH)
    return ActionState(id=action.id, type=kind, status=status, result=shortened(result))


def cancelled_by_robot(record: Record, reason: str) -> Record:
    """With the order under way to be cancelled, without an action of the master."""
    order = record.order
    if order is None or order.phase is not Phase.ACTIVE:
        return record
    cancelling = order.model_copy(update={"phase": Phase.CANCELLING, "reason": reason, "cancel_refused": False})
    return record.model_copy(update={"order": cancelling})


def updated(record: Record, robot: RobotView, standing: bool, pose_given: bool | None) -> Record:
    """With the actions finished whose effect is there, and failed whose effect is impossible by now.

    pose_given: the pose of an initPosition was sent; None = it will be.
    """
    order, paused_by = record.order, robot.queue.paused_by if robot.queue is not None else ""
    under_way = order is not None and order.under_way
    states: list[ActionState] = []
    for state in record.instant:
        if not state.status.ended:
            match state.type:
                case "cancelOrder" if not under_way and standing:
                    state = _finished(state)
                case "startPause" | "stopPause" if _first_running(states):
                    pass  # one after the other
                case "startPause" if paused_by == FLEET:
                    state = _finished(state)
                case "startPause" if not under_way:
                    state = _failed(state, "the order ended before")
                case "stopCharging" if order is None or order.phase in (Phase.CANCELLED, Phase.ABORTED):
                    state = _failed(state, "the order ended before")
                case "stopCharging" if order is not None and not progress.leaves_charger(order, state.id):
                    state = _finished(state)
                case "stopPause" if paused_by != FLEET:
                    state = _finished(state)
                case "initPosition" | "initializePosition" if pose_given:
                    state = _finished(state)
                case "initPosition" | "initializePosition" if pose_given is False:
                    state = _failed(state, "the agent was restarted before it set the pose")
        states.append(state)
    return _replaced(record, tuple(states))


def leaves_charger(record: Record) -> bool:
    """A stopCharging is under way."""
    return any(state.type == "stopCharging" and not state.status.ended for state in record.instant)


def refused_by_manager(record: Record, kind: str, why: str) -> Record:
    """The mission manager has refused what the running actions of this kind ask for."""
    states = (
        _failed(state, why) if state.type == kind and not state.status.ended else state for state in record.instant
    )
    return _replaced(record, tuple(states))


def wanted(record: Record) -> str:
    """The type of the first action that the mission manager must carry out, empty without one."""
    return _first_running(record.instant)


def _first_running(states: Iterable[ActionState]) -> str:
    """The type of the first pause, or end of one, that is not done; empty without one."""
    return next((one.type for one in states if one.type in ("startPause", "stopPause") and not one.status.ended), "")


def _cancel(record: Record, state: ActionState, order_id: Any) -> Record:
    """order_id: None for whichever order is under way."""
    order = record.order
    if order is None or not order.under_way or order.charges or order_id not in (None, order.id):
        text = "there is no order to cancel" if order_id is None else "this order is not under way"
        raise Refused(Error(ErrorType.NO_ORDER_TO_CANCEL, text, (("topic", "instantActions"), ("actionId", state.id))))
    return cancelled_by_robot(_with(record, state), "")


def _init_pose(action: Action, robot: RobotView, vehicle: Vehicle) -> Pose2:
    values = action.parameters
    missing = sorted({"x", "y", "theta", "mapId", "lastNodeId"} - values.keys())
    if missing:
        raise _refused(action, f"{action.type} needs {', '.join(missing)}")
    numbers = [values[key] for key in ("x", "y", "theta")]
    if not all(map(_is_number, numbers)):
        raise _refused(action, "x, y and theta must be numbers")
    x, y, theta = map(float, numbers)
    if max(abs(x), abs(y)) > _FARTHEST_M or abs(theta) > _LARGEST_YAW:
        raise _refused(action, f"x and y are at most {_FARTHEST_M:.0f} m, theta is in [-pi, pi]")
    if values["mapId"] != vehicle.map_id:
        raise _refused(action, f"the map {str(values['mapId'])[:MAX_ID_LENGTH]!r} is not on the vehicle")
    if not isinstance(values["lastNodeId"], str) or len(values["lastNodeId"]) > MAX_ID_LENGTH:
        raise _refused(action, f"lastNodeId must be a string of at most {MAX_ID_LENGTH} characters")
    if robot.mission is None or robot.mission_active:
        raise _refused(action, "the pose is not set while a mission is under way")
    if robot.loaded:
        raise _refused(action, "the pose is not set with a wheelchair attached: staff set it on the touch screen")
    return Pose2(x, y, theta)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _refused(action: Action, text: str) -> Refused:
    return Refused(Error(ErrorType.INSTANT_ACTION, text, (("topic", "instantActions"), ("actionId", action.id))))


def _finished(state: ActionState) -> ActionState:
    return state.model_copy(update={"status": Status.FINISHED})


def _failed(state: ActionState, why: str) -> ActionState:
    return state.model_copy(update={"status": Status.FAILED, "result": why})


def _replaced(record: Record, states: tuple[ActionState, ...]) -> Record:
    return record if states == record.instant else record.model_copy(update={"instant": states})


def _with(record: Record, state: ActionState) -> Record:
    """Drops the oldest ended one if there are too many."""
    record = record.model_copy(update={"instant": (*record.instant, state)})
    if len(record.instant) <= MAX_STATES:
        return record
    oldest = next((one for one in record.instant if one.status.ended), record.instant[0])
    return _forgotten(record, (oldest,))


def _forgotten(record: Record, gone: tuple[ActionState, ...]) -> Record:
    past = (*record.past_actions, *(digest(one.id) for one in gone))
    instant = tuple(one for one in record.instant if one not in gone)
    return record.model_copy(update={"instant": instant, "past_actions": past[-_PAST_ACTIONS:]})
