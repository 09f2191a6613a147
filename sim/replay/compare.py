"""Compares the messages of one topic, recorded and replayed, field by field."""

from __future__ import annotations

import array
import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.replay.params import Tolerance

_ABSENT = "no message"
_LONGEST_TEXT = 60
_NUMERIC = (array.array, np.ndarray, bytes)


class Timed(NamedTuple):
    """A message and when it left its node, s on the ROS clock."""

    at_s: float
    message: Any


@dataclass(frozen=True, slots=True)
class Difference:
    """The first difference of a topic. field: with dots and indices; empty for a message without a counterpart."""

    at_s: float
    field: str
    recorded: str
    replayed: str


@dataclass(frozen=True, slots=True)
class Comparison:
    """recorded, replayed: messages compared. matched: of both sides together. first: the first without a counterpart.

    allowed: messages of both sides together that may have none. count: by which the numbers of both sides may differ.
    """

    recorded: int
    replayed: int
    matched: int
    allowed: int
    count: int
    first: Difference | None

    @property
    def messages(self) -> int:
        """Of both sides together."""
        return self.recorded + self.replayed

    @property
    def equal(self) -> bool:
        return self.messages - self.matched <= self.allowed and abs(self.recorded - self.replayed) <= self.count


def compare(
    recorded: Sequence[Timed],
    replayed: Sequence[Timed],
    tolerance: Tolerance,
    begin_s: float = -math.inf,
    end_s: float = math.inf,
) -> Comparison:
    """Both in the order of time. Each message needs an equal one of the other side within ``time_s``.

    begin_s, end_s: messages in between need a counterpart, which may be outside.
    """
    missed: list[Difference] = []
    counts = []
    for mine, others, swapped in ((recorded, replayed, False), (replayed, recorded, True)):
        times = [item.at_s for item in others]
        inside = [item for item in mine if begin_s <= item.at_s <= end_s]
        counts.append(len(inside))
        for item in inside:
            found = _without_counterpart(item, others, times, tolerance, swapped=swapped)
            if found is not None:
                missed.append(found)
    total = sum(counts)
    first = min(missed, key=lambda item: item.at_s, default=None)
    allowed = math.floor(tolerance.unmatched * total)
    return Comparison(counts[0], counts[1], total - len(missed), allowed, tolerance.count, first)


def _without_counterpart(
    item: Timed, others: Sequence[Timed], times: Sequence[float], tolerance: Tolerance, *, swapped: bool
) -> Difference | None:
    """The difference from the nearest message if no other within the time is equal. swapped: ``item`` was replayed."""
    begin = bisect_left(times, item.at_s - tolerance.time_s)
    end = bisect_right(times, item.at_s + tolerance.time_s)
    nearest: Difference | None = None
    for other in sorted(others[begin:end], key=lambda other: abs(other.at_s - item.at_s)):
        pair = (other.message, item.message) if swapped else (item.message, other.message)
        found = difference(*pair, tolerance)
        if found is None:
            return None
        if nearest is None:
            nearest = Difference(item.at_s, *found)
    if nearest is not None:
        return nearest
    return Difference(item.at_s, "", *((_ABSENT, "a message") if swapped else ("a message", _ABSENT)))


def difference(recorded: Any, replayed: Any, tolerance: Tolerance, path: str = "") -> tuple[str, str, str] | None:
    """(field, recorded, replayed) of the first field that differs, None if the values are equal."""
    if hasattr(recorded, "get_fields_and_field_types"):
        return _of_messages(recorded, replayed, tolerance, path)
    if isinstance(recorded, (bool, str)):
        equal = recorded == replayed
    elif isinstance(recorded, (int, float)):
        limit = tolerance.absolute + tolerance.relative * abs(recorded)
        both_nan = recorded != recorded and replayed != replayed
        equal = recorded == replayed or abs(recorded - replayed) <= limit or both_nan
    elif isinstance(recorded, _NUMERIC):
        return _of_arrays(_numbers(recorded), _numbers(replayed), tolerance, path)
    else:
        return _of_lists(recorded, replayed, tolerance, path)
    return None if equal else (path, _text(recorded), _text(replayed))


def _of_messages(recorded: Any, replayed: Any, tolerance: Tolerance, path: str) -> tuple[str, str, str] | None:
    fields = recorded.get_fields_and_field_types()
    if set(fields) == {"sec", "nanosec"}:
        times = [item.sec + 1e-9 * item.nanosec for item in (recorded, replayed)]
        equal = abs(times[0] - times[1]) <= tolerance.time_s
        return None if equal else (path, f"{times[0]:.6f}", f"{times[1]:.6f}")
    for name in fields:
        inner = f"{path}.{name}" if path else name
        found = difference(getattr(recorded, name), getattr(replayed, name), tolerance, inner)
        if found is not None:
            return found
    return None


def _of_lists(
    recorded: Sequence[Any], replayed: Sequence[Any], tolerance: Tolerance, path: str
) -> tuple[str, str, str] | None:
    if len(recorded) != len(replayed):
        return path, f"{len(recorded)} items", f"{len(replayed)} items"
    for index, pair in enumerate(zip(recorded, replayed, strict=True)):
        found = difference(*pair, tolerance, f"{path}[{index}]")
        if found is not None:
            return found
    return None


def _of_arrays(
    recorded: NDArray[Any], replayed: NDArray[Any], tolerance: Tolerance, path: str
) -> tuple[str, str, str] | None:
    if len(recorded) != len(replayed):
        return path, f"{len(recorded)} elements", f"{len(replayed)} elements"
    differing = np.flatnonzero(~_near(recorded.astype(np.float64), replayed.astype(np.float64), tolerance))
    if len(differing) <= tolerance.elements * len(recorded):
        return None
    first = int(differing[0])
    more = f" ({len(differing)} of {len(recorded)} differ)" if len(differing) > 1 else ""
    return f"{path}[{first}]", f"{recorded[first]}{more}", f"{replayed[first]}"


def _near(recorded: Any, replayed: Any, tolerance: Tolerance) -> Any:
    limit = tolerance.absolute + tolerance.relative * np.abs(recorded)
    with np.errstate(invalid="ignore"):
        apart = np.abs(recorded - replayed)
    return (recorded == replayed) | (apart <= limit) | (np.isnan(recorded) & np.isnan(replayed))


def _numbers(values: Any) -> NDArray[Any]:
    return np.frombuffer(values, np.uint8) if isinstance(values, bytes) else np.asarray(values)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    text = value if isinstance(value, str) else str(value)
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."
