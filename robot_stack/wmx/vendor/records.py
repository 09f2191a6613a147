"""Copies values across the adapter: between the port's dataclasses and the vendor's objects, field by field.

A field of the port is copied by its annotation; an enumeration by its names. For an array of the vendor, its
Python module has no attribute but one method that reads an element and one that writes it (``GetEStopDec(axis)``,
``SetEStopDec(axis, value)`` for ``eStopDec``). A proxy object of the vendor silently accepts any new attribute, so
a field is only written where it exists.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import IntEnum
from functools import cache
from types import ModuleType
from typing import Any, Final, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from robot_stack.wmx.api.status import DevicesInfo
from robot_stack.wmx.api.values import AdvMotion_PointTimeSplineCommand, AdvMotion_SplinePoint, AxisSelection
from robot_stack.wmx.vendor.names import NumberMap, enum_map, error_map

T = TypeVar("T")
COUNTS: Final = {(DevicesInfo, "devices"): "count"}
"""The field of a record that counts the entries of an array; other arrays have one per axis."""


class MissingField(Exception):
    """The vendor's object has no such field; ``str`` names it."""


@cache
def plan(kind: type) -> tuple[tuple[str, Any, type[IntEnum] | None], ...]:
    """For each field of a dataclass: name, type, and the enumeration that its default belongs to."""
    hints = get_type_hints(kind)
    return tuple((item.name, hints[item.name], _enumeration(item)) for item in fields(kind))


def _enumeration(item: Field[Any]) -> type[IntEnum] | None:
    default = item.default
    return type(default) if default is not MISSING and isinstance(default, IntEnum) else None


def element(record: Any, name: str, index: int) -> Any:
    """Entry ``index`` of the array ``name``."""
    getter = getattr(record, f"Get{_capital(name)}", None)
    return getattr(record, name)[index] if getter is None else getter(index)


def set_element(record: Any, name: str, index: int, value: Any) -> None:
    """Writes entry ``index`` of the array ``name``. Raises MissingField."""
    setter = getattr(record, f"Set{_capital(name)}", None)
    if setter is not None:
        setter(index, value)
    elif hasattr(record, name):
        getattr(record, name)[index] = value
    else:
        raise MissingField(f"{type(record).__name__}.{name}")


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]


class Records:
    """Copies values between the port and ``module``. Arrays by axis have ``n_axes`` entries on the port's side."""

    def __init__(self, module: ModuleType, n_axes: int) -> None:
        self.module = module
        self.n_axes = n_axes
        self.errors = error_map(module)
        self._enums: dict[type[IntEnum], NumberMap] = {}

    def enum(self, kind: type[IntEnum]) -> NumberMap:
        """The map of an enumeration."""
        found = self._enums.get(kind)
        if found is None:
            found = self._enums[kind] = enum_map(self.module, kind)
        return found

    # -- to the vendor -------------------------------------------------------------------------------------------------

    def theirs(self, value: Any) -> Any:
        """An argument as the vendor's module takes it: plain numbers and its own objects. Raises MissingField."""
        if isinstance(value, AxisSelection):
            return self._selection("AxisSelection", "axisCount", value.axisCount, value.GetAxis)
        if isinstance(value, AdvMotion_PointTimeSplineCommand):
            name = "AdvMotion_PointTimeSplineCommand"
            return self._selection(name, "dimensionCount", value.dimensionCount, value.GetAxis)
        if isinstance(value, AdvMotion_SplinePoint):
            point = self.module.AdvMotion_SplinePoint()
            for dimension, position in enumerate(value.pos):
                point.SetPos(dimension, float(position))
            return point
        if is_dataclass(value) and not isinstance(value, type):
            return self.fill(value, getattr(self.module, type(value).__name__)())
        if isinstance(value, (list, tuple)):
            return [self.theirs(item) for item in value]
        return _plain(value)

    def _selection(self, kind: str, count_name: str, count: int, axis: Callable[[int], int]) -> Any:
        made = getattr(self.module, kind)()
        setattr(made, count_name, operator.index(count))
        for index in range(count):
            made.SetAxis(index, operator.index(axis(index)))
        return made

    def fill(self, value: Any, made: Any) -> Any:
        """Writes the fields of a dataclass of the port into the vendor's object. Raises MissingField."""
        for name, kind, enumeration in plan(value.__class__):
            field = getattr(value, name)
            if get_origin(kind) in (list, Sequence):
                (item_kind,) = get_args(kind)
                for index, item in enumerate(field):
                    set_element(made, name, index, item_kind(item))
            elif not hasattr(made, name):
                raise MissingField(f"{type(made).__name__}.{name}")
            elif is_dataclass(field):
                self.fill(field, getattr(made, name))
            elif enumeration is not None:
                setattr(made, name, self.enum(enumeration).theirs(int(field)))
            else:
                setattr(made, name, kind(field))
        return made

    # -- from the vendor -----------------------------------------------------------------------------------------------

    def ours(self, kind: Any, value: Any) -> Any:
        """Converts a value returned by the vendor to the port's ``kind``."""
        if isinstance(kind, type) and issubclass(kind, IntEnum):
            return self.enum(kind).ours(int(value))
        if is_dataclass(kind):
            return self.read(kind, value)
        return kind(value)

    def read(self, kind: Any, theirs: Any) -> Any:
        """A dataclass of the port with the fields of the vendor's object; those it lacks keep their defaults."""
        made = kind()
        for name, field_kind, enumeration in plan(kind):
            if get_origin(field_kind) in (list, Sequence):
                setattr(made, name, self._array(kind, name, get_args(field_kind)[0], theirs))
            elif not hasattr(theirs, name):
                continue
            elif enumeration is not None:
                setattr(made, name, self.enum(enumeration).ours(int(getattr(theirs, name))))
            else:
                setattr(made, name, self.ours(field_kind, getattr(theirs, name)))
        return made

    def _array(self, kind: Any, name: str, item_kind: Any, theirs: Any) -> list[Any]:
        if not hasattr(theirs, name) and not hasattr(theirs, f"Get{_capital(name)}"):
            return []
        counted_by = COUNTS.get((kind, name))
        count = self.n_axes if counted_by is None else int(getattr(theirs, counted_by))
        return [self.ours(item_kind, element(theirs, name, index)) for index in range(count)]


def _plain(value: Any) -> Any:
    """Numbers of numpy and of enumerations as Python's own: the vendor's wrapper refuses the former."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    return float(value) if isinstance(value, (float, np.floating)) else value
