"""Many robots at one broker: each with the kernels and journals of the real one, its own MQTT connection and last will.

Several processes have some of the robots each. The body is kinematic; the agents' rate is that of the real node.
"""

from __future__ import annotations

import json
import multiprocessing
import resource
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any, Final

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.fleet.codec import timestamp
from robot_stack.fleet.headers import ConnectionMessages
from robot_stack.fleet.link import Connected, Received
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.fleet.nodes.mqtt_client import connect, mqtt_client
from robot_stack.fleet.nodes.mqtt_link import MqttLink
from robot_stack.fleet.version import Version
from tests.benchmarks.support.fleet_vehicle import FleetVehicle
from tests.benchmarks.support.framework import BenchError

_MANUFACTURER: Final = "robot_stack"
# Each robot has up to 6 open files, and the links wait with select, which takes 1024.
LONGEST_PROCESS: Final = 150
_HOP_M: Final = 2.0
_LONGEST_START_S: Final = 180.0
_PARAMS: Final = {
    "state_period_s": 0.95,  # sent in the next tick, thus each second
    "state_min_interval_s": 0.1,  # an answer does not wait: the configured interval may delay it by 0.5 s
    "visualization_rate_hz": 0.0,  # states as frequent have all that it has
}


@dataclass(frozen=True)
class Share:
    """One process's use. cpu_s, reads: of all its robots. duration_s: of the measurement. memory_mb: with the code."""

    cpu_s: float
    memory_mb: float
    reads: int
    robots: int
    duration_s: float


@contextmanager
def robots(params: Mapping[str, BrokerParams], folder: Path, processes: int, idle_every: int) -> Iterator[list[Share]]:
    """Runs a robot for each serial number; yields once all are connected. The list is filled at the end.

    folder: for the journals. idle_every: each robot reads its messages at the node's rate, and without one its kernels
    are called each so many times.
    """
    context = multiprocessing.get_context("spawn")
    ends = context.Event()
    results: Queue[Share | str] = context.Queue()
    shares: list[Share] = []
    serials = list(params)
    parts = [serials[first::processes] for first in range(processes)]
    if max(map(len, parts)) > LONGEST_PROCESS:
        raise ValueError(f"at most {LONGEST_PROCESS} robots in a process")
    running = [
        context.Process(target=_run, args=({one: params[one] for one in part}, folder, idle_every, ends, results))
        for part in parts
    ]
    for process in running:
        process.start()
    try:
        answers = [results.get(timeout=_LONGEST_START_S) for _ in running]
        problem = "".join(answer for answer in answers if isinstance(answer, str))
        if problem:
            raise BenchError(problem)
        yield shares
        ends.set()
        answers = [results.get(timeout=_LONGEST_START_S) for _ in running]
        shares += [answer for answer in answers if isinstance(answer, Share)]
    finally:
        ends.set()
        for process in running:
            process.join()


def _run(
    params: Mapping[str, BrokerParams], folder: Path, idle_every: int, ends: Event, results: Queue[Share | str]
) -> None:
    """Puts an empty text once all are connected, the reason if they fail before, and what was used at the end."""
    try:
        _drive(params, folder, idle_every, ends, results)
    except Exception as error:
        results.put(repr(error))
        raise


def _drive(
    params: Mapping[str, BrokerParams], folder: Path, idle_every: int, ends: Event, results: Queue[Share | str]
) -> None:
    members = [Member(serial, broker, folder / serial) for serial, broker in params.items()]
    period_s = 1.0 / members[0].vehicle.params.tick_rate_hz
    begun_s = before_s = 0.0
    visits, ready, next_s = 0, False, time.monotonic()
    while not ends.is_set():
        for index, member in enumerate(members):
            # Spread over the period, as independent robots are.
            pause_s = next_s + period_s * index / len(members) - time.monotonic()
            if pause_s > 0.0:
                time.sleep(pause_s)
            member.visit(visits % idle_every == 0)
        visits += 1
        next_s = max(next_s + period_s, time.monotonic() - period_s)
        if not ready and all(member.online for member in members):
            ready, visits, begun_s, before_s = True, 0, time.monotonic(), _cpu_s()
            results.put("")
    used_s = _cpu_s() - before_s
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    results.put(Share(used_s, memory_mb, visits * len(members), len(members), time.monotonic() - begun_s))
    for member in members:
        member.link.close()


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


class Member:
    """A robot and its connection. folder: for its journals, which is created. pose: at the start."""

    def __init__(self, serial: str, broker: BrokerParams, folder: Path, pose: Pose2 = IDENTITY) -> None:
        folder.mkdir()
        self.vehicle = FleetVehicle(serial, pose, folder, params=_PARAMS)
        messages = ConnectionMessages(self.vehicle.agent.headers, time.time)
        prefix = self.vehicle.params.identity.prefix(Version.V2)
        self.link = MqttLink(broker, serial, prefix, messages.online, messages.offline, messages.broken)
        self.online = False

    def visit(self, also_idle: bool) -> None:
        """Reads the link, and ticks if there was a message."""
        events = self.link.receive()
        for event in events:
            if isinstance(event, Received):
                self.vehicle.agent.receive(event.topic, event.payload)
            else:
                self.online = isinstance(event, Connected)
                if self.online:
                    self.vehicle.connected()
        if not (self.online and (events or also_idle)):
            return
        for topic, payload in self.vehicle.tick(time.monotonic(), time.time()).items():
            self.link.send(topic, payload)


@dataclass
class Manager:
    """Sends short orders to all robots in turn, and follows them. Times in s.

    accepted_s: from sending an order to the first state that shows it. late: robots that were not ready in their turn.
    """

    params: BrokerParams
    serials: Sequence[str]
    states: int = 0
    sent: int = 0
    finished: int = 0
    late: int = 0
    accepted_s: list[float] = field(default_factory=list)
    refused: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._open: dict[str, tuple[str, float]] = {}  # order and time of sending, by robot
        self._under_way: dict[str, str] = {}
        self._at: dict[str, int] = dict.fromkeys(self.serials, 0)
        self._prefix: dict[str, str] = {}
        self._client = mqtt_client(self.params, "manager", persistent=False, on_error=lambda _: None)
        self._client.on_message = lambda _client, _data, message: self._take(message.topic, bytes(message.payload))
        connect(self._client, self.params, persistent=False)
        self._client.subscribe("+/+/+/+/state")
        self._client.loop_start()

    def run(self, duration_s: float, orders_per_s: float) -> None:
        """orders_per_s: 0 for none."""
        begun_s = time.monotonic()
        number = 0
        while (now_s := time.monotonic()) < begun_s + duration_s:
            if orders_per_s and number < (now_s - begun_s) * orders_per_s:
                self._order(self.serials[number % len(self.serials)], number)
                number += 1
            else:
                time.sleep(0.002)

    def wait(self, limit_s: float) -> None:
        """Until all orders that were sent have ended."""
        end_s = time.monotonic() + limit_s
        while self._under_way and time.monotonic() < end_s:
            time.sleep(0.05)

    @property
    def lost(self) -> int:
        """Orders without an end."""
        return len(self._under_way)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def _order(self, serial: str, number: int) -> None:
        if serial in self._under_way or serial not in self._prefix:
            self.late += 1
            return
        ends = (self._at[serial], 1 - self._at[serial])
        self._at[serial] = ends[1]
        order = f"order-{number}"
        self._under_way[serial], self.sent = order, self.sent + 1
        nodes = [
            {
                "nodeId": f"place {end}",
                "sequenceId": 2 * index,
                "released": True,
                "nodePosition": {"x": _HOP_M * end, "y": 0.0, "mapId": "yard"},
                "actions": [],
            }
            for index, end in enumerate(ends)
        ]
        edge = {
            "edgeId": "way",
            "sequenceId": 1,
            "released": True,
            "startNodeId": f"place {ends[0]}",
            "endNodeId": f"place {ends[1]}",
            "actions": [],
        }
        body: dict[str, Any] = {
            "headerId": number,
            "timestamp": timestamp(time.time()),
            "version": "2.1.0",
            "manufacturer": _MANUFACTURER,
            "serialNumber": serial,
            "orderId": order,
            "orderUpdateId": 0,
            "nodes": nodes,
            "edges": [edge],
        }
        payload = json.dumps(body).encode()
        self._open[serial] = order, time.monotonic()
        self._client.publish(f"{self._prefix[serial]}/order", payload)

    def _take(self, topic: str, payload: bytes) -> None:
        now_s = time.monotonic()
        self.states += 1
        prefix, _, _ = topic.rpartition("/")
        serial = prefix.rpartition("/")[2]
        self._prefix[serial] = prefix
        order = self._under_way.get(serial)
        if order is None:
            return
        state = json.loads(payload)
        self.refused |= {error["errorDescription"] for error in state["errors"]}
        if state["orderId"] != order:
            return
        if serial in self._open:
            self.accepted_s.append(now_s - self._open.pop(serial)[1])
        if not state["nodeStates"]:
            self.finished += 1
            del self._under_way[serial]
