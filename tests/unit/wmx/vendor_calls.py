"""Every call of the surface with distinct arguments, and the expected call of the vendor's module."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
    AxisSelection,
    Profile,
    ProfileType,
)
from robot_stack.wmx.api.surface import SURFACE, Call, Commands, Plain
from tests.unit.wmx.harness import part

ELSEWHERE: Final = frozenset({"CreateDevice", "ErrorToString"})
"""Calls of the port with tests of their own: they are several calls of the vendor's, or none."""

_PROFILE: Final = {
    "type": 0,
    "velocity": 1.5,
    "acc": 2.5,
    "dec": 3.5,
    "jerkAcc": 0.0,
    "jerkDec": 0.0,
    "jerkAccRatio": 0.0,
    "jerkDecRatio": 0.0,
    "accTimeMilliseconds": 4.5,
    "decTimeMilliseconds": 5.5,
    "startingVelocity": 6.5,
    "endVelocity": 7.5,
    "secondVelocity": 0.0,
    "movingAverageTimeMilliseconds": 0.0,
}
_LAST: Final = ("WMX3Api.StopCommunication", "WMX3Api.StopEngine", "WMX3Api.CloseDevice")
"""Called last, since calls after these fail at once."""


def _command(kind: type) -> tuple[Any, dict[str, Any]]:
    profile = Profile(ProfileType.Trapezoidal, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5)
    fields = {"target": 8.5} if kind.__name__ == "Motion_PosCommand" else {}
    if "Timed" in kind.__name__:
        fields = {"runTimeMilliseconds": 14.5}
    return kind(axis=2, profile=profile, **fields), {"axis": 2, "profile": _PROFILE, **fields}


def _sample(kind: Any, place: int) -> tuple[Any, Any]:
    """Returns an argument and its expected form in the vendor's module."""
    if isinstance(kind, Commands):
        return _command(kind.kind)
    if kind is AxisSelection:
        return AxisSelection.of(4, 2), {"axisCount": 2, "axis": [4, 2] + [0] * 126}
    if isinstance(kind, type) and issubclass(kind, IntEnum):
        return 1, 1
    value = {Plain.AXIS: 2, Plain.DOUBLE: 6.5 + place, Plain.TEXT: "/nowhere/at all"}.get(kind, 3 - place)
    return value, value


_SPECIAL: Final[dict[str, tuple[tuple[Any, ...], tuple[Any, ...]]]] = {
    "config.SetAxisPolarity": ((2, -1), (2, -1)),
    "advMotion.CreateSplineBuffer": ((3, 100), (3, 100)),
    "advMotion.StartCSplinePos_PointTime": (
        (
            3,
            AdvMotion_PointTimeSplineCommand(2, [4, 2]),
            2,
            [AdvMotion_SplinePoint([1.25, -2.5]), AdvMotion_SplinePoint([3.75, -4.0])],
            [100, 200],
        ),
        (
            3,
            {"dimensionCount": 2, "axis": [4, 2, 0, 0, 0, 0]},
            2,
            [{"pos": [1.25, -2.5, 0, 0, 0, 0]}, {"pos": [3.75, -4.0, 0, 0, 0, 0]}],
            [100, 200],
        ),
    ),
    "Ecat.ScanNetwork": ((0,), ()),
}


def _arguments(full: str, call: Call) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    if full in _SPECIAL:
        return _SPECIAL[full]
    pairs = [_sample(kind, place) for place, kind in enumerate(call.takes)]
    return tuple(given for given, _ in pairs), tuple(seen for _, seen in pairs)


def _listed() -> dict[str, Call]:
    calls = {f"{owner}.{name}": call for owner, table in SURFACE.items() for name, call in table.items()}
    first = {full: call for full, call in calls.items() if full not in _LAST and not call.echo}
    return {**first, **{full: calls[full] for full in _LAST}}


Case = tuple[Callable[[MotionEngine], Any], tuple[Any, ...]]


def _case(full: str, call: Call) -> Case:
    owner, _, name = full.partition(".")
    given, seen = _arguments(full, call)
    return (lambda engine: getattr(part(engine, owner), name)(*given)), seen


CALLS: Final[dict[str, Case]] = {
    full: _case(full, call) for full, call in _listed().items() if full.partition(".")[2] not in ELSEWHERE
}
"""Setters of blocks are two calls of the vendor's and have tests of their own."""


def check(engine: MotionEngine, module: Any, name: str) -> None:
    """Makes one call. Asserts that it reached the vendor's module as listed, without faults."""
    control = module.CONTROL
    call, expected = CALLS[name]
    if name.startswith("Ecat.") and module.VARIANT.ecat_takes_master:
        expected = (0, *expected)
    before = len(control.named(name))
    call(engine)
    found = control.named(name)[before:]
    assert found, f"{name} never reached the vendor's module"
    assert found[-1] == expected
    assert control.faults == []
