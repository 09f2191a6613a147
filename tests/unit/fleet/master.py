"""A master's messages, and a robot whose mission manager follows the agent's requests as specified for the service."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from typing import Any

from robot_stack.contract.states import HeldBy, MissionState
from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.robot import load_robot
from robot_stack.fleet.errors import ErrorType, name_of
from robot_stack.fleet.factsheet import factsheet
from robot_stack.fleet.kernel import FleetKernel, Outputs
from robot_stack.fleet.link import Topic
from robot_stack.fleet.params import FleetParams
from robot_stack.fleet.progress import Operation, Request
from robot_stack.fleet.record import Record
from robot_stack.fleet.robot import FLEET, Battery, MissionView, Queue, RobotView, Safety
from robot_stack.fleet.vehicle import Stop, Vehicle
from robot_stack.fleet.version import Version

Data = dict[str, Any]

PARAMS = load(FleetParams, "fleet_agent")
ROBOT = load_robot()
VEHICLE = Vehicle.of(PARAMS, ROBOT, {name: dock.kind for name, dock in load_docks().docks.items()}, "1")
HEADER: Data = {
    "headerId": 1,
    "timestamp": "2026-05-01T09:30:00.00Z",
    "version": "2.1.0",
    "manufacturer": PARAMS.identity.manufacturer,
    "serialNumber": PARAMS.identity.serial_number,
}


def action(kind: str, action_id: str = "", **parameters: Any) -> Data:
    entries = [{"key": key, "value": value} for key, value in parameters.items()]
    return {"actionType": kind, "actionId": action_id or kind, "blockingType": "HARD", "actionParameters": entries}


def node(name: str, number: int, x: float, *actions: Data, released: bool = True, **position: Any) -> Data:
    """number: sequenceId. At (x, 0)."""
    return {
        "nodeId": name,
        "sequenceId": number,
        "released": released,
        "nodePosition": {"x": x, "y": 0.0, "mapId": "yard"} | position,
        "actions": list(actions),
    }


def order(nodes: list[Data], order_id: str = "order_1", update: int = 0, **changed: Any) -> Data:
    edges = [
        {
            "edgeId": f"{start['nodeId']}-{end['nodeId']}",
            "sequenceId": start["sequenceId"] + 1,
            "released": end["released"],
            "startNodeId": start["nodeId"],
            "endNodeId": end["nodeId"],
            "actions": [],
        }
        for start, end in pairwise(nodes)
    ]
    return HEADER | {"orderId": order_id, "orderUpdateId": update, "nodes": nodes, "edges": edges} | changed


def route(*names: str, first: int = 0, horizon: int = 0, x: float = 0.0) -> list[Data]:
    """Nodes 2 m apart; the last ``horizon`` ones are not released."""
    base = len(names) - horizon
    return [node(name, first + 2 * i, x + 2.0 * i, released=i < base) for i, name in enumerate(names)]


EDGES_V3 = {
    "maxSpeed": "maximumSpeed",
    "maxRotationSpeed": "maximumRotationSpeed",
    "maxHeight": "maximumMobileRobotHeight",
    "minHeight": "minimumLoadHandlingDeviceHeight",
    "startNodeId": "",
    "endNodeId": "",
}


def in_version(topic: Topic, data: Data, version: Version) -> Data:
    """A message of 2.1.0 with the same meaning in ``version``."""
    if version is Version.V2:
        return data
    data = data | ({"version": version.value} if data.get("version") == HEADER["version"] else {})
    if topic is Topic.INSTANT_ACTIONS:
        return data | {"actions": [entry | {"blockingType": "NONE"} for entry in data["actions"]]}
    edges = [
        {EDGES_V3.get(key, key): value for key, value in edge.items() if EDGES_V3.get(key, key)}
        for edge in data["edges"]
    ]
    return data | {"nodes": [_node_v3(entry) for entry in data["nodes"]], "edges": edges}


def _node_v3(entry: Data) -> Data:
    """Without deviations, 2.1.0 means the robot's own tolerance."""
    if "nodePosition" not in entry:
        return entry
    position = entry["nodePosition"]
    radius = position.get("allowedDeviationXY", 0.0) or PARAMS.pass_m
    turn = position.get("allowedDeviationTheta", 0.0) or PARAMS.pass_rad
    deviations = {"allowedDeviationXY": {"a": radius, "b": radius, "theta": 0.0}, "allowedDeviationTheta": turn}
    return entry | {"nodePosition": position | deviations}


class Manager:
    """The service /mission/queue/edit and the reports of a robot that serves one waypoint with each ``serve``."""

    def __init__(self) -> None:
        self.orders: dict[str, list[Stop]] = {}
        self.first: dict[str, list[Stop]] = {}  # as each was added
        self.open: dict[str, bool] = {}
        self.current = ""
        self.done = 0
        self.ended: dict[str, int] = {}
        self.state: str = MissionState.IDLE
        self.paused_by = ""
        self.held_by, self.reason = HeldBy.NOTHING, ""
        self.added: list[str] = []
        self.asked: list[Request] = []
        self.scheduled: set[str] = set()  # with an earliest time

    def edit(self, request: Request) -> tuple[bool, str]:
        self.asked.append(request)
        name = request.order_id
        if request.operation is Operation.ADD:
            if name not in self.orders:
                self.orders[name], self.open[name] = list(request.stops), request.open
                self.first[name] = list(request.stops)
                self.added.append(name)
            return self.first[name] == list(request.stops), "added, or known with another route"
        if name not in self.orders:
            return False, "there is no such order"
        if request.operation is Operation.EXTEND:
            return self._extend(request)
        if name in self.ended:
            return self.ended[name] == 3, "it has ended"
        if request.operation is Operation.CANCEL:
            self._end(name, 3, MissionState.ABORTED)
            return True, "cancelled"
        if name != self.current:
            return False, "it waits"
        paused = request.operation is Operation.PAUSE
        self.state, self.paused_by = (MissionState.PAUSED, FLEET) if paused else (MissionState.RUNNING, "")
        return True, "done"

    def _extend(self, request: Request) -> tuple[bool, str]:
        have = self.orders[request.order_id]
        if request.first > len(have):
            return False, "a gap"
        changed = have[: request.first] + list(request.stops) + have[request.first + len(request.stops) :]
        if (changed, request.open) == (have, self.open[request.order_id]):
            return True, "nothing new"
        if not self.open[request.order_id] or request.order_id in self.ended:
            return False, "the route is complete"
        self.orders[request.order_id], self.open[request.order_id] = changed, request.open
        return True, "extended"

    def start(self) -> None:
        """Takes the next order."""
        if not self.current and self.held_by is HeldBy.NOTHING:
            waiting = [name for name in self.added if name not in self.ended]
            if waiting:
                self.current, self.done, self.state = waiting[0], 0, MissionState.RUNNING

    def serve(self) -> Stop | None:
        """Completes one waypoint, and the order with the last one of a complete route."""
        self.start()
        if not self.current or self.state == MissionState.PAUSED:
            return None
        stops = self.orders[self.current]
        served = None
        if self.done < len(stops):
            served = stops[self.done]
            self.done += 1
        if self.done == len(stops):
            self.state = MissionState.WAITING
            if not self.open[self.current]:
                self._end(self.current, 2, MissionState.COMPLETED)
        return served

    def fail(self, state: int = 4) -> None:
        self._end(self.current, state, MissionState.FAILED)

    def _end(self, name: str, number: int, state: str) -> None:
        self.ended[name] = number
        self._last = name
        if name == self.current:
            self.current, self.state, self.paused_by = "", state, ""

    def view(self, robot: RobotView) -> RobotView:
        waiting = frozenset(name for name in self.added if name not in self.ended and name != self.current)
        ended = dict(self.ended)
        queue = Queue(self.held_by, self.reason, self.current, waiting, ended, self.paused_by, waiting - self.scheduled)
        shown = self.current or getattr(self, "_last", "")
        return replace(robot, queue=queue, mission=MissionView(self.state, shown, self.done, ""))


class Bench:
    """The kernel with a master and a mission manager. ``tick`` lasts 1 s. The record is kept as the disk keeps it."""

    def __init__(self, version: Version = Version.V2) -> None:
        self.version = version
        self.vehicle = replace(VEHICLE, version=version)
        self.manager = Manager()
        self.robot = RobotView(
            pose=Pose2(0.0, 0.0, 0.0),
            quality=0.9,
            twist=ZERO_TWIST,
            battery=Battery(80.0, 50.0, False),
            safety=Safety(False, ()),
        )
        self.now_s = 0.0
        self.disk = Record().model_dump_json()
        self.sent: list[tuple[Topic, Data]] = []
        self.poses: list[Pose2] = []
        self.silent = False  # the mission manager does not answer
        self.restart()

    def restart(self) -> None:
        record = Record.model_validate_json(self.disk)
        self.kernel = FleetKernel(PARAMS, self.vehicle, factsheet(ROBOT, self.vehicle, PARAMS), record)

    def send(self, topic: Topic, data: Data | bytes) -> Data:
        """The state after it."""
        self.kernel.receive(topic, data if isinstance(data, bytes) else json.dumps(data).encode())
        self.tick()
        return self.tick()

    def receive(self, data: Data) -> None:
        """As ``order``, without a tick."""
        self.kernel.receive(Topic.ORDER, json.dumps(in_version(Topic.ORDER, data, self.version)).encode())

    def order(self, data: Data) -> Data:
        """A message of 2.1.0, sent in the bench's version."""
        return self.send(Topic.ORDER, in_version(Topic.ORDER, data, self.version))

    def instant(self, *actions: Data) -> Data:
        """As ``order``."""
        data = HEADER | {"actions": list(actions)}
        return self.send(Topic.INSTANT_ACTIONS, in_version(Topic.INSTANT_ACTIONS, data, self.version))

    def named(self, *kinds: ErrorType) -> list[str]:
        return [name_of(kind, self.version) for kind in kinds]

    def compute(self) -> None:
        self.now_s += 1.0
        self.kernel.tick(self.manager.view(self.robot), self.now_s, 1.7e9 + self.now_s)

    def save(self) -> None:
        self.disk = self.kernel.record.model_dump_json()

    def perform(self, *, answer: bool = True) -> Outputs:
        outputs = self.kernel.take()
        if outputs.request is not None and not self.silent:
            success, text = self.manager.edit(outputs.request)
            if answer:
                self.kernel.answered(outputs.request, success, text)
        self.manager.start()
        self.poses += [outputs.pose] if outputs.pose is not None else []
        self.sent += [(topic, json.loads(payload)) for topic, payload in outputs.messages.items()]
        return outputs

    def tick(self) -> Data:
        self.compute()
        self.save()
        self.perform()
        return self.state

    def serve(self, times: int = 1) -> Data:
        for _ in range(times):
            self.manager.serve()
            self.tick()
        return self.tick()

    @property
    def states(self) -> list[Data]:
        return [data for topic, data in self.sent if topic is Topic.STATE]

    @property
    def state(self) -> Data:
        return self.states[-1] if self.states else {}


def error_types(state: Data) -> list[str]:
    return [error["errorType"] for error in state["errors"]]


def statuses(state: Data) -> dict[str, str]:
    entries = (*state["actionStates"], *state.get("instantActionStates", ()))
    return {entry["actionId"]: entry["actionStatus"] for entry in entries}


def node_ids(state: Data) -> list[str]:
    return [entry["nodeId"] for entry in state["nodeStates"]]
