"""The order under way as the mission manager drives it: nodes traversed, states of actions, what it is given next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final

from robot_stack.contract.states import MissionState
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import MAX_WAYPOINTS, Kind
from robot_stack.fleet.errors import shortened
from robot_stack.fleet.record import NOT_SENT, RESULT_LENGTH, ActionState, OrderRecord, Part, Phase, Record, Status
from robot_stack.fleet.robot import RobotView
from robot_stack.fleet.vehicle import Stop

_COMPLETED, _FAILED = 2, 4  # MissionOrder
_LONGEST_SLUG: Final = 40


class Operation(IntEnum):
    """``EditMissionQueue.operation``: all that the agent asks for."""

    ADD = 0
    EXTEND = 6
    CANCEL = 7
    PAUSE = 8
    RESUME = 9


@dataclass(frozen=True, slots=True)
class Request:
    """One request to the mission manager. number: of this request; a late answer to another one does not count."""

    number: int
    operation: Operation
    order_id: str
    stops: tuple[Stop, ...] = ()
    first: int = 0
    open: bool = False


# --- route handed over -----------------------------------------------------------------------------------------------


def with_stops(order: OrderRecord, stops: tuple[Stop, ...]) -> OrderRecord:
    """With more of the base, and open or complete as the horizon says.

    A part that is complete, full or ended is followed by another one: ``waiting`` holds its stops until then.
    """
    part = order.part
    if part is None or part.ended or not part.open or order.waiting:
        order = order.model_copy(update={"waiting": (*order.waiting, *stops)})
        return _next_part(order) if part is None or part.ended else order
    fits = stops[: max(_longest(order) - len(part.stops), 0)]
    rest = stops[len(fits) :]
    longer = part.model_copy(update={"stops": (*part.stops, *fits), "open": order.open_end and not rest})
    return order.model_copy(update={"part": longer, "waiting": rest})


def leaving_charger(order: OrderRecord, action_id: str) -> OrderRecord:
    """With the way out of the charger, back to the node where the robot was staged. action_id: of stopCharging."""
    docked = (order.part.stops if order.part is not None and not order.waiting else order.waiting)[-1]
    out = replace(docked, action=action_id, name=f"{docked.node}.out", kind=Kind.UNDOCK, dock_id="")
    back = replace(docked, action="", name=f"{docked.node}.back", kind=Kind.PARK, dock_id="")
    return with_stops(order.model_copy(update={"charging": False}), (out, back))


def leaves_charger(order: OrderRecord, action_id: str) -> bool:
    """The way of ``leaving_charger`` is not done yet."""
    part = order.part
    ahead = part.stops[max(part.done - 1, 0) :] if part is not None else ()  # with the undocking before the way back
    return any(stop.action == action_id for stop in (*ahead, *order.waiting))


def _longest(order: OrderRecord) -> int:
    """Of a part: at a charger the way out belongs to the same one, which stays open."""
    return MAX_WAYPOINTS - 2 if order.charging else MAX_WAYPOINTS


def _next_part(order: OrderRecord) -> OrderRecord:
    """Begins with what waits. Unchanged if nothing does."""
    if not order.waiting:
        return order
    number = order.part_number + 1
    slug = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in order.id.lower())
    name = f"fleet_{order.accepted_ms:x}_{number}_{slug[:_LONGEST_SLUG]}"
    longest = _longest(order)
    stops, rest = order.waiting[:longest], order.waiting[longest:]
    part = Part(id=name, stops=stops, open=order.open_end and not rest)
    return order.model_copy(update={"part": part, "part_number": number, "waiting": rest})


def due(order: OrderRecord, number: int) -> tuple[OrderRecord, Request | None]:
    """The request by which the mission manager gets what it has not yet, and the record that it is sent.

    Until it is acknowledged, the same request is repeated: it has its effect once.
    """
    part = order.part
    if part is None or part.ended:
        return order, None
    if order.phase is Phase.CANCELLING:
        return order, Request(number, Operation.CANCEL, part.id)
    if order.phase is not Phase.ACTIVE or not part.pending:
        return order, None
    if (part.sent, part.sent_open) == (part.acknowledged, part.acknowledged_open):
        part = part.model_copy(update={"sent": len(part.stops), "sent_open": part.open})
        order = order.model_copy(update={"part": part})
    if part.acknowledged == NOT_SENT:
        return order, Request(number, Operation.ADD, part.id, part.stops[: part.sent], 0, part.sent_open)
    stops = part.stops[part.acknowledged : part.sent]
    return order, Request(number, Operation.EXTEND, part.id, stops, part.acknowledged, part.sent_open)


def answered(order: OrderRecord, request: Request, success: bool, text: str) -> OrderRecord:
    """After the mission manager's answer to an ADD, EXTEND or CANCEL of ``order``."""
    part = order.part
    if part is None or part.id != request.order_id:
        return order
    if request.operation is Operation.CANCEL:
        # A refused one is repeated, unless the order has ended meanwhile.
        if success:
            return _ended(order, Phase.CANCELLED, order.reason)
        return order.model_copy(update={"cancel_refused": True})
    if success:
        taken = part.model_copy(update={"acknowledged": part.sent, "acknowledged_open": part.sent_open, "refusal": ""})
        return order.model_copy(update={"part": taken})
    if request.operation is Operation.ADD:
        return _ended(order, Phase.ABORTED, f"the mission manager refused the order: {text}")
    # An EXTEND. Whether only for the moment, no answer says: it is repeated, and the master may cancel the order.
    return order.model_copy(update={"part": part.model_copy(update={"refusal": shortened(text)})})


# --- progress --------------------------------------------------------------------------------------------------------


def followed(record: Record, robot: RobotView) -> Record:
    """After what /mission/status and /mission/queue show of the order under way."""
    order = record.order
    if order is None or not order.under_way:
        return record
    part = order.part
    if part is None:
        # Cancelled before anything was handed over, or all nodes were traversed at the start.
        if order.phase is Phase.CANCELLING:
            return record.model_copy(update={"order": _ended(order, Phase.CANCELLED, order.reason)})
        return record if order.nodes else _with_order(record, order.model_copy(update={"phase": Phase.COMPLETED}))
    if part.sent == NOT_SENT and order.phase is Phase.CANCELLING:
        return _with_order(record, _ended(order, Phase.CANCELLED, order.reason))
    queue, mission = robot.queue, robot.mission
    done = part.done
    if mission is not None and mission.mission_id == part.id:
        done = min(max(done, mission.completed), len(part.stops))
    state = None if queue is None else queue.ended.get(part.id)
    if state == _COMPLETED:
        # Only a complete route ends: the request that completed it was taken, whether its answer arrived or not.
        done = max(done, part.sent)
    record = _advance(record, order, part, done)
    order = record.order or order
    part = order.part or part
    if queue is None:
        return record
    if not part.seen and queue.knows(part.id):
        part = part.model_copy(update={"seen": True})
        order = order.model_copy(update={"part": part})
    if state == _COMPLETED:
        order = _part_completed(order, part)
        if (
            order.phase is Phase.COMPLETED
            and robot.pose is not None
            and part.stops[-1].kind in (Kind.DOCK, Kind.UNDOCK)
        ):
            order = order.model_copy(update={"end": robot.pose})  # beside the node
    elif state is not None and order.phase is Phase.CANCELLING:
        order = _ended(order, Phase.CANCELLED, order.reason)
    elif state is not None:
        why = mission.reason if mission is not None and mission.mission_id == part.id else ""
        unreachable = _driven_to(order, part) if state == _FAILED else ""
        order = _ended(order, Phase.ABORTED, why or "the mission manager ended the order")
        order = order.model_copy(update={"unreachable": unreachable})
    elif order.phase is Phase.CANCELLING and order.cancel_refused and not queue.knows(part.id):
        order = _ended(order, Phase.CANCELLED, order.reason)  # it was never there
    elif part.seen and not queue.knows(part.id):
        order = _ended(order, Phase.ABORTED, "the mission manager does not know the order any more")
    return _with_order(record, _running(order, robot) if order.phase is Phase.ACTIVE else order)


def _driven_to(order: OrderRecord, part: Part) -> str:
    """The node on the way to which the robot is; empty in one of its actions."""
    stop = part.stops[min(part.done, len(part.stops) - 1)]
    return "" if stop.action else next((node.id for node in order.nodes if node.sequence_id == stop.node), "")


def is_overtaken(order: OrderRecord | None, robot: RobotView) -> bool:
    """Another order moves the robot away from where this one, which still waits, was to start."""
    part, queue = order.part if order is not None else None, robot.queue
    return part is not None and queue is not None and bool(queue.current) and part.id in queue.waiting


def _with_order(record: Record, order: OrderRecord) -> Record:
    return record if order == record.order else record.model_copy(update={"order": order})


def _advance(record: Record, order: OrderRecord, part: Part, done: int) -> Record:
    if done <= part.done:
        return record
    finished = {stop.action for stop in part.stops[part.done : done] if stop.action}
    for stop in part.stops[part.done : done]:
        if not stop.action:
            record, order = traversed(record, order, stop.node)
    actions = tuple(
        action.model_copy(update={"status": Status.FINISHED}) if action.id in finished else action
        for action in order.actions
    )
    order = order.model_copy(update={"actions": actions, "part": part.model_copy(update={"done": done})})
    return record.model_copy(update={"order": order})


def traversed(record: Record, order: OrderRecord, sequence_id: int) -> tuple[Record, OrderRecord]:
    """With the node of this sequence id as the last one; it and all before it are not to be traversed any more."""
    node = next((node for node in order.nodes if node.sequence_id == sequence_id), None)
    if node is None:
        return record, order
    order = order.model_copy(
        update={
            "nodes": tuple(one for one in order.nodes if one.sequence_id > sequence_id),
            "edges": tuple(one for one in order.edges if one.sequence_id > sequence_id),
        }
    )
    return record.model_copy(update={"order": order, "last_node": node.id, "last_sequence_id": sequence_id}), order


def _part_completed(order: OrderRecord, part: Part) -> OrderRecord:
    """Goes on with the next part: what was added behind the end of this one."""
    order = order.model_copy(update={"part": part.model_copy(update={"ended": True})})
    if order.phase is Phase.CANCELLING:
        return _ended(order, Phase.CANCELLED, order.reason)
    order = _next_part(order)
    if order.part is not None and not order.part.ended:
        return order
    return order if order.nodes else order.model_copy(update={"phase": Phase.COMPLETED})


def _ended(order: OrderRecord, phase: Phase, reason: str) -> OrderRecord:
    """Without anything left to do: its nodes and edges are gone, its unfinished actions have failed."""
    why = shortened(reason or "the order was cancelled", RESULT_LENGTH)
    actions = tuple(
        action if action.status.ended else action.model_copy(update={"status": Status.FAILED, "result": why})
        for action in order.actions
    )
    part = order.part.model_copy(update={"ended": True}) if order.part is not None else None
    gone = {"nodes": (), "edges": (), "waiting": (), "actions": actions, "part": part}
    return order.model_copy(update={"phase": phase, "reason": reason, **gone})


def _running(order: OrderRecord, robot: RobotView) -> OrderRecord:
    """With the state of the action that is served."""
    part, mission = order.part, robot.mission
    serving = ""
    if part is not None and not part.ended and part.done < len(part.stops):
        serving = part.stops[part.done].action
    status = Status.WAITING
    if mission is not None and part is not None and mission.mission_id == part.id:
        paused = mission.state == MissionState.PAUSED
        status = Status.PAUSED if paused else Status.RUNNING if mission.active else Status.WAITING
    actions = tuple(_state_of(action, serving, status) for action in order.actions)
    return order if actions == order.actions else order.model_copy(update={"actions": actions})


def _state_of(action: ActionState, serving: str, status: Status) -> ActionState:
    if action.status.ended or action.id != serving or status is Status.WAITING:
        return action
    return action if action.status is status else action.model_copy(update={"status": status})


def base_left_m(order: OrderRecord, pose: Pose2) -> float:
    """Length of the base ahead, along straight lines."""
    part = order.part
    stops = (*(part.stops[part.done :] if part is not None else ()), *order.waiting)
    length_m, here = 0.0, pose
    for stop in stops:
        there = Pose2(stop.x, stop.y, stop.yaw)
        length_m += here.distance_to(there)
        here = there
    return length_m
