"""The counters of a node, and when its timers wait, without middleware in fake time."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from robot_stack.contract import topics
from robot_stack.core.deliveries import NUMBERS
from robot_stack.ros import deliveries
from robot_stack.ros.deliveries import NodeDeliveries

ROW = NUMBERS[topics.JOINT_STATES]


class Now:
    """Replaces the clocks of the module."""

    def __init__(self) -> None:
        self.s = 100.0

    def monotonic(self) -> float:
        return self.s

    def time_ns(self) -> int:
        return round(1e9 * self.s)


class Rig:
    """A publishing node, a subscribing node, and the middleware between them."""

    def __init__(self, now: Now) -> None:
        self.now, self.idle, self.on_the_way = now, False, []
        self.sender, self.receiver = (NodeDeliveries(name, True, lambda: True) for name in ("sender", "receiver"))
        self.publisher: Any = self.sender.counted(topics.JOINT_STATES, SimpleNamespace(publish=self._send))
        self.received: list[str] = []
        self.callback = self.receiver.noted(topics.JOINT_STATES, lambda message, _: self.received.append(message), True)

    def _send(self, message: str) -> None:
        self.now.s += 1e-5
        self.on_the_way.append((message, {"source_timestamp": self.now.time_ns()}))
        self.now.s += 1e-5

    def deliver(self) -> None:
        while self.on_the_way:
            self.callback(*self.on_the_way.pop(0))

    def exchange(self, message: str = "first") -> None:
        self.publisher.publish(message)
        self.deliver()
        self.now.s += 2.0  # late enough for the receiver to look for publishers again


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Rig:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path))
    now = Now()
    monkeypatch.setattr(deliveries, "time", now)
    made = Rig(now)
    monkeypatch.setattr(deliveries, "others_asleep", lambda: made.idle)
    return made


def test_a_timer_waits_for_what_was_published_before_it(rig: Rig) -> None:
    rig.exchange()
    assert not rig.receiver.owed()
    rig.publisher.publish("second")
    for _ in range(1000):
        rig.now.s += 10.0  # no timeout
        assert rig.receiver.owed()
    rig.deliver()
    assert not rig.receiver.owed()
    assert rig.received == ["first", "second"]


def test_a_timer_does_not_wait_for_what_is_published_meanwhile(rig: Rig) -> None:
    rig.exchange()
    rig.publisher.publish("second")
    assert rig.receiver.owed()
    rig.deliver()
    rig.publisher.publish("third")
    assert not rig.receiver.owed()
    assert rig.receiver.owed()  # the next timer waits for it


def test_nothing_is_owed_before_the_first_message(rig: Rig) -> None:
    rig.publisher.publish("before it was matched")
    rig.on_the_way.clear()
    rig.now.s += 2.0
    assert not rig.receiver.owed()


def test_a_lost_message_is_given_up_once_nothing_is_on_its_way(rig: Rig) -> None:
    rig.exchange()
    rig.publisher.publish("lost")
    rig.on_the_way.clear()
    for _ in range(100):  # idle only now and then, as on a busy machine
        for rig.idle in (True, True, True, False):
            rig.now.s += 0.01
            assert rig.receiver.owed()
    rig.idle = True
    looks = 0
    while rig.receiver.owed():
        rig.now.s += 0.01
        looks += 1
        assert looks < 10
    assert looks >= 4
    rig.publisher.publish("next")
    assert rig.receiver.owed()


def test_a_message_that_wakes_is_looked_after_between_timers(rig: Rig) -> None:
    rig.exchange()
    assert not rig.receiver.owed()  # discovers the publisher
    assert rig.receiver.wait_s() == math.inf
    rig.publisher.publish("second")
    assert rig.receiver.wait_s() < 0.01
    assert list(rig.receiver.due()) == []
    rig.deliver()
    list(rig.receiver.due())
    assert rig.receiver.wait_s() == math.inf


def test_who_ended_a_subscription_or_itself_is_owed_nothing(rig: Rig) -> None:
    rig.exchange()
    rig.publisher.publish("second")
    assert rig.receiver.owed()
    rig.receiver.forget(topics.JOINT_STATES)
    rig.receiver._tick._debts.clear()
    assert not rig.receiver.owed()
    rig.sender.close()
    rig.receiver.close()


def test_without_a_shared_world_clock_nothing_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path))
    node = NodeDeliveries("node", False, lambda: True)

    def callback(message: Any, info: Any) -> None: ...

    def publish(message: Any) -> None: ...

    publisher = SimpleNamespace(publish=publish)
    assert node.noted(topics.JOINT_STATES, callback, True) is callback
    assert node.counted(topics.JOINT_STATES, publisher).publish is publish
    node.forget(topics.JOINT_STATES)
    node.close()
    assert not node.owed()
    assert not (tmp_path / "deliveries").exists()
