"""Comparison of recorded and replayed messages."""

from __future__ import annotations

import math

import pytest
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Float32, String

from sim.replay.compare import Timed, compare
from sim.replay.params import Tolerance

EXACT = Tolerance(absolute=0.0, relative=0.0, time_s=0.06, elements=0.0, unmatched=0.0, count=0)


def numbers(*values: float, shift_s: float = 0.0) -> list[Timed]:
    """One message each 0.1 s."""
    return [Timed(0.1 * index + shift_s, Float32(data=value)) for index, value in enumerate(values)]


def test_equal_messages_match() -> None:
    found = compare(numbers(1.0, 2.0, math.nan), numbers(1.0, 2.0, math.nan), EXACT)
    assert found.equal
    assert (found.recorded, found.replayed, found.matched) == (3, 3, 6)


def test_the_first_difference_is_named_with_its_time_and_field() -> None:
    found = compare(numbers(1.0, 2.0, 3.0), numbers(1.0, 2.5, 3.5), EXACT)
    assert not found.equal
    assert found.first is not None
    assert (found.first.at_s, found.first.field) == (pytest.approx(0.1), "data")
    assert (found.first.recorded, found.first.replayed) == ("2", "2.5")


def test_a_message_may_come_earlier_or_later_within_the_time() -> None:
    assert compare(numbers(1.0, 2.0), numbers(1.0, 2.0, shift_s=0.05), EXACT).equal
    late = compare(numbers(1.0, 2.0), numbers(1.0, 2.0, shift_s=0.09), EXACT)
    assert not late.equal


@pytest.mark.parametrize("swapped", [False, True])
def test_a_missing_and_a_surplus_message_are_differences(swapped: bool) -> None:
    sides = numbers(1.0, 2.0, 3.0), numbers(1.0, 2.0)
    found = compare(*(reversed(sides) if swapped else sides), EXACT)
    assert not found.equal
    assert found.first is not None
    assert "no message" in (found.first.recorded if swapped else found.first.replayed)


def test_numbers_may_differ_by_the_tolerance() -> None:
    absolute, relative = EXACT.model_copy(update={"absolute": 0.1}), EXACT.model_copy(update={"relative": 0.01})
    assert compare(numbers(1.0), numbers(1.09), absolute).equal
    assert not compare(numbers(1.0), numbers(1.11), absolute).equal
    assert compare(numbers(100.0), numbers(100.9), relative).equal
    assert not compare(numbers(100.0), numbers(101.1), relative).equal


def test_texts_are_exact_whatever_the_tolerance() -> None:
    loose = EXACT.model_copy(update={"absolute": 10.0})
    found = compare([Timed(0.0, String(data="NORMAL"))], [Timed(0.0, String(data="DEGRADED"))], loose)
    assert not found.equal


def test_a_share_of_the_messages_may_have_no_counterpart() -> None:
    recorded, replayed = numbers(*[1.0] * 20), numbers(*[1.0] * 19, 2.0)
    assert compare(recorded, replayed, EXACT.model_copy(update={"unmatched": 0.05})).equal
    assert not compare(recorded, replayed, EXACT.model_copy(update={"unmatched": 0.02})).equal


def test_a_share_of_the_elements_of_an_array_may_differ() -> None:
    recorded = [Timed(0.0, OccupancyGrid(data=[0] * 100))]
    replayed = [Timed(0.0, OccupancyGrid(data=[0] * 98 + [100, 100]))]
    found = compare(recorded, replayed, EXACT)
    assert found.first is not None
    assert found.first.field == "data[98]"
    assert compare(recorded, replayed, EXACT.model_copy(update={"elements": 0.02})).equal
    assert not compare(recorded, replayed, EXACT.model_copy(update={"elements": 0.01})).equal


def test_stamps_may_differ_by_the_time() -> None:
    recorded, near, far = TwistStamped(), TwistStamped(), TwistStamped()
    near.header.stamp.nanosec, far.header.stamp.nanosec = 50_000_000, 70_000_000
    assert compare([Timed(0.0, recorded)], [Timed(0.0, near)], EXACT).equal
    assert not compare([Timed(0.0, recorded)], [Timed(0.0, far)], EXACT).equal


def test_repeated_messages_are_counted() -> None:
    recorded, replayed = numbers(1.0, 2.0), [*numbers(1.0, 2.0), Timed(0.11, Float32(data=2.0))]
    found = compare(recorded, replayed, EXACT)
    assert found.matched == found.messages
    assert not found.equal
    assert compare(recorded, replayed, EXACT.model_copy(update={"count": 1})).equal


def test_only_messages_of_the_time_compared_need_a_counterpart() -> None:
    found = compare(numbers(0.0, 1.0, 2.0), numbers(9.0, 1.0, 9.0), EXACT, 0.05, 0.15)
    assert found.equal
    assert found.messages == 2
