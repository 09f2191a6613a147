"""The example dispatcher: all transports end, no two robots are on one node or edge, and its messages may be lost."""

from __future__ import annotations

import json
import random
from itertools import combinations
from typing import Any

import pytest

from robot_stack.fleet.codec import decode
from robot_stack.fleet.link import Topic
from robot_stack.fleet.version import Version
from tests.benchmarks.support import dispatcher
from tests.benchmarks.support.dispatcher import Dispatcher, Message, Transport
from tests.benchmarks.support.fleet_yard import YardFleet, yard

LIMIT_TICKS = 3000


class Ghost:
    """A robot that drives to its next released node at once, or is slow; for many rides in a short time."""

    def __init__(self) -> None:
        self.order: dict[str, Any] = {}
        self.nodes: list[dict[str, Any]] = []
        self.at, self.header, self.done = 0, 0, 0

    def take(self, data: dict[str, Any]) -> None:
        if "orderId" not in data:
            return
        if data["orderId"] != self.order.get("orderId"):
            self.nodes, self.at, self.done = [], 0, 0
        elif data["orderUpdateId"] <= self.order["orderUpdateId"]:
            return
        self.order = data
        self.nodes = self.nodes[: data["nodes"][0]["sequenceId"] // 2] + data["nodes"]

    def drive(self) -> None:
        if self.at + 1 < len(self.nodes) and self.nodes[self.at + 1]["released"]:
            self.at += 1

    @property
    def held(self) -> set[str]:
        """Where the robot may be: from its last node to the end of its base."""
        return {node["nodeId"] for index, node in enumerate(self.nodes) if node["released"] and index >= self.at}

    def state(self) -> bytes:
        self.header += 1
        order = {key: self.order.get(key, default) for key, default in (("orderId", ""), ("orderUpdateId", 0))}
        left = self.nodes[self.at + 1 :]
        last = {"lastNodeId": self.nodes[self.at]["nodeId"]} if self.nodes else {"lastNodeId": ""}
        body = {
            "headerId": self.header,
            "lastNodeSequenceId": 2 * self.at,
            "nodeStates": left,
            "actionStates": [],
            "operatingMode": "AUTOMATIC",
            "agvPosition": {"positionInitialized": True},
            "batteryState": {"batteryCharge": 80.0},
        }
        return json.dumps(order | last | body).encode()


class Ride:
    """loss: share of the messages that are lost, in both directions."""

    def __init__(self, seed: int, size: int, robots: int, transports: int, loss: float = 0.0) -> None:
        self._random, self._loss = random.Random(seed), loss
        site = yard(size, robots)
        self.dispatcher = Dispatcher(site)
        self.ghosts = {serial: Ghost() for serial in site.homes}
        stations = [node for node in site.places if "," in node]
        for number in range(transports):
            self.dispatcher.add(Transport(f"t{number}", *self._random.sample(stations, 2)))
        self.left = transports

    def run(self) -> int:
        """The number of ticks, at most LIMIT_TICKS."""
        for tick in range(LIMIT_TICKS):
            for serial, ghost in self.ghosts.items():
                if self._random.random() < 0.5:
                    ghost.drive()
                if self._arrives():
                    self.dispatcher.receive(serial, Topic.STATE, ghost.state())
            for message in self.dispatcher.tick(float(tick)):
                self._check(message)
                if self._arrives():
                    self.ghosts[message[0]].take(json.loads(message[2]))
            for one, other in combinations(self.ghosts.values(), 2):
                assert not one.held & other.held
            if len(self.dispatcher.done) == self.left and self.dispatcher.at_home:
                return tick
        return LIMIT_TICKS

    def _arrives(self) -> bool:
        return self._random.random() >= self._loss

    def _check(self, message: Message) -> None:
        _, topic, payload = message
        decode(topic, payload, 1 << 20, Version.V2)


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_all_transports_end_on_a_crowded_grid(seed: int) -> None:
    ride = Ride(seed, size=3, robots=3 + seed % 8, transports=15)
    assert ride.run() < LIMIT_TICKS


@pytest.mark.parametrize("seed", range(2))
def test_all_transports_end_although_messages_are_lost(seed: int) -> None:
    assert Ride(seed, size=3, robots=6, transports=8, loss=0.3).run() < LIMIT_TICKS


def test_without_the_safe_state_robots_block_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dispatcher.Traffic, "_safe", lambda self: True)
    assert Ride(0, size=3, robots=10, transports=15).run() == LIMIT_TICKS


def test_the_kernels_of_the_robot_drive_for_the_dispatcher() -> None:
    fleet = YardFleet(yard(3, 4), seed=1)
    fleet.give(6)
    fleet.finish(900.0)
    assert {transport.robot for transport in fleet.dispatcher.done} <= set(fleet.vehicles)
