"""Encoding of arguments and results between a client and the engine, by the kinds of the surface's tables.

A record is sent as the list of its fields, an axis as a selection of one. Data from another process is
untrusted: ``decode`` checks every type, the engine checks values.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import IntEnum
from functools import cache
from typing import Any, Final, get_args, get_origin, get_type_hints

from robot_stack.wmx.api.surface import Commands, Plain, one_or_many
from robot_stack.wmx.api.values import MAX_AXES, AxisSelection

_INT_LIMIT: Final = 2**62
_LONGEST_LIST: Final = 8000


class BadArgument(Exception):
    """The data is not of the expected kind."""


@cache
def _plan(kind: type) -> tuple[tuple[str, Any], ...]:
    hints = get_type_hints(kind)
    return tuple((item.name, hints[item.name]) for item in fields(kind))


def request_name(owner: str, name: str) -> str:
    """A call of the surface on the wire: one axis is a selection of one."""
    return f"{owner}.{name.removesuffix('_AxisSel')}"


def selected(selection: AxisSelection) -> list[int]:
    """The axes of a selection."""
    return [selection.GetAxis(index) for index in range(selection.axisCount)]


# -- sending -----------------------------------------------------------------------------------------------------------


def encode(kind: Any, value: Any) -> Any:
    """An argument or an answer as plain JSON. Raises TypeError for an integer that is none."""
    if kind is Plain.AXIS:
        return [integer(value)]
    if kind is AxisSelection:
        return [integer(axis) for axis in selected(value)]
    if kind in _TO_WIRE:
        return _TO_WIRE[kind](value)
    return integer(value) if isinstance(kind, type) and issubclass(kind, IntEnum) else _bare(value)


def encode_all(takes: tuple[Any, ...], arguments: tuple[Any, ...]) -> list[Any] | None:
    """The arguments of a call; None for commands whose count and list do not fit."""
    if takes and isinstance(takes[0], Commands):
        commands = one_or_many(*arguments)
        return None if commands is None else [[_bare(command) for command in commands]]
    missing = (0,) * (len(takes) - len(arguments))
    return [encode(kind, value) for kind, value in zip(takes, (*arguments, *missing), strict=True)]


def integer(value: Any) -> int:
    return int(value.__index__())


def _bare(value: Any) -> Any:
    """Records as lists, numbers of numpy and of enumerations as Python's own."""
    if is_dataclass(value):
        return [_bare(getattr(value, name)) for name, _ in _plan(type(value))]  # type: ignore[arg-type]
    if isinstance(value, list | tuple):
        return [_bare(item) for item in value]
    if isinstance(value, IntEnum):
        return int(value)
    return value.item() if hasattr(value, "item") else value


_TO_WIRE: Final[dict[Any, Callable[[Any], Any]]] = {
    Plain.INT: integer,
    Plain.UINT: integer,
    Plain.UCHAR: integer,
    Plain.DOUBLE: float,
    Plain.TEXT: str,
}


# -- receiving ---------------------------------------------------------------------------------------------------------


def decode(kind: Any, value: Any) -> Any:
    """Inverse of ``encode`` for this kind. Raises BadArgument."""
    if kind is Plain.AXIS or kind is AxisSelection:
        return items(value, an_int, MAX_AXES)
    if isinstance(kind, Commands):
        return items(value, lambda item: _record(kind.kind, item), MAX_AXES)
    if kind in _FROM_WIRE:
        return _FROM_WIRE[kind](value)
    if get_origin(kind) is list:
        (entry,) = get_args(kind)
        return items(value, lambda item: decode(entry, item), _LONGEST_LIST)
    return _record(kind, value) if is_dataclass(kind) else an_int(value)


def _record(kind: Any, value: Any) -> Any:
    plan = _plan(kind)
    if not isinstance(value, list) or len(value) != len(plan):
        raise BadArgument
    return kind(*(decode(hint, item) for (_, hint), item in zip(plan, value, strict=True)))


def items(value: Any, convert: Callable[[Any], Any], longest: int) -> list[Any]:
    """A list of at most ``longest`` items. Raises BadArgument."""
    if not isinstance(value, list) or len(value) > longest:
        raise BadArgument
    return [convert(item) for item in value]


def an_int(value: Any) -> int:
    if type(value) is not int or abs(value) > _INT_LIMIT:
        raise BadArgument
    return value


def number(value: Any) -> int | float:
    if type(value) not in (int, float):
        raise BadArgument
    return value  # type: ignore[no-any-return]


def _real(value: Any) -> float:
    try:
        return float(number(value))
    except OverflowError:
        raise BadArgument from None


def _of(kind: type) -> Callable[[Any], Any]:
    def take(value: Any) -> Any:
        if not isinstance(value, kind):
            raise BadArgument
        return value

    return take


_FROM_WIRE: Final[dict[Any, Callable[[Any], Any]]] = {
    Plain.DOUBLE: _real,
    Plain.TEXT: _of(str),
    float: _real,
    str: _of(str),
    bool: _of(bool),
}
