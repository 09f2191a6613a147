"""An order as the kernel uses it, read from a message that follows the schema.

Positions in m, angles in rad, in the map. Source of the rules: VDA 5050 2.1.0, 6.6; 3.0.0, 6.1.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import dataclass
from typing import Any, Final

from robot_stack.fleet.codec import Data, references
from robot_stack.fleet.errors import Error, ErrorType, Refused
from robot_stack.fleet.link import Topic
from robot_stack.fleet.version import Version

LARGEST_ID: Final = 2**32 - 1
MAX_ID_LENGTH: Final = 128


@dataclass(frozen=True, slots=True)
class Action:
    """parameters: by their keys, as JSON values. retriable: from 3.0 on."""

    id: str
    type: str
    parameters: dict[str, Any]
    retriable: bool = False


@dataclass(frozen=True, slots=True)
class Position:
    """theta: None if the message gives none.

    ellipse: semi-axes a and b in m and the angle of a, within which the node is reached; a circle before 3.0.
    Deviations of 0 are the robot's own tolerance, or with ``exact``, from 3.0 on, as close as it comes.
    """

    x: float
    y: float
    theta: float | None
    ellipse: tuple[float, float, float]
    deviation_rad: float
    exact: bool
    map_id: str

    @property
    def deviation_m(self) -> float:
        """Of the largest circle within the ellipse."""
        return min(self.ellipse[:2])


@dataclass(frozen=True, slots=True)
class Node:
    id: str
    sequence_id: int
    released: bool
    position: Position | None
    actions: tuple[Action, ...]


@dataclass(frozen=True, slots=True)
class Edge:
    """ends: ids of the nodes before and after it; None from 3.0 on, where the sequence says them.

    fields: the optional ones of the message.
    """

    id: str
    sequence_id: int
    released: bool
    ends: tuple[str, str] | None
    actions: tuple[Action, ...]
    fields: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Order:
    """nodes: one more than edges, alternating with them in their sequence ids. The first ``base`` nodes are released.

    references: by which errors name the message. digest: of its content, the header apart.
    """

    id: str
    update_id: int
    zone_set: str
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    references: tuple[tuple[str, str], ...]
    digest: str

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


def read_actions(entries: list[Data], version: Version) -> tuple[Action, ...]:
    return tuple(
        Action(
            entry["actionId"],
            entry["actionType"],
            {item["key"]: item["value"] for item in entry.get("actionParameters", ())},
            version is Version.V3 and entry.get("retriable", False),
        )
        for entry in entries
    )


_HEADER: Final = frozenset({"headerId", "timestamp", "version", "manufacturer", "serialNumber"})


def read_order(data: Data, version: Version) -> Order:
    """Raises Refused (validationError) for a graph that is no valid order."""
    content = {key: value for key, value in data.items() if key not in _HEADER}
    order = Order(
        data["orderId"],
        int(data["orderUpdateId"]),
        data.get("zoneSetId", "") if version is Version.V2 else "",
        tuple(_node(entry, version) for entry in data["nodes"]),
        tuple(_edge(entry, version) for entry in data["edges"]),
        references(Topic.ORDER, data),
        hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest(),
    )
    problem = _problem(order)
    if problem:
        raise order.refused(ErrorType.VALIDATION, problem)
    return order


def _node(entry: Data, version: Version) -> Node:
    return Node(
        entry["nodeId"],
        int(entry["sequenceId"]),
        entry["released"],
        _position(entry["nodePosition"], version) if "nodePosition" in entry else None,
        read_actions(entry["actions"], version),
    )


def _position(entry: Data, version: Version) -> Position:
    if version is Version.V3:
        axes = entry.get("allowedDeviationXY", {"a": 0.0, "b": 0.0, "theta": 0.0})
        ellipse = (float(axes["a"]), float(axes["b"]), float(axes["theta"]))
    else:
        ellipse = (*(float(entry.get("allowedDeviationXY", 0.0)),) * 2, 0.0)
    return Position(
        float(entry["x"]),
        float(entry["y"]),
        float(entry["theta"]) if "theta" in entry else None,
        ellipse,
        abs(float(entry.get("allowedDeviationTheta", 0.0))),
        version is Version.V3,
        entry["mapId"],
    )


_EDGE_KEYS: Final = frozenset(
    {"edgeId", "sequenceId", "edgeDescription", "edgeDescriptor", "released", "startNodeId", "endNodeId", "actions"}
)


def _edge(entry: Data, version: Version) -> Edge:
    return Edge(
        entry["edgeId"],
        int(entry["sequenceId"]),
        entry["released"],
        (entry["startNodeId"], entry["endNodeId"]) if version is Version.V2 else None,
        read_actions(entry["actions"], version),
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
        if edge.ends not in (None, (start.id, end.id)):
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
