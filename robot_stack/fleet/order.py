"""An order as the kernel uses it, read from a message that follows the schema.

Positions in m, angles in rad, in the map. Source of the rules: VDA 5050 2.1.0, 6.6.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any, Final

from robot_stack.fleet.codec import Data, references
from robot_stack.fleet.errors import Error, ErrorType, Refused
from robot_stack.fleet.link import Topic

LARGEST_ID: Final = 2**32 - 1
MAX_ID_LENGTH: Final = 128


@dataclass(frozen=True, slots=True)
class Action:
    """parameters: by their keys, as JSON values."""

    id: str
    type: str
    parameters: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Position:
    """theta: None if the message gives none; deviations 0 = the robot's own tolerance."""

    x: float
    y: float
    theta: float | None
    deviation_m: float
    deviation_rad: float
    map_id: str


@dataclass(frozen=True, slots=True)
class Node:
    id: str
    sequence_id: int
    released: bool
    position: Position | None
    actions: tuple[Action, ...]


@dataclass(frozen=True, slots=True)
class Edge:
    """fields: the optional ones of the message."""

    id: str
    sequence_id: int
    released: bool
    start: str
    end: str
    actions: tuple[Action, ...]
    fields: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Order:
    """nodes: one more than edges, alternating with them in their sequence ids. The first ``base`` nodes are released.

    references: by which errors name the message.
    """

    id: str
    update_id: int
    zone_set: str
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    references: tuple[tuple[str, str], ...]

    @property
    def base(self) -> int:
        return sum(node.released for node in self.nodes)

    @property
    def actions(self) -> tuple[Action, ...]:
        """Those of the nodes, in their sequence."""
        return tuple(action for node in self.nodes for action in node.actions)

    def refused(self, kind: ErrorType, text: str, *named: tuple[str, str], hint: str = "") -> Refused:
        """named: the erroneous fields, or what the error belongs to."""
        return Refused(Error(kind, text, (*self.references, *named), hint))


def read_actions(entries: list[Data]) -> tuple[Action, ...]:
    return tuple(
        Action(
            entry["actionId"],
            entry["actionType"],
            {item["key"]: item["value"] for item in entry.get("actionParameters", ())},
        )
        for entry in entries
    )


def read_order(data: Data) -> Order:
    """Raises Refused (validationError) for a graph that is no valid order."""
    order = Order(
        data["orderId"],
        int(data["orderUpdateId"]),
        data.get("zoneSetId", ""),
        tuple(map(_node, data["nodes"])),
        tuple(map(_edge, data["edges"])),
        references(Topic.ORDER, data),
    )
    problem = _problem(order)
    if problem:
        raise order.refused(ErrorType.VALIDATION, problem)
    return order


def _node(entry: Data) -> Node:
    return Node(
        entry["nodeId"],
        int(entry["sequenceId"]),
        entry["released"],
        _position(entry["nodePosition"]) if "nodePosition" in entry else None,
        read_actions(entry["actions"]),
    )


def _position(entry: Data) -> Position:
    return Position(
        float(entry["x"]),
        float(entry["y"]),
        float(entry["theta"]) if "theta" in entry else None,
        float(entry.get("allowedDeviationXY", 0.0)),
        abs(float(entry.get("allowedDeviationTheta", 0.0))),
        entry["mapId"],
    )


_EDGE_KEYS = frozenset({"edgeId", "sequenceId", "edgeDescription", "released", "startNodeId", "endNodeId", "actions"})


def _edge(entry: Data) -> Edge:
    return Edge(
        entry["edgeId"],
        int(entry["sequenceId"]),
        entry["released"],
        entry["startNodeId"],
        entry["endNodeId"],
        read_actions(entry["actions"]),
        {key: value for key, value in entry.items() if key not in _EDGE_KEYS},
    )


def _problem(order: Order) -> str:
    """Why the graph is invalid, empty if it is valid."""
    nodes, edges = order.nodes, order.edges
    actions = (*order.actions, *(action for edge in edges for action in edge.actions))
    ids = [order.id, *(node.id for node in nodes), *(edge.id for edge in edges), *(action.id for action in actions)]
    if not all(0 < len(one) <= MAX_ID_LENGTH for one in ids):
        return f"an id must have 1 to {MAX_ID_LENGTH} characters"
    if not nodes:
        return "an order needs a node"
    if len(edges) != len(nodes) - 1:
        return f"{len(nodes)} nodes need {len(nodes) - 1} edges, not {len(edges)}"
    first = nodes[0].sequence_id
    if order.update_id > LARGEST_ID or first + 2 * len(edges) > LARGEST_ID:
        return "orderUpdateId and sequenceId are uint32"
    for index, node in enumerate(nodes):
        if node.sequence_id != first + 2 * index:
            return f"node {node.id!r} has the sequenceId {node.sequence_id}, expected is {first + 2 * index}"
    for index, edge in enumerate(edges):
        start, end = nodes[index], nodes[index + 1]
        if edge.sequence_id != start.sequence_id + 1:
            return f"edge {edge.id!r} has the sequenceId {edge.sequence_id}, expected is {start.sequence_id + 1}"
        if (edge.start, edge.end) != (start.id, end.id):
            return f"edge {edge.id!r} must lead from {start.id!r} to {end.id!r}, the nodes before and after it"
        if edge.released != end.released:
            return f"edge {edge.id!r} must be released as its end node {end.id!r} is"
        if end.released and not start.released:
            return f"node {end.id!r} is released behind {start.id!r}, which is not"
    if not nodes[0].released:
        return "the first node must be released"
    twice = [one for one, count in Counter(action.id for action in actions).items() if count > 1]
    if twice:
        return f"the actionId {twice[0]!r} occurs more than once"
    return ""
