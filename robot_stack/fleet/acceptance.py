"""Whether an order or an update is taken over: the flow chart of figure 8 (VDA 5050 2.1.0, 6.6.2; 3.0.0, 6.1.2)."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import Final

from robot_stack.contract.states import HeldBy
from robot_stack.core.geometry import Pose2
from robot_stack.fleet import codec, progress
from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.instant import leaves_charger, without_ended
from robot_stack.fleet.order import Action, Node, Order
from robot_stack.fleet.record import RESULT_LENGTH, ActionState, GraphPart, OrderRecord, Phase, Record, digest
from robot_stack.fleet.robot import RobotView
from robot_stack.fleet.vehicle import START_CHARGING, Vehicle, check, check_loads, start_problem, stops_of
from robot_stack.fleet.version import Version

# Of one order with all its updates: they stay in the state until the next order.
MAX_ACTIONS: Final = 500
_PAST_ORDERS: Final = 1000  # 20 kB of the journal
_ENTRY_BYTES: Final = 100  # of a node, edge or action in the state, without its texts
_RESULT_BYTES: Final = 4 * RESULT_LENGTH
_OTHERS: Final = "an order or a mission of another client comes first"


class Mode(StrEnum):
    """``operatingMode``. Not used: SEMIAUTOMATIC, whose speed is that of a person, TEACHIN, and those that 3.0 adds."""

    AUTOMATIC = "AUTOMATIC"
    MANUAL = "MANUAL"
    SERVICE = "SERVICE"


def mode_of(robot: RobotView, order: OrderRecord | None) -> Mode:
    """AUTOMATIC while the fleet's orders start, each where the robot stands, or one of them is under way."""
    if robot.queue is None:
        return Mode.SERVICE
    part = order.part if order is not None else None
    if robot.queue.held_by == HeldBy.MANUAL:
        return Mode.MANUAL
    if part is not None and robot.queue.current == part.id:
        return Mode.AUTOMATIC
    before = robot.queue.ready - {part.id if part is not None else ""}
    others = bool(robot.queue.current or before) or robot.mission_active
    return Mode.SERVICE if robot.queue.held_by != HeldBy.NOTHING or others else Mode.AUTOMATIC


def accepted(
    record: Record, order: Order, robot: RobotView, vehicle: Vehicle, now_s: float, state_bytes: int
) -> Record:
    """The record with ``order`` taken over, or itself for one that is known. Raises Refused.

    state_bytes: limit of the order's share of a state message.
    """
    taken = _accepted(record, order, robot, vehicle, now_s)
    if taken.order is not None and taken is not record and _size(taken.order) > state_bytes:
        text = f"the order with its updates is too long for the state: at most {state_bytes} bytes"
        raise order.refused(ErrorType.MEMORY, text, ("nodes", str(len(taken.order.nodes))))
    return taken


def _size(order: OrderRecord) -> int:
    """Bytes of the order's nodes, edges and actions in a state, at most."""
    texts = [part.id for part in (*order.nodes, *order.edges)]
    texts += [text for action in order.actions for text in (action.id, action.type)]
    entries = len(order.nodes) + len(order.edges) + len(order.actions)
    return len(codec.compact(texts)) + _ENTRY_BYTES * entries + _RESULT_BYTES * len(order.actions)


def _accepted(record: Record, order: Order, robot: RobotView, vehicle: Vehicle, now_s: float) -> Record:
    current = record.order
    if current is None or current.id != order.id:
        if digest(order.id) in record.past_orders:
            raise order.refused(
                ErrorType.OUTDATED_UPDATE, f"the order {order.id!r} has ended: every order needs an id of its own"
            )
        return _new(record, order, robot, vehicle, now_s)
    if order.update_id < current.update_id:
        text = f"orderUpdateId {order.update_id} is older than {current.update_id}, which is on the vehicle"
        raise order.refused(ErrorType.OUTDATED_UPDATE, text)
    if order.update_id == current.update_id:
        if vehicle.version is Version.V3 and order.digest != current.digest:
            text = f"another content than that of the orderUpdateId {order.update_id} on the vehicle"
            raise order.refused(ErrorType.SAME_UPDATE, text)
        return record
    return _update(record, current, order, robot, vehicle)


def _new(record: Record, order: Order, robot: RobotView, vehicle: Vehicle, now_s: float) -> Record:
    current = record.order
    if order.nodes[0].sequence_id != 0:
        raise order.refused(ErrorType.VALIDATION, "the first node of a new order has the sequenceId 0")
    if vehicle.version is Version.V3 and order.update_id != 0:
        raise order.refused(ErrorType.ORDER_UPDATE, "a new order has the orderUpdateId 0")
    if current is not None and current.under_way:
        how = "charges: send stopCharging first" if current.charges else "is under way: update it, or cancel it first"
        text = f"the order {current.id!r} {how}"
        raise order.refused(ErrorType.OTHER_ORDER, text, ("activeOrderId", current.id))
    _check_mode(order, current, robot)
    check(order, vehicle)
    _check_place(order, order.nodes[0], robot, vehicle)
    base = order.nodes[: order.base]
    loaded = check_loads(order, _actions(base), robot.loaded)
    check_loads(order, _actions(order.nodes[order.base :]), loaded)
    _check_number(order, 0, order.actions)
    start = robot.pose or Pose2(0.0, 0.0, 0.0)
    first = base[0]
    stops = stops_of(base, order.edges, start, order.base == len(order.nodes), vehicle)
    taken = OrderRecord(
        id=order.id,
        update_id=order.update_id,
        nodes=_nodes(order.nodes),
        edges=_edges(order),
        decision=(base[-1].id, base[-1].sequence_id),
        end=Pose2(stops[-1].x, stops[-1].y, stops[-1].yaw),
        loaded=loaded,
        charging=_charges(base),
        actions=_states(order.nodes),
        load_ids=_load_ids(base),
        accepted_ms=round(now_s * 1e3),
        digest=order.digest,
    )
    past = record.past_orders if current is None else (*record.past_orders, digest(current.id))
    if vehicle.version is Version.V2:
        record = without_ended(record)
    record = record.model_copy(update={"order": taken, "past_orders": past[-_PAST_ORDERS:]})
    if not first.actions:  # the robot is there
        stops = stops[1:]
    if not first.actions or vehicle.version is Version.V3:
        record, taken = progress.traversed(record, taken, first.sequence_id)
    return record.model_copy(update={"order": progress.with_stops(taken, stops)})


def _update(record: Record, current: OrderRecord, order: Order, robot: RobotView, vehicle: Vehicle) -> Record:
    if current.phase in (Phase.CANCELLING, Phase.CANCELLED, Phase.ABORTED):
        how = "was cancelled" if current.phase is not Phase.ABORTED else f"has ended: {current.reason}"
        raise order.refused(ErrorType.UPDATE_AFTER_CANCEL, f"the order {how}: send a new order")
    if current.charging:
        raise order.refused(ErrorType.ORDER_UPDATE, "the order ends with startCharging: send stopCharging first")
    if leaves_charger(record):
        raise order.refused(ErrorType.ORDER_UPDATE, "the robot leaves the charger: wait for the end of stopCharging")
    first = order.nodes[0]
    if (first.id, first.sequence_id) != current.decision:
        node, number = current.decision
        text = f"the update must begin with the last node of the base, {node!r} with sequenceId {number}"
        raise order.refused(ErrorType.ORDER_UPDATE, text, ("nodeId", first.id))
    if current.phase is Phase.COMPLETED:
        _check_mode(order, current, robot)
    check(order, vehicle)
    if current.phase is Phase.COMPLETED and first.position is not None:
        end = replace(first.position, x=current.end.x, y=current.end.y)
        _check_place(order, replace(first, position=end), robot, vehicle)
    base, horizon = order.nodes[1 : order.base], order.nodes[order.base :]
    # The stitching node keeps the actions that it was first given.
    loaded = check_loads(order, _actions(base), current.loaded)
    check_loads(order, _actions(horizon), loaded)
    kept = tuple(action for action in current.actions if action.node <= current.decision[1])
    known = {action.id for action in kept} | {action.id for action in record.instant}
    twice = [action.id for action in _actions((*base, *horizon)) if action.id in known]
    if twice:
        text = f"the actionId {twice[0]!r} is used already"
        raise order.refused(ErrorType.ORDER_UPDATE, text, ("actionId", twice[0]))
    _check_number(order, len(kept), _actions((*base, *horizon)))
    stops = stops_of(base, order.edges, current.end, not horizon, vehicle)
    released = tuple(node for node in current.nodes if node.released)
    last = order.nodes[order.base - 1]
    taken = current.model_copy(
        update={
            "update_id": order.update_id,
            "phase": Phase.ACTIVE,
            "nodes": (*released, *_nodes((*base, *horizon))),
            "edges": (*(edge for edge in current.edges if edge.released), *_edges(order)),
            "decision": (last.id, last.sequence_id),
            "end": Pose2(stops[-1].x, stops[-1].y, stops[-1].yaw) if stops else current.end,
            "loaded": loaded,
            "charging": _charges(base),
            "actions": (*kept, *_states((*base, *horizon))),
            "load_ids": current.load_ids | _load_ids(base),
            "digest": order.digest,
        }
    )
    return record.model_copy(update={"order": progress.with_stops(taken, stops)})


def _check_mode(order: Order, current: OrderRecord | None, robot: RobotView) -> None:
    mode = mode_of(robot, current)
    if mode is not Mode.AUTOMATIC:
        reason = "the mission manager does not report" if robot.queue is None else robot.queue.reason or _OTHERS
        hint = "staff release the queue on the touch screen or with: robot-stack mission queue release"
        raise order.refused(
            ErrorType.NOT_AVAILABLE, f"operating mode {mode}: {reason}", ("operatingMode", mode), hint=hint
        )


def _check_place(order: Order, first: Node, robot: RobotView, vehicle: Vehicle) -> None:
    problem = start_problem(first, robot.pose if robot.localized else None, vehicle)
    if problem:
        raise order.refused(ErrorType.START_NODE, problem, ("nodeId", first.id))


def _check_number(order: Order, before: int, actions: tuple[Action, ...]) -> None:
    if before + len(actions) > MAX_ACTIONS:
        text = f"more than {MAX_ACTIONS} actions in one order"
        raise order.refused(ErrorType.MEMORY, text, ("actions", str(before + len(actions))))


def _actions(nodes: tuple[Node, ...]) -> tuple[Action, ...]:
    return tuple(action for node in nodes for action in node.actions)


def _charges(base: tuple[Node, ...]) -> bool:
    return any(action.type == START_CHARGING for action in _actions(base))


def _nodes(nodes: tuple[Node, ...]) -> tuple[GraphPart, ...]:
    return tuple(GraphPart(id=node.id, sequence_id=node.sequence_id, released=node.released) for node in nodes)


def _edges(order: Order) -> tuple[GraphPart, ...]:
    return tuple(GraphPart(id=edge.id, sequence_id=edge.sequence_id, released=edge.released) for edge in order.edges)


def _states(nodes: tuple[Node, ...]) -> tuple[ActionState, ...]:
    return tuple(
        ActionState(id=action.id, type=action.type, node=node.sequence_id) for node in nodes for action in node.actions
    )


def _load_ids(nodes: tuple[Node, ...]) -> dict[str, str]:
    return {action.id: action.parameters.get("loadId", "") for action in _actions(nodes) if action.type == "pick"}
