"""A master, mosquitto, the agent and its journal on the disk as processes of which broker and agent are killed.

The agent's process has its kernel, its journal and its connection, as the node; the mission manager's kernel with a
kinematic body outlives it. In real time.
"""

from __future__ import annotations

import math
import multiprocessing
import random
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Final

from paho.mqtt.client import Client

from robot_stack.contract.states import MissionState
from robot_stack.core.geometry import Pose2
from robot_stack.fleet.factsheet import factsheet
from robot_stack.fleet.headers import ConnectionMessages
from robot_stack.fleet.kernel import FleetKernel
from robot_stack.fleet.link import Connected, Received, Topic
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.fleet.nodes.journal_file import JournalFile
from robot_stack.fleet.nodes.mqtt_client import connect, mqtt_client
from robot_stack.fleet.nodes.mqtt_link import MqttLink
from robot_stack.fleet.progress import Operation, Request
from robot_stack.fleet.version import Version
from robot_stack.mission import events as ev
from tests.benchmarks.support.fleet_vehicle import FleetVehicle
from tests.support.fleet.broker import RunningBroker, running_broker
from tests.support.fleet.chaos import Master
from tests.unit.fleet.master import PARAMS, ROBOT, VEHICLE, error_types

_TICK_S: Final = 0.1
_PAUSE_S: Final = (1.5, 4.0)  # between two kills
_LIMIT_S: Final = 180.0  # for the end of the last order
_PREFIX: Final = PARAMS.identity.prefix(Version.V2)


@dataclass(frozen=True)
class RealCounts:
    """problems: orders that were lost or driven twice. slowest_recovery_s: from a kill to the next state."""

    broker_kills: int
    agent_kills: int
    orders: int
    problems: tuple[str, ...]
    slowest_recovery_s: float


def _agent(robot: Connection, broker: BrokerParams, journal: Path) -> None:
    """The agent's process, as ``nodes/fleet_agent.py`` without ROS."""
    file = JournalFile(str(journal))
    kernel = FleetKernel(PARAMS, VEHICLE, factsheet(ROBOT, VEHICLE, PARAMS), file.load()[0])
    file.save(kernel.record)
    messages = ConnectionMessages(kernel.headers, time.time)
    serial = PARAMS.identity.serial_number
    link = MqttLink(broker, serial, _PREFIX, messages.online, messages.offline, messages.broken)
    while True:
        for event in link.receive():
            if isinstance(event, Received):
                kernel.receive(event.topic, event.payload)
            elif isinstance(event, Connected):
                kernel.connected()
        robot.send(None)
        kernel.tick(robot.recv(), time.monotonic(), time.time())
        if not file.save(kernel.record):
            outputs = kernel.take()
            if outputs.request is not None:
                robot.send(outputs.request)
                kernel.answered(outputs.request, *robot.recv())
            for topic, payload in outputs.messages.items():
                link.send(topic, payload)
        time.sleep(_TICK_S)


class _Robot(FleetVehicle):
    """added: ids of the missions that the manager was given. completed: names of the waypoints of each one."""

    def __init__(self) -> None:
        super().__init__(PARAMS.identity.serial_number, Pose2(0.0, 0.0, 0.0))
        self.added: list[str] = []
        self.completed: dict[str, list[str]] = {}

    def publish_status(self, status: ev.Status) -> None:
        super().publish_status(status)
        if status.mission is not None and status.state == MissionState.COMPLETED:
            self.completed[status.mission.id] = [waypoint.name for waypoint in status.mission.waypoints]

    def answer(self, request: Request | None) -> Any:
        """To the agent: its view, or the answer to its request."""
        if request is None:
            return self.view()
        answer = self.edit(request, time.time())
        if request.operation is Operation.ADD and answer[0] and request.order_id not in self.added:
            self.added.append(request.order_id)
        return answer


class RealChaos:
    """kills: number of each. folder: for the broker and the journal."""

    def __init__(self, folder: Path, broker: RunningBroker, broker_kills: int, agent_kills: int, seed: int) -> None:
        self._folder, self._broker = folder, broker
        self._random = random.Random(seed)
        self._kinds = ["broker"] * broker_kills + ["agent"] * agent_kills
        self._random.shuffle(self._kinds)
        self._params = broker.params()
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([__name__])
        self._master = Master(self._random, len(self._kinds) + 2)
        self._robot = _Robot()
        self._process, self._pipe = self._start()
        self._client = self._connected()
        self._killed_s: float | None = None
        self._slowest_s = 0.0

    def run(self) -> RealCounts:
        kinds = list(self._kinds)
        next_s, limit_s = time.monotonic() + 5.0, math.inf
        last: int | None = None
        while (now_s := time.monotonic()) < limit_s and (last is None or self._master.number < last):
            if now_s >= next_s and kinds:
                self._kill(kinds.pop())
                next_s = now_s + self._random.uniform(*_PAUSE_S)
            if not kinds and last is None:
                last, limit_s = self._master.number + 1, now_s + _LIMIT_S
            self._step(now_s)
        self._client.disconnect()
        self._client.loop_stop()
        self._process.kill()
        self._process.join()
        problems = self._problems(last if last is not None else 0)
        counts = (self._kinds.count("broker"), self._kinds.count("agent"))
        return RealCounts(*counts, self._master.number, tuple(problems), self._slowest_s)

    def _step(self, now_s: float) -> None:
        self._robot.drive(now_s, time.time())
        message = self._master.speak(now_s)
        if message is not None:
            self._client.publish(f"{_PREFIX}/{message[0]}", message[1])
        end_s = now_s + _TICK_S
        while (left_s := end_s - time.monotonic()) > 0.0:
            if not self._process.is_alive():
                time.sleep(left_s)
            elif self._pipe.poll(left_s):
                self._pipe.send(self._robot.answer(self._pipe.recv()))

    def _start(self) -> tuple[BaseProcess, Connection]:
        own, other = self._context.Pipe()
        arguments = (other, self._params, self._folder / "journal.json")
        process = self._context.Process(target=_agent, args=arguments, daemon=True)
        process.start()
        other.close()
        return process, own

    def _kill(self, kind: str) -> None:
        self._killed_s = time.monotonic()
        if kind == "broker":
            self._broker.kill()
            self._broker.start()
            self._client.loop_stop()
            self._client = self._connected()
        else:
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._process, self._pipe = self._start()

    def _connected(self) -> Client:
        """The master's client, which does not reconnect by itself."""
        client = mqtt_client(self._params, "manager", persistent=False, on_error=lambda _: None)
        client.on_connect = lambda client, _data, _flags, _code, _properties: client.subscribe(f"{_PREFIX}/state")
        client.on_message = lambda _client, _data, message: self._take(bytes(message.payload))
        connect(client, self._params, persistent=False)
        client.loop_start()
        return client

    def _take(self, payload: bytes) -> None:
        self._master.take(Topic.STATE, payload)
        if self._killed_s is not None:
            self._slowest_s = max(self._slowest_s, time.monotonic() - self._killed_s)
            self._killed_s = None

    def _problems(self, orders: int) -> Iterator[str]:
        """Each order was handed over once, in its order, and driven to its end unless it was cancelled."""
        robot, master = self._robot, self._master
        if master.number < orders:
            yield f"order {master.number} is lost"
        numbers = [int(name.rpartition("_")[2]) for name in robot.added]
        if numbers != sorted(set(numbers)):
            yield f"handed over: {robot.added}"
        for number in range(master.number):
            missions = [name for name in robot.added if name.endswith(f"_{number}")]
            done = [[name.partition(".")[0] for name in robot.completed.get(mission, ())] for mission in missions]
            if number not in master.cancels and done != [["2", "2", "4", "6", "6"]]:
                yield f"order {number} was driven as {done}"
        if any("orderAborted" in error_types(state) for state in master.states):
            yield "an order was aborted"


def real_ride(folder: Path, broker_kills: int, agent_kills: int, seed: int = 0) -> RealCounts:
    with running_broker(folder / "site", local=True) as broker:
        return RealChaos(folder, broker, broker_kills, agent_kills, seed).run()
