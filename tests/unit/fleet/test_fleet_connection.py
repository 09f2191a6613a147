"""The kernel at a real broker that dies or is cut off: the base is driven on, the horizon is not, and it catches up.

The robot's time is that of the kernel's ticks; only the broker's answers are waited for.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from robot_stack.fleet.headers import ConnectionMessages
from robot_stack.fleet.kernel import Outputs
from robot_stack.fleet.link import Connected, Disconnected, Received
from robot_stack.fleet.nodes.mqtt_link import MqttLink
from robot_stack.fleet.version import Version
from tests.support.fleet.broker import Peer, RunningBroker, running_broker
from tests.support.fleet.network import Network
from tests.support.waiting import wait_for
from tests.unit.fleet.master import PARAMS, Bench, Data, node, node_ids, order, route, statuses
from tests.unit.fleet.test_fleet_kills import first_part, second_part

PREFIX = PARAMS.identity.prefix(Version.V2)
FAST: dict[str, Any] = {"first_back_off_s": 0.05, "longest_back_off_s": 0.2}


class Agent(Bench):
    """With a link, as the node has it."""

    def __init__(self, broker: RunningBroker, port: int) -> None:
        super().__init__()
        self.connections: list[bool] = []  # whether the session was there
        self.losses = 0
        messages = ConnectionMessages(self.kernel.headers, lambda: 1.7e9)
        self.link = MqttLink(
            broker.params(url=f"mqtt://localhost:{port}", **FAST),
            PARAMS.identity.serial_number,
            PREFIX,
            messages.online,
            messages.offline,
            messages.broken,
        )

    def perform(self, *, answer: bool = True) -> Outputs:
        outputs = super().perform(answer=answer)
        for topic, payload in outputs.messages.items():
            self.link.send(topic, payload)
        return outputs

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Takes what arrives, and ticks, until the condition holds."""

        def tick() -> object:
            for event in self.link.receive():
                match event:
                    case Connected(present):
                        self.connections.append(present)
                        self.kernel.connected()
                    case Disconnected():
                        self.losses += 1
                    case Received(topic, payload):
                        self.kernel.receive(topic, payload)
            self.tick()
            return condition()

        wait_for(tick, what)


class Scene:
    def __init__(self, broker: RunningBroker, stack: ExitStack) -> None:
        self.broker, self._stack = broker, stack
        self.network = Network(broker.port)
        stack.callback(self.network.close)
        self.agent = Agent(broker, self.network.port)
        stack.callback(self.agent.link.close)
        self.master = self.new_master()
        self.agent.until(lambda: self.agent.connections, "the connection")

    def new_master(self) -> Peer:
        master = Peer(self.broker.params(), "manager").connected().subscribe(f"{PREFIX}/#")
        self._stack.callback(master.close)
        return master

    def order(self, data: Data) -> None:
        self.master.publish(f"{PREFIX}/order", json.dumps(data))

    @property
    def seen(self) -> Data:
        """The master's newest state."""
        payloads = self.master.payloads(f"{PREFIX}/state")
        return json.loads(payloads[-1]) if payloads else {}

    def until_seen(self, update: int, last_node: str) -> None:
        def shown() -> bool:
            seen = self.seen
            return (seen.get("orderUpdateId"), seen.get("lastNodeId")) == (update, last_node) and bool(seen["orderId"])

        self.agent.until(shown, f"update {update} at {last_node}, last {self.seen}")

    def drive(self) -> None:
        for _ in range(10):
            self.agent.manager.serve()
            self.agent.tick()


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    with running_broker(tmp_path / "site", local=True) as broker, ExitStack() as stack:
        yield Scene(broker, stack)


def test_cut_off_it_drives_the_base_and_catches_up(scene: Scene) -> None:
    scene.order(first_part())
    scene.until_seen(0, "a")
    scene.network.cut()
    scene.agent.until(lambda: scene.agent.losses, "the loss")
    scene.order(second_part())  # the broker keeps it for the session
    scene.drive()
    assert scene.agent.kernel.record.last_node == "c"
    assert scene.seen["lastNodeId"] == "a"
    assert "d" in node_ids(scene.agent.state)
    scene.network.restore()
    scene.until_seen(1, "c")
    assert scene.agent.connections == [False, True]
    scene.drive()
    scene.until_seen(1, "d")
    assert statuses(scene.seen) == {"w1": "FINISHED", "w2": "FINISHED"}
    assert len(scene.agent.manager.added) == 1


def test_away_during_several_orders_it_reports_the_newest_state(scene: Scene) -> None:
    """The network is cut while orders end, again and again."""
    for number in range(3):
        nodes = [node(f"{number}.0", 0, 0.0, allowedDeviationXY=100.0), *route("x", "y", first=2)]
        scene.order(order(nodes, f"order {number}"))
        scene.until_seen(0, f"{number}.0")
        scene.network.cut()
        scene.drive()
        scene.network.restore()
        scene.agent.until(
            lambda count=number + 2: len(scene.agent.connections) >= count,  # type: ignore[misc]
            "the connection",
        )
        scene.until_seen(0, "y")
    assert len(scene.agent.manager.added) == 3
