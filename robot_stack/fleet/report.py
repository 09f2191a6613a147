"""The topics state and visualization, without their headers (VDA 5050 2.1.0, 6.10 and 6.13; 3.0.0, 6.6 and 6.7).

Fields have their names of 2.1.0; see ``names``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from robot_stack.contract import faults
from robot_stack.contract.model import Clears
from robot_stack.contract.states import MissionState
from robot_stack.core.geometry import wrap_angle
from robot_stack.fleet import progress
from robot_stack.fleet.acceptance import Mode, mode_of
from robot_stack.fleet.codec import Data
from robot_stack.fleet.errors import Error, ErrorType, Level, shortened
from robot_stack.fleet.instant import MAX_STATES
from robot_stack.fleet.record import ActionState, GraphPart, OrderRecord, Phase, Record, Status
from robot_stack.fleet.robot import RobotView
from robot_stack.fleet.vehicle import LOAD_POSITION, LOAD_TYPE, Vehicle
from robot_stack.fleet.version import Version

# A person resets it at the robot; COLLISION_IMMINENT goes by itself.
_FIELD: Final = ("COLLISION_IMMINENT", "CONTACT")
_OF_FIELD: Final = "COLLISION_IMMINENT"


def state_of(
    record: Record,
    robot: RobotView,
    vehicle: Vehicle,
    errors: Iterable[Error],
    *,
    standing: bool,
    base_request_m: float,
) -> Data:
    """standing: neither driving nor turning. base_request_m: the base is low with less than this ahead."""
    order, version = record.order, vehicle.version
    actions = [_action(one) for one in (order.actions if order is not None else ())]
    instant_actions = [_action(one) for one in record.instant]
    data: Data = {
        "maps": [{"mapId": vehicle.map_id, "mapVersion": vehicle.map_version, "mapStatus": "ENABLED"}],
        "orderId": order.id if order is not None else "",
        "orderUpdateId": order.update_id if order is not None else 0,
        "lastNodeId": record.last_node,
        "lastNodeSequenceId": record.last_sequence_id,
        "nodeStates": [_node(node) for node in (order.nodes if order is not None else ())],
        "edgeStates": [_edge(edge) for edge in (order.edges if order is not None else ())],
        "loads": _loads(order, robot),
        "driving": not standing,
        "paused": robot.mission is not None and robot.mission.state == MissionState.PAUSED,
        "newBaseRequest": _base_is_low(order, robot, base_request_m),
        "actionStates": actions if version is Version.V3 else actions + instant_actions,
        "batteryState": _battery(robot),
        "operatingMode": mode_of(robot, order).value,
        "errors": [error.data(version) for error in (*errors, *_own_errors(record, robot, version))],
        "information": _information(robot),
        "safetyState": _safety(robot, version),
    }
    if version is Version.V3:
        data["instantActionStates"] = instant_actions
    return data | position_of(robot, vehicle)


def position_of(robot: RobotView, vehicle: Vehicle) -> Data:
    """agvPosition and velocity as far as they are known; also the body of the topic visualization.

    3.0 demands a position of a robot that can localize itself, also an unknown one.
    """
    data: Data = {}
    pose, twist = robot.pose, robot.twist
    if pose is not None and pose.is_finite():
        data["agvPosition"] = {
            "x": pose.x,
            "y": pose.y,
            "theta": wrap_angle(pose.yaw),
            "mapId": vehicle.map_id,
            "positionInitialized": robot.localized,
        }
        if 0.0 <= robot.quality <= 1.0:
            data["agvPosition"]["localizationScore"] = robot.quality
    elif vehicle.version is Version.V3:
        data["agvPosition"] = {"x": 0.0, "y": 0.0, "theta": 0.0, "mapId": vehicle.map_id, "positionInitialized": False}
    if twist is not None and twist.is_finite():
        data["velocity"] = {"vx": twist.vx, "vy": twist.vy, "omega": twist.omega}
    return data


_UNSTEADY: Final = ("agvPosition", "velocity", "batteryState")


def event_of(state: Data) -> Data:
    """What of a state is an event if it changes (6.10): all but the quantities that change all the time."""
    battery = {"charging": state["batteryState"]["charging"]}
    return {key: value for key, value in state.items() if key not in _UNSTEADY} | battery


def _node(node: GraphPart) -> Data:
    return {"nodeId": node.id, "sequenceId": node.sequence_id, "released": node.released}


def _edge(edge: GraphPart) -> Data:
    return {"edgeId": edge.id, "sequenceId": edge.sequence_id, "released": edge.released}


def _action(state: ActionState) -> Data:
    data: Data = {"actionId": state.id, "actionType": shortened(state.type), "actionStatus": state.status.value}
    return data | ({"resultDescription": shortened(state.result)} if state.result else {})


def _loads(order: OrderRecord | None, robot: RobotView) -> list[Data]:
    if not robot.loaded:
        return []
    load: Data = {"loadType": LOAD_TYPE, "loadPosition": LOAD_POSITION}
    picked = [action for action in (order.actions if order is not None else ()) if action.status is Status.FINISHED]
    last = next((action.id for action in reversed(picked) if action.type == "pick"), "")
    load_id = order.load_ids.get(last, "") if order is not None else ""
    return [load | ({"loadId": load_id} if load_id else {})]


def _base_is_low(order: OrderRecord | None, robot: RobotView, limit_m: float) -> bool:
    if order is None or order.phase is not Phase.ACTIVE or not order.horizon or robot.pose is None:
        return False
    return progress.base_left_m(order, robot.pose) < limit_m


def _battery(robot: RobotView) -> Data:
    battery = robot.battery
    if battery is None or not math.isfinite(battery.percent):
        return {"batteryCharge": 0.0, "charging": False}
    data: Data = {"batteryCharge": battery.percent, "charging": battery.charging}
    return data | ({"batteryVoltage": battery.voltage} if math.isfinite(battery.voltage) else {})


def _safety(robot: RobotView, version: Version) -> Data:
    safety = robot.safety
    if safety is None:
        return {"eStop": "MANUAL", "fieldViolation": False}
    held = _OF_FIELD in safety.faults and version is Version.V2
    stop = "MANUAL" if safety.emergency else "AUTOACK" if held else "NONE"
    return {"eStop": stop, "fieldViolation": any(code in safety.faults for code in _FIELD)}


def _own_errors(record: Record, robot: RobotView, version: Version) -> list[Error]:
    errors = [_fault_error(code) for code in (robot.safety.faults if robot.safety is not None else ())]
    if robot.safety is None:
        text = "the safety monitor does not report: the robot does not drive"
        errors.append(Error(ErrorType.SAFETY_UNKNOWN, text, level=Level.FATAL))
    if robot.battery is None or not math.isfinite(robot.battery.percent):
        errors.append(Error(ErrorType.BATTERY_UNKNOWN, "the battery does not report: a charge of 0 means unknown"))
    if robot.queue is None or robot.mission is None:
        text = "the mission manager does not report: orders do not start"
        errors.append(Error(ErrorType.MISSIONS_UNKNOWN, text, level=Level.FATAL))
    if version is Version.V3 and not robot.localized:
        errors.append(Error(ErrorType.LOCALIZATION, "the robot does not know where it is", level=Level.FATAL))
    if version is Version.V3 and len(record.instant) >= MAX_STATES:
        text = f"the oldest of more than {MAX_STATES} instant actions are forgotten"
        errors.append(Error(ErrorType.INSTANT_STATES_FULL, text, hint="send clearInstantActions"))
    order = record.order
    if order is None:
        return errors
    references: tuple[tuple[str, str], ...] = (("orderId", order.id), ("orderUpdateId", str(order.update_id)))
    if order.phase is Phase.ACTIVE and order.part is not None and order.part.refusal:
        text = f"the mission manager does not take the update: {order.part.refusal}"
        errors.append(Error(ErrorType.ORDER_UPDATE, text, references, "cancel the order, or wait: it is asked again"))
    if version is Version.V3 and order.unreachable:
        named = (*references, ("nodeId", order.unreachable))
        errors.append(Error(ErrorType.UNREACHABLE, f"the robot did not reach the node {order.unreachable!r}", named))
    if order.phase is Phase.ABORTED:
        references = (*references, ("nodeId", record.last_node))
        hint = "staff look after the robot and release the queue; then send a new order"
        ready = version is Version.V3 and mode_of(robot, order) is Mode.AUTOMATIC
        level = Level.CRITICAL if ready else Level.FATAL
        errors.append(Error(ErrorType.ORDER_ABORTED, order.reason, references, hint, level))
    return errors


def _fault_error(code: str) -> Error:
    """A latched fault needs a person, every other one goes by itself."""
    fault = faults.BY_CODE.get(code)
    if fault is None:
        return Error(code, "a fault of the safety monitor", level=Level.FATAL)
    latched = fault.clears is Clears.ON_RESET
    hint = "staff remove the cause and reset the safety monitor" if latched else "goes by itself with its cause"
    return Error(code, fault.raised_when, (("faultCode", code),), hint, Level.FATAL if latched else Level.WARNING)


def _information(robot: RobotView) -> list[Data]:
    texts = {
        "queue": robot.queue.reason if robot.queue is not None else "",
        "mission": robot.mission.reason if robot.mission is not None else "",
    }
    return [
        {"infoType": kind, "infoLevel": "INFO", "infoDescription": shortened(text)}
        for kind, text in texts.items()
        if text
    ]
