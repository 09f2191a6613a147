"""What this robot can carry out of an order, and the order's base as waypoints of a mission.

Positions in m, angles in rad, in the map.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import FASTEST, MAX_WAYPOINTS, SLOWEST, Kind
from robot_stack.core.robot import Robot
from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.order import Action, Edge, Node, Order, Position
from robot_stack.fleet.params import FleetParams
from robot_stack.fleet.version import Version

MAP_ID_KEY: Final = "nodePosition.mapId"
LOAD_TYPE: Final = "wheelchair"
LOAD_POSITION: Final = "front"
MAX_LOAD_ID_LENGTH: Final = 128
_LONGEST_WAIT_S: Final = 86_400.0
_FARTHEST_M: Final = 10_000.0  # of a coordinate, as in mission files
_SAME_PLACE_M: Final = 1e-3
# Fields of edges that say nothing about how this robot drives: it plans its paths itself.
_WITHOUT_EFFECT: Final = frozenset({"length", "orientationType"})
_SPEED: Final = ("maxSpeed", "maximumSpeed")
_ROTATION: Final = ("maxRotationSpeed", "maximumRotationSpeed")
_HARMLESS: Final = (("rotationAllowed", True), ("reachOrientationBeforeEntering", False))


@dataclass(frozen=True, slots=True)
class Vehicle:
    """version: of the protocol. docks: kind of each dock by its id.

    start_m: of the first node without a deviation. pass_m, pass_rad, stand_m, stand_rad: within which the mission
    manager takes a waypoint for reached, driving on or standing.
    """

    version: Version
    map_id: str
    map_version: str
    docks: Mapping[str, str]
    height_m: float
    start_m: float
    pass_m: float
    pass_rad: float
    stand_m: float
    stand_rad: float
    max_actions_per_node: int

    @property
    def chargers(self) -> tuple[str, ...]:
        return tuple(sorted(name for name, kind in self.docks.items() if kind == "charger"))

    @property
    def node_actions(self) -> tuple[str, ...]:
        return (*_NODE_ACTIONS, START_CHARGING) if self.chargers else _NODE_ACTIONS

    def charger(self, action: Action) -> str:
        """The charger that the action names, or the only one; empty without such a one."""
        name = action.parameters.get("stationName", self.chargers[0] if len(self.chargers) == 1 else "")
        return name if name in self.chargers else ""

    @classmethod
    def of(cls, params: FleetParams, robot: Robot, docks: Mapping[str, str], map_version: str) -> Vehicle:
        """docks: kind of each dock by its id."""
        return cls(
            version=params.protocol_version,
            map_id=params.map,
            map_version=map_version,
            docks=docks,
            height_m=robot.mast.top_m,
            start_m=params.start_m,
            pass_m=params.pass_m,
            pass_rad=params.pass_rad,
            stand_m=params.stand_m,
            stand_rad=params.stand_rad,
            max_actions_per_node=params.limits.actions_per_node,
        )


@dataclass(frozen=True, slots=True)
class Stop:
    """One waypoint. node: its sequence id. action: of the order, "" = arriving at the node.

    max_speed_mps, max_yaw_rate_radps: on the way to it; 0 = no limit.
    """

    node: int
    action: str
    name: str
    x: float
    y: float
    yaw: float
    kind: Kind
    wait_s: float = 0.0
    dock_id: str = ""
    max_speed_mps: float = 0.0
    max_yaw_rate_radps: float = 0.0


# --- actions ---------------------------------------------------------------------------------------------------------

START_CHARGING: Final = "startCharging"
_NODE_ACTIONS: Final = ("pick", "drop", "wait")
_PARAMETERS: Final = {
    "pick": ("stationName", "stationType", "loadType", "loadId", "lhd"),
    "drop": ("stationName", "stationType", "loadType", "loadId", "lhd"),
    "wait": ("duration",),
    START_CHARGING: ("stationName",),
}


def _action_problem(action: Action, vehicle: Vehicle) -> tuple[str, str]:
    """(name of the erroneous field, why it cannot be carried out); empty texts if it can."""
    if action.type not in vehicle.node_actions:
        why = (
            "is not supported: the site has no charger"
            if action.type == START_CHARGING
            else "is not supported on nodes"
        )
        return "actionType", f"the action {action.type!r} {why}; supported: {', '.join(vehicle.node_actions)}"
    if action.retriable:
        return "retriable", "a failed action is not tried again"
    values = action.parameters
    unknown = sorted(values.keys() - set(_PARAMETERS[action.type]))
    if unknown:
        return unknown[0], f"{action.type} has no parameter {unknown[0]!r} here"
    if action.type == "wait":
        duration: Any = values.get("duration")
        if not _is_number(duration) or not 0.0 <= duration <= _LONGEST_WAIT_S:
            return "duration", f"wait needs a duration of 0 to {_LONGEST_WAIT_S:.0f} s"
        return "", ""
    wrong = [key for key, value in values.items() if not isinstance(value, str)]
    if wrong:
        return wrong[0], f"{wrong[0]} must be a string"
    if action.type == START_CHARGING:
        known = ", ".join(vehicle.chargers)
        return (
            ("", "") if vehicle.charger(action) else ("stationName", f"startCharging needs a charger; known: {known}")
        )
    if len(values.get("loadId", "")) > MAX_LOAD_ID_LENGTH:
        return "loadId", f"loadId has at most {MAX_LOAD_ID_LENGTH} characters"
    if values.get("loadType", LOAD_TYPE) != LOAD_TYPE:
        return "loadType", f"the only load is a {LOAD_TYPE!r}"
    if values.get("lhd", LOAD_POSITION) != LOAD_POSITION:
        return "lhd", f"the only load handling device is {LOAD_POSITION!r}"
    if action.type == "pick":
        dock = values.get("stationName", "")
        chairs = sorted(name for name, kind in vehicle.docks.items() if kind == "wheelchair")
        if dock not in chairs:
            return "stationName", f"pick needs the stationName of a wheelchair dock, {dock!r} is none; known: {chairs}"
    return "", ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


# --- fields ----------------------------------------------------------------------------------------------------------


def check(order: Order, vehicle: Vehicle) -> None:
    """Base and horizon alike. Raises Refused with the field or the action that cannot be used."""
    if order.zone_set:
        raise order.refused(ErrorType.UNSUPPORTED, "zones are not supported", ("zoneSetId", order.zone_set))
    if len(order.nodes) > MAX_WAYPOINTS:
        text = f"{len(order.nodes)} nodes, at most {MAX_WAYPOINTS} in one message"
        raise order.refused(ErrorType.MEMORY, text, ("nodes", str(len(order.nodes))))
    for edge in order.edges:
        field, text = _edge_problem(edge, vehicle)
        if field:
            kind = ErrorType.ORDER_ACTION if field == "actions" else ErrorType.UNSUPPORTED
            raise order.refused(kind, text, ("edgeId", edge.id), (f"edge.{field}", _shown(edge, field)))
    for node in order.nodes:
        problem = _node_problem(node, vehicle)
        if problem is not None:
            kind, field, text = problem
            raise order.refused(kind, text, ("nodeId", node.id), ("field", field))
        for action in node.actions:
            field, text = _action_problem(action, vehicle)
            if field:
                named = (("nodeId", node.id), ("actionId", action.id), ("field", field))
                kind = ErrorType.UNSUPPORTED if field == "retriable" else ErrorType.ORDER_ACTION
                raise order.refused(kind, text, *named)
            if action.type == START_CHARGING and order.nodes[-1].actions[-1:] != (action,):
                text = "the order goes on after startCharging: it must end there, and stopCharging follows"
                raise order.refused(ErrorType.ORDER_ACTION, text, ("nodeId", node.id), ("actionId", action.id))


def _shown(edge: Edge, field: str) -> str:
    value = edge.fields.get(field, "")
    return "object" if isinstance(value, dict) else str(value)


def _edge_problem(edge: Edge, vehicle: Vehicle) -> tuple[str, str]:
    """(name of the erroneous field, why it cannot be used); empty texts if all can."""
    if edge.actions:
        return "actions", f"actions on edges are not supported: {edge.actions[0].type!r}"
    least = {
        **dict.fromkeys((*_SPEED, *_ROTATION), SLOWEST),
        "maxHeight": vehicle.height_m,
        "maximumMobileRobotHeight": vehicle.height_m,
    }
    for field, value in edge.fields.items():
        if field in least:
            if not _is_number(value) or value < least[field]:
                return field, f"{field} {value} cannot be kept: it must be at least {least[field]}"
        elif field not in _WITHOUT_EFFECT and (field, value) not in _HARMLESS:
            return field, f"the field {field} of edges is not supported"
    return "", ""


def _node_problem(node: Node, vehicle: Vehicle) -> tuple[ErrorType, str, str] | None:
    """(error, name of the erroneous field, why it cannot be used)."""
    position = node.position
    if position is None:
        text = "every node needs its nodePosition: the robot plans its paths itself"
        return ErrorType.UNSUPPORTED, "nodePosition", text
    if position.map_id != vehicle.map_id:
        text = f"the map {position.map_id!r} is not on the vehicle, which has {vehicle.map_id!r}"
        return ErrorType.UNKNOWN_MAP, MAP_ID_KEY, text
    if max(abs(position.x), abs(position.y)) > _FARTHEST_M:
        text = f"the position is farther than {_FARTHEST_M:.0f} m from the map's origin"
        return ErrorType.NO_ROUTE, "nodePosition", text
    if not position.exact and 0.0 < position.deviation_m < vehicle.stand_m:
        return ErrorType.UNSUPPORTED, "allowedDeviationXY", f"the robot stops within {vehicle.stand_m} m, not tighter"
    turns = position.theta is not None and not position.exact
    if turns and 0.0 < position.deviation_rad < vehicle.stand_rad:
        text = f"the robot stops within {vehicle.stand_rad} rad, not tighter"
        return ErrorType.UNSUPPORTED, "allowedDeviationTheta", text
    if len(node.actions) > vehicle.max_actions_per_node:
        text = f"{len(node.actions)} actions, at most {vehicle.max_actions_per_node} on one node"
        return ErrorType.MEMORY, "actions", text
    return None


def check_loads(order: Order, actions: tuple[Action, ...], loaded: bool) -> bool:
    """Whether a wheelchair is attached after ``actions`` that begin with one if ``loaded``.

    Raises Refused for a pick or a charger while carrying one, and for a drop without.
    """
    for action in actions:
        if action.type in ("pick", START_CHARGING) and loaded:
            text = f"{action.type} with a wheelchair attached: drop first"
            raise order.refused(ErrorType.ORDER_ACTION, text, ("actionId", action.id))
        if action.type == "drop" and not loaded:
            raise order.refused(ErrorType.ORDER_ACTION, "drop without a wheelchair attached", ("actionId", action.id))
        loaded = action.type == "pick" or (loaded and action.type != "drop")
    return loaded


# --- route -----------------------------------------------------------------------------------------------------------


def stops_of(
    nodes: tuple[Node, ...], edges: tuple[Edge, ...], before: Pose2, ends: bool, vehicle: Vehicle
) -> tuple[Stop, ...]:
    """The waypoints of released nodes. before: where the robot comes from. ends: the route ends with the last node.

    A node with actions is reached standing, then each of its actions is a waypoint at the same pose.
    edges: those that lead to the nodes, also others; their speeds hold until the node is left.
    """
    stops: list[Stop] = []
    by_end = {edge.sequence_id + 1: edge for edge in edges}
    for node in nodes:
        if node.position is None:
            raise ValueError(f"node {node.id!r} has not been checked")
        pose = _pose(node.position, before)
        stand = bool(node.actions) or _is_precise(node.position, vehicle)
        kind = Kind.WAIT if stand else Kind.PARK if ends and node is nodes[-1] else Kind.PASS
        arrival = Stop(node.sequence_id, "", _name(node, 0), pose.x, pose.y, pose.yaw, kind)
        if node.sequence_id in by_end:
            edge = by_end[node.sequence_id]
            limits = _lowest(edge, _SPEED), _lowest(edge, _ROTATION)
            arrival = replace(arrival, max_speed_mps=limits[0], max_yaw_rate_radps=limits[1])
        stops.append(arrival)
        for number, action in enumerate(node.actions, 1):
            what: dict[str, Any] = {"kind": Kind.UNDOCK}
            if action.type == "pick":
                what = {"kind": Kind.DOCK, "dock_id": action.parameters["stationName"]}
            elif action.type == START_CHARGING:
                what = {"kind": Kind.DOCK, "dock_id": vehicle.charger(action)}
            elif action.type == "wait":
                what = {"kind": Kind.WAIT, "wait_s": float(action.parameters["duration"])}
            stops.append(replace(arrival, action=action.id, name=_name(node, number), **what))
        before = pose
    return tuple(stops)


def _lowest(edge: Edge, fields: tuple[str, ...]) -> float:
    """The limit that the edge has by one of these names; 0 without one, or above the largest of a mission."""
    return min((float(edge.fields[key]) for key in fields if edge.fields.get(key, math.inf) <= FASTEST), default=0.0)


def _pose(position: Position, before: Pose2) -> Pose2:
    """Without theta the robot looks where it comes from driving."""
    dx, dy = position.x - before.x, position.y - before.y
    travel = math.atan2(dy, dx) if math.hypot(dx, dy) > _SAME_PLACE_M else before.yaw
    return Pose2(position.x, position.y, travel if position.theta is None else position.theta)


def _is_precise(position: Position, vehicle: Vehicle) -> bool:
    """Passing it would not be within its deviations."""
    least = -1.0 if position.exact else 0.0
    turned = position.theta is not None and least < position.deviation_rad < vehicle.pass_rad
    return least < position.deviation_m < vehicle.pass_m or turned


def _name(node: Node, number: int) -> str:
    """Unique within an order, at most 64 characters, and printable: the screen shows it."""
    text = "".join(letter if letter.isprintable() else "?" for letter in node.id)
    return f"{node.sequence_id}.{number} {text}"[:64].strip()


def start_problem(node: Node, pose: Pose2 | None, vehicle: Vehicle) -> str:
    """Why the first node of a new order is not trivially reachable (2.1.0, 6.6.1; 3.0.0, 6.1.1), empty if it is."""
    if pose is None or node.position is None:
        return "the robot does not know where it is"
    dx, dy = pose.x - node.position.x, pose.y - node.position.y
    a, b, angle = node.position.ellipse
    if max(a, b) == 0.0:
        a = b = vehicle.start_m
    along, across = dx * math.cos(angle) + dy * math.sin(angle), dy * math.cos(angle) - dx * math.sin(angle)
    # Narrower than the robot stands is not asked of it.
    if math.hypot(along / max(a, vehicle.stand_m), across / max(b, vehicle.stand_m)) > 1.0:
        allowed = f"{a:.2f} m" if a == b else f"{a:.2f} m and {b:.2f} m across"
        return f"the robot stands {math.hypot(dx, dy):.2f} m from the first node {node.id!r}, allowed are {allowed}"
    return ""
