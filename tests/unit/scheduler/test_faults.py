"""Message faults, and independent random streams."""

from __future__ import annotations

import math

import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Int32

from sim.scheduler.params import Spread
from sim.scheduler.rules import Corrupt, Delay, Duplicate, Lose, MessageRule, Reorder, with_field
from sim.scheduler.streams import Streams
from tests.unit.scheduler.rig import rig, row

_LATE = Spread(median_ms=15.0, p99_ms=15.0)


def taken_with(*rules: MessageRule, count: int = 4) -> tuple[list[tuple[float, int]], list[tuple[float, int]]]:
    """Returns the messages that two listeners receive under fault rules, sent at 300, 310 ... ms."""
    topic = row()
    with rig() as stage:
        for rule in rules:
            stage.scheduler.network.add_rule(rule)
        stage.talker(topic)
        both = stage.listener(topic), stage.listener(topic, "other")
        for number in range(count):
            stage.say(300.0 + 10.0 * number, number, topic)
        stage.scheduler.run(60.0)
    return both


def test_messages_are_lost_for_one_subscriber_and_a_while() -> None:
    taken, other = taken_with(Lose(name="l", topic="/count", subscriber="listener", from_s=0.31, until_s=0.33))
    assert [value for _, value in taken] == [0, 3]
    assert [value for _, value in other] == [0, 1, 2, 3]


def test_a_late_message_holds_up_those_behind_it() -> None:
    taken, _ = taken_with(Delay(name="d", until_s=0.305, extra=_LATE), count=3)
    assert taken == [(316.0, 0), (319.0, 1), (321.0, 2)] or taken == [(316.0, 0), (316.0, 1), (321.0, 2)]


def test_a_message_is_overtaken() -> None:
    taken, _ = taken_with(Reorder(name="r", until_s=0.305, extra=_LATE), count=3)
    assert [value for _, value in taken] == [1, 0, 2]


def test_a_message_comes_twice() -> None:
    taken, _ = taken_with(Duplicate(name="2", until_s=0.305, extra=_LATE), count=3)
    assert [value for _, value in taken] == [0, 1, 0, 2]


def test_a_field_is_corrupted_for_one_subscriber() -> None:
    taken, other = taken_with(Corrupt(name="c", subscriber="other", path="data", value=99), count=2)
    assert [value for _, value in taken] == [0, 1]
    assert [value for _, value in other] == [99, 99]


def test_a_field_inside_a_message() -> None:
    data = bytes(serialize_message(PoseStamped()))
    message = deserialize_message(
        with_field(data, "geometry_msgs/msg/PoseStamped", "pose.position.x", math.nan), PoseStamped
    )
    assert math.isnan(message.pose.position.x)
    with pytest.raises(ValueError, match=r"no field 'pose\.speed'"):
        with_field(data, "geometry_msgs/msg/PoseStamped", "pose.speed", 1.0)
    with pytest.raises(ValueError, match="no field"):
        with_field(bytes(serialize_message(Int32())), "std_msgs/msg/Int32", "data.0", 1)


def test_a_rule_applies_with_its_probability_and_shifts_no_other() -> None:
    some = Lose(name="some", subscriber="listener", probability=0.3)
    taken, other = taken_with(some, count=1000)
    assert 620 < len(taken) < 780
    assert len(other) == 1000
    never = Delay(name="never", probability=0.0, extra=_LATE)
    assert taken_with(never, some, count=1000) == (taken, other)


def test_rules_come_and_go() -> None:
    with rig() as stage:
        network = stage.scheduler.network
        network.add_rule(Lose(name="a"))
        with pytest.raises(ValueError, match="already"):
            network.add_rule(Lose(name="a"))
        network.remove_rule("a")
        assert network.rules == []
    with pytest.raises(ValueError, match="probability"):
        Lose(name="b", probability=1.5)


def test_streams_of_a_seed_are_independent_of_each_other() -> None:
    spread = Spread(median_ms=1.0, p99_ms=5.0)
    alone = Streams(3).delays("a", spread)
    expected = [alone.draw() for _ in range(500)]
    both = Streams(3)
    first = both.delays("b", spread)
    second = both.delays("a", spread)
    drawn = []
    for _ in range(500):
        first.draw()
        drawn.append(second.draw())
    assert drawn == expected
    assert drawn != [first.draw() for _ in range(500)]
    assert Streams(4).delays("a", spread).draw() != expected[0]


def test_delays_have_their_median_and_percentile() -> None:
    delays = Streams(1).delays("a", Spread(median_ms=2.0, p99_ms=10.0))
    drawn = sorted(1e-6 * delays.draw() for _ in range(20_000))
    assert drawn[10_000] == pytest.approx(2.0, rel=0.05)
    assert drawn[19_800] == pytest.approx(10.0, rel=0.1)
