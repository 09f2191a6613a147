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


def grid(*last: int) -> list[Timed]:
    return [Timed(0.0, OccupancyGrid(data=[0] * (100 - len(last)) + list(last)))]


def stamped(nanosec: int) -> list[Timed]:
    message = TwistStamped()
    message.header.stamp.nanosec = nanosec
    return [Timed(0.0, message)]


NORMAL, DEGRADED = [Timed(0.0, String(data="NORMAL"))], [Timed(0.0, String(data="DEGRADED"))]


@pytest.mark.parametrize(
    ("recorded", "replayed", "tolerance", "equal"),
    [
        (numbers(1.0, 2.0), numbers(1.0, 2.0, shift_s=0.05), {}, True),
        (numbers(1.0, 2.0), numbers(1.0, 2.0, shift_s=0.09), {}, False),
        (numbers(1.0), numbers(1.09), {"absolute": 0.1}, True),
        (numbers(1.0), numbers(1.11), {"absolute": 0.1}, False),
        (numbers(100.0), numbers(100.9), {"relative": 0.01}, True),
        (numbers(100.0), numbers(101.1), {"relative": 0.01}, False),
        (NORMAL, DEGRADED, {"absolute": 10.0}, False),  # texts are exact
        (numbers(*[1.0] * 20), numbers(*[1.0] * 19, 2.0), {"unmatched": 0.05}, True),
        (numbers(*[1.0] * 20), numbers(*[1.0] * 19, 2.0), {"unmatched": 0.02}, False),
        (grid(), grid(100, 100), {"elements": 0.02}, True),
        (grid(), grid(100, 100), {"elements": 0.01}, False),
        (stamped(0), stamped(50_000_000), {}, True),
        (stamped(0), stamped(70_000_000), {}, False),
    ],
)
def test_equal_within_the_tolerance(
    recorded: list[Timed], replayed: list[Timed], tolerance: dict[str, float], equal: bool
) -> None:
    assert compare(recorded, replayed, EXACT.model_copy(update=tolerance)).equal is equal


def test_equal_messages_match_and_the_first_difference_is_named() -> None:
    found = compare(numbers(1.0, 2.0, math.nan), numbers(1.0, 2.0, math.nan), EXACT)
    assert found.equal
    assert (found.recorded, found.replayed, found.matched) == (3, 3, 6)
    first = compare(numbers(1.0, 2.0, 3.0), numbers(1.0, 2.5, 3.5), EXACT).first
    assert first is not None
    assert (first.at_s, first.field, first.recorded, first.replayed) == (pytest.approx(0.1), "data", "2", "2.5")
    first = compare(grid(), grid(100, 100), EXACT).first
    assert first is not None
    assert first.field == "data[98]"
    first = compare(numbers(1.0, 2.0, 3.0), numbers(1.0, 2.0), EXACT).first
    assert first is not None
    assert "no message" in first.replayed
    first = compare(numbers(1.0, 2.0), numbers(1.0, 2.0, 3.0), EXACT).first
    assert first is not None
    assert "no message" in first.recorded


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
