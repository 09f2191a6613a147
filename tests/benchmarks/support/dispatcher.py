"""An example of a fleet manager: transports to robots, over one-lane ways, in messages of VDA 5050 2.1.

It is no part of the robot's product. Pure: messages and times in, messages out. It never deadlocks (``Traffic``).
"""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

from robot_stack.fleet.codec import timestamp
from robot_stack.fleet.link import Topic

Data = dict[str, Any]
Message = tuple[str, Topic, bytes]
"""Serial number, topic, payload."""

_ONCOMING: Final = 2.0  # cost of an edge that another robot will drive the other way, in lengths of the edge


@dataclass(frozen=True)
class Site:
    """places: x, y of each node, m in the map. edges: without direction; none crosses another or leads by a node.

    homes: by serial number, a node that belongs to one robot and leads nowhere else; it stands there at the beginning.
    chargers: the dock's id by its node, which leads nowhere else either. Nodes are so far apart that robots at two
    nodes, or between others, have room for each other. manufacturer: as in the topics.
    """

    places: Mapping[str, tuple[float, float]]
    edges: frozenset[tuple[str, str]]
    homes: Mapping[str, str]
    chargers: Mapping[str, str] = field(default_factory=dict)
    map_id: str = "yard"
    manufacturer: str = "robot_stack"


@dataclass(frozen=True)
class Rules:
    """low, full: charge in percent, below which a robot goes to a charger, and with which it leaves.

    ahead: released nodes before a robot. repeat_s: a message that no state shows is sent again. handling_s: a
    passenger boards, and again alights, if the transport has no dock.
    """

    low: float = 40.0
    full: float = 90.0
    ahead: int = 4
    repeat_s: float = 3.0
    handling_s: float = 20.0


@dataclass
class Transport:
    """source, destination: nodes. dock: of the wheelchair at the source, "" = the passenger is handled in a wait."""

    id: str
    source: str
    destination: str
    dock: str = ""
    robot: str = ""
    done_s: float = math.nan


class Traffic:
    """Which nodes each robot holds; a robot holds both ends of the edge that it is on, so no edge has two robots.

    No deadlock: a node is granted only in a safe state (Dijkstra's banker). Every robot has a claim: the nodes of its
    order that it does not hold yet, and then the way to its home. A state is safe if the robots can drive their
    claims one after the other in some order, each to its end, while those that have not driven yet stand where they
    are. At home a robot is in no other robot's way. All robots at home are a safe state; each grant leads from a safe
    state to a safe one; and in a safe state the first robot of that order can be granted its next node. So some
    robot always advances until all are at home. A new order of a robot must leave the state safe, or waits.
    """

    def __init__(self, homes: Mapping[str, str]) -> None:
        self._bits: dict[str, int] = {}
        self.held = {serial: self._mask([home]) for serial, home in homes.items()}
        self.claimed = dict.fromkeys(homes, 0)

    def _mask(self, nodes: Iterable[str]) -> int:
        mask = 0
        for node in nodes:
            mask |= 1 << self._bits.setdefault(node, len(self._bits))
        return mask

    def hold(self, serial: str, nodes: Iterable[str]) -> None:
        self.held[serial] = self._mask(nodes)

    def grants(self, serial: str, node: str, claim: Iterable[str]) -> bool:
        """Gives the robot the node, "" for none, and the claim behind it, if this is safe."""
        before = self.held[serial], self.claimed[serial]
        wanted = self._mask([node] if node else [])
        if any(held & wanted for other, held in self.held.items() if other != serial):
            return False
        self.held[serial], self.claimed[serial] = before[0] | wanted, self._mask(claim)
        if self._safe():
            return True
        self.held[serial], self.claimed[serial] = before
        return False

    def _safe(self) -> bool:
        """A robot that can drive its claim frees what it holds and is out of the way: the order does not matter.

        One without a claim can, and likewise frees all but its home, which no other robot claims.
        """
        left = [serial for serial, claim in self.claimed.items() if claim]
        taken = 0
        for serial in left:
            taken |= self.held[serial]
        while left:
            stuck = []
            for serial in left:
                if self.claimed[serial] & taken & ~self.held[serial]:
                    stuck.append(serial)
                else:
                    taken &= ~self.held[serial]
            if len(stuck) == len(left):
                return False
            left = stuck
        return True


@dataclass
class _Robot:
    """path: nodes of the order, then those of the way home. order_length: how many of them are the order's.

    at, released: indices in path, of the last node and of the last released one. sent: the message that no state shows
    yet. stop_id: of its stopCharging. since: number of the order, over all robots. fresh: no message has it yet.
    """

    serial: str
    path: list[str]
    order_length: int = 1
    at: int = 0
    released: int = 0
    order_id: str = ""
    update: int = 0
    actions: dict[int, list[Data]] = field(default_factory=dict)
    transport: Transport | None = None
    state: Data = field(default_factory=dict)
    online: bool = True
    sent: tuple[Topic, Data] | None = None
    sent_s: float = -math.inf
    stop_id: str = ""
    since: int = 0
    fresh: bool = False

    def send(self, topic: Topic, body: Data) -> None:
        self.sent, self.sent_s = (topic, body), -math.inf

    @property
    def node(self) -> str:
        return self.path[self.at]

    @property
    def order_ended(self) -> bool:
        """Driven to its end: a robot whose order was aborted is left to staff."""
        state = self.state
        if not self.order_id:
            return True
        own = (state["orderId"], state["orderUpdateId"]) == (self.order_id, self.update)
        finished = all(action["actionStatus"] == "FINISHED" for action in state["actionStates"])
        return own and self.at == self.order_length - 1 and not state["nodeStates"] and finished

    @property
    def free(self) -> bool:
        """An order would be accepted, as far as the states show it."""
        state = self.state
        known = self.online and state and state["operatingMode"] == "AUTOMATIC" and not (self.sent or self.fresh)
        return bool(known and state.get("agvPosition", {}).get("positionInitialized") and self.order_ended)

    @property
    def charging(self) -> bool:
        actions = self.actions.get(self.order_length - 1, ())
        return bool(self.order_id) and not self.stop_id and any(one["actionType"] == "startCharging" for one in actions)


class Dispatcher:
    """Transports are given in the order of ``add``, each to the nearest free robot."""

    def __init__(self, site: Site, rules: Rules | None = None) -> None:
        self._site, self._rules = site, rules or Rules()
        self._near: dict[str, list[str]] = {node: [] for node in site.places}
        for one, other in sorted(site.edges):
            self._near[one].append(other)
            self._near[other].append(one)
        self._ends = {*site.homes.values(), *site.chargers}
        self._robots = {serial: _Robot(serial, [home]) for serial, home in site.homes.items()}
        self._traffic = Traffic(site.homes)
        self._headers = self._orders = 0
        self.waiting: list[Transport] = []
        self.done: list[Transport] = []

    def add(self, transport: Transport) -> None:
        self.waiting.append(transport)

    @property
    def at_home(self) -> bool:
        return all(robot.node == self._site.homes[serial] for serial, robot in self._robots.items())

    def receive(self, serial: str, topic: Topic, payload: bytes) -> None:
        """A message of a robot. One that is older than the newest state has no effect."""
        robot = self._robots.get(serial)
        if robot is None:
            return
        data = json.loads(payload)
        if topic is Topic.CONNECTION:
            robot.online = data["connectionState"] == "ONLINE"
        if topic is not Topic.STATE or data["headerId"] <= robot.state.get("headerId", -1):
            return
        robot.state = data
        statuses = {one["actionId"]: one["actionStatus"] for one in data["actionStates"]}
        if data["orderId"] == robot.order_id:
            index = data["lastNodeSequenceId"] // 2
            # Until the first node of an order is traversed, a state has the last node of the order before.
            if robot.at < index <= robot.released and robot.path[index] == data["lastNodeId"]:
                robot.at = index
            self._traffic.hold(serial, robot.path[robot.at : robot.released + 1])
            if robot.sent and robot.sent[0] is Topic.ORDER and data["orderUpdateId"] >= robot.update:
                robot.sent = None
        if robot.stop_id and statuses.get(robot.stop_id) == "FINISHED":
            robot.sent = None

    def tick(self, now_s: float) -> list[Message]:
        """Gives orders, releases what is free, and repeats what was not answered."""
        for robot in self._robots.values():
            self._finish(robot, now_s)
        for transport in tuple(self.waiting):
            if self._give(transport):
                self.waiting.remove(transport)
        for robot in self._robots.values():
            if robot.free:
                self._without_transport(robot)
        self._release()
        return [message for robot in self._robots.values() for message in self._speak(robot, now_s)]

    # --- orders ------------------------------------------------------------------------------------------------------

    def _finish(self, robot: _Robot, now_s: float) -> None:
        if robot.transport is not None and robot.free:
            robot.transport.done_s = now_s
            self.done.append(robot.transport)
            robot.transport = None

    def _give(self, transport: Transport) -> bool:
        ready = [
            robot
            for robot in self._robots.values()
            if robot.free and not robot.charging and robot.transport is None and not self._is_low(robot)
        ]
        lengths = {robot.serial: len(self._way(robot, robot.node, transport.source)) for robot in ready}
        for robot in sorted(ready, key=lambda one: (lengths[one.serial], one.serial)):
            to_source = self._way(robot, robot.node, transport.source)
            path = to_source + self._way(robot, transport.source, transport.destination)[1:]
            pick: tuple[str, Data] = ("wait", {"duration": self._rules.handling_s})
            drop = pick
            if transport.dock:
                pick, drop = ("pick", {"stationName": transport.dock}), ("drop", {})
            if self._order(robot, path, {len(to_source) - 1: pick, len(path) - 1: drop}):
                robot.transport, transport.robot = transport, robot.serial
                return True
        return False

    def _is_low(self, robot: _Robot) -> bool:
        return bool(self._site.chargers) and robot.state["batteryState"]["batteryCharge"] < self._rules.low

    def _without_transport(self, robot: _Robot) -> None:
        """To a charger, away from it, or home: elsewhere it would be in the way."""
        if robot.charging:
            if robot.state["batteryState"]["batteryCharge"] >= self._rules.full:
                robot.stop_id = f"{robot.order_id}.stop"
                robot.send(Topic.INSTANT_ACTIONS, {"actions": [_action("stopCharging", robot.stop_id, {})]})
            return
        if self._is_low(robot):
            used = {node for other in self._robots.values() if other is not robot for node in other.path[other.at :]}
            ways = [self._way(robot, robot.node, node) for node in self._site.chargers if node not in used]
            for way in sorted(ways, key=len):
                charge = ("startCharging", {"stationName": self._site.chargers[way[-1]]})
                if self._order(robot, way, {len(way) - 1: charge}):
                    return
        if robot.node != self._site.homes[robot.serial]:
            self._order(robot, robot.path[robot.at :], {})

    def _order(self, robot: _Robot, path: list[str], actions: Mapping[int, tuple[str, Data]]) -> bool:
        """Gives an order over ``path`` from where the robot stands, if this is safe.

        actions: type and parameters by the index in the path.
        """
        home = self._way(robot, path[-1], self._site.homes[robot.serial])[1:]
        if not self._traffic.grants(robot.serial, "", [*path[1:], *home]):
            return False
        self._orders += 1
        robot.path, robot.order_length, robot.at, robot.released = [*path, *home], len(path), 0, 0
        robot.order_id, robot.update, robot.stop_id, robot.since = f"order-{self._orders}", 0, "", self._orders
        robot.actions = {
            index: [_action(kind, f"{robot.order_id}.{index}", parameters)]
            for index, (kind, parameters) in actions.items()
        }
        robot.fresh = True
        return True

    def _way(self, robot: _Robot, start: str, end: str) -> list[str]:
        """The shortest way that avoids oncoming robots, and the homes and chargers on its way."""
        oncoming = {
            edge
            for other in self._robots.values()
            if other is not robot
            for edge in pairwise(other.path[other.at : other.order_length])
        }
        best, queue, before = {start: 0.0}, [(0.0, start)], {start: ""}
        while queue:
            cost, node = heapq.heappop(queue)
            if node == end:
                break
            for near in self._near[node]:
                if near in self._ends and near != end:
                    continue
                factor = 1.0 + _ONCOMING * ((near, node) in oncoming)
                further = cost + factor * math.dist(self._site.places[node], self._site.places[near])
                if further < best.get(near, math.inf):
                    best[near], before[near] = further, node
                    heapq.heappush(queue, (further, near))
        way = [end]
        while before[way[-1]]:
            way.append(before[way[-1]])
        return way[::-1]

    # --- base and horizon --------------------------------------------------------------------------------------------

    def _release(self) -> None:
        """The robot that has its order for longest first, so that none waits for ever.

        An update follows only once a state shows the message before: it begins with the last node of the robot's base.
        """
        for robot in sorted(self._robots.values(), key=lambda one: one.since):
            if robot.sent is not None or not (robot.fresh or robot.released < robot.order_length - 1):
                continue
            first = 0 if robot.fresh else robot.released
            last = min(robot.at + self._rules.ahead, robot.order_length - 1)
            while robot.released < last and self._grant_next(robot):
                robot.released += 1
            if robot.fresh or robot.released > first:
                robot.update += not robot.fresh
                robot.fresh = False
                robot.send(Topic.ORDER, self._order_from(robot, first))

    def _grant_next(self, robot: _Robot) -> bool:
        following = robot.released + 1
        return self._traffic.grants(robot.serial, robot.path[following], robot.path[following + 1 :])

    def _order_from(self, robot: _Robot, first: int) -> Data:
        """The order from a node on: base and horizon."""
        path, indices = robot.path, range(first, robot.order_length)
        nodes = [
            {
                "nodeId": path[index],
                "sequenceId": 2 * index,
                "released": index <= robot.released,
                "nodePosition": self._position(path[index]),
                "actions": robot.actions.get(index, []),
            }
            for index in indices
        ]
        edges = [
            {
                "edgeId": f"{path[index - 1]}-{path[index]}",
                "sequenceId": 2 * index - 1,
                "released": index <= robot.released,
                "startNodeId": path[index - 1],
                "endNodeId": path[index],
                "actions": [],
            }
            for index in indices[1:]
        ]
        return {"orderId": robot.order_id, "orderUpdateId": robot.update, "nodes": nodes, "edges": edges}

    def _position(self, node: str) -> Data:
        x, y = self._site.places[node]
        return {"x": x, "y": y, "mapId": self._site.map_id}

    def _speak(self, robot: _Robot, now_s: float) -> Iterable[Message]:
        if robot.sent is None or now_s - robot.sent_s < self._rules.repeat_s:
            return
        topic, body = robot.sent
        robot.sent_s = now_s
        self._headers += 1
        header = {
            "headerId": self._headers,
            "timestamp": timestamp(now_s),
            "version": "2.1.0",
            "manufacturer": self._site.manufacturer,
            "serialNumber": robot.serial,
        }
        yield robot.serial, topic, json.dumps(header | body).encode()


def _action(kind: str, action_id: str, parameters: Data) -> Data:
    entries = [{"key": key, "value": value} for key, value in parameters.items()]
    return {"actionType": kind, "actionId": action_id, "blockingType": "HARD", "actionParameters": entries}
