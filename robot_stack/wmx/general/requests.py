"""Checks of a whole service request, before any axis is changed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_stack.wmx.api import MAX_AXES


class Refused(Exception):
    """A request or command that changes nothing; the text names the field and the reason."""


def check_index(index: Sequence[int]) -> None:
    """At least one axis, none twice. Raises Refused."""
    if not index:
        raise Refused("index is empty: it must name at least one axis")
    if len(index) > MAX_AXES:
        raise Refused(f"index has {len(index)} entries: there are at most {MAX_AXES} axes")
    first: dict[int, int] = {}
    for place, axis in enumerate(index):
        if axis in first:
            raise Refused(f"index names axis {axis} twice: index[{first[axis]}] and index[{place}]")
        first[axis] = place


def check_lengths(index: Sequence[int], fields: dict[str, Sequence[float]]) -> None:
    """Every array has one entry per axis of ``index``. Raises Refused."""
    for name, values in fields.items():
        if len(values) != len(index):
            raise Refused(
                f"{name} has {_entries(len(values))}, index has {_entries(len(index))}: they must be equally long"
            )


def check_finite(fields: dict[str, Sequence[float]]) -> None:
    """No NaN, no infinity. Raises Refused."""
    for name, values in fields.items():
        for place, value in enumerate(values):
            if not math.isfinite(value):
                raise Refused(f"{name}[{place}] is {value}: it must be finite")


def check_positive(name: str, values: Sequence[float]) -> None:
    """Raises Refused unless every value is above zero."""
    for place, value in enumerate(values):
        if not value > 0.0:
            raise Refused(f"{name}[{place}] is {value:g}: it must be above 0")


def check_at_most(name: str, values: Sequence[float], limit: float) -> None:
    """Raises Refused if a magnitude is above ``limit``, of which 0 means none."""
    for place, value in enumerate(values):
        if limit and abs(value) > limit:
            raise Refused(f"{name}[{place}] is {value:g}: at most {limit:g} is allowed")


def check_axes(index: Sequence[int], n_axes: int) -> None:
    """Every axis exists. Raises Refused."""
    for place, axis in enumerate(index):
        if not 0 <= axis < n_axes:
            raise Refused(f"index[{place}] is {axis}: the engine has axes 0 to {n_axes - 1}")


def _entries(count: int) -> str:
    return f"{count} entry" if count == 1 else f"{count} entries"
