"""Reads the engine's parameters back after an import, because an engine with other ones moves its axes wrongly.

Compared are the values on which safety rests: gear, polarity, encoder, stops, alarms, limits and homing of each axis,
and the emergency stop. The widths within which a position counts as reached are not among them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import error_name
from robot_stack.wmx.config import AxisKind, EngineParameters
from robot_stack.wmx.parameter_blocks import blocks_of, emergency_stop_of

_BLOCKS: Final = {"home": "HomeParam", "limit": "LimitParam", "motion": "MotionParam", "alarm": "AlarmParam"}
_SAME: Final = 1e-9  # relative; the engine keeps float64


def differences(engine: MotionEngine, expected: EngineParameters, names: Mapping[int, str]) -> Iterator[str]:
    """Each value of the axes in ``names``, and of the engine, that is not the expected one or cannot be read.

    A text names the axis, the value, and what was found and expected.
    """
    config = engine.core_motion.config
    code, all_axes = config.GetAxisParam()
    stop_code, stop = config.GetEmergencyStopParam()
    if code or stop_code:
        yield f"axis parameters cannot be read: {error_name(code or stop_code)} (error {code or stop_code})"
        return
    wanted_stop = emergency_stop_of(expected)
    yield from _compare("engine", stop, wanted_stop, but=("eStopDec",))
    for axis, name in names.items():
        where, kind = f"axis {axis} ({name})", expected.axes[axis]
        if not axis < min(len(all_axes.axisPolarity), len(stop.eStopDec)):
            yield f"{where}: the engine has no such axis"
            continue
        found = {**_of_axis(all_axes, axis), "eStopDec": stop.eStopDec[axis]}
        wanted = {**_wanted_of_axis(kind), "eStopDec": wanted_stop.eStopDec[axis]}
        for key, value in wanted.items():
            if not _same(found[key], value):
                yield _difference(where, key, found[key], value)
        blocks = blocks_of(kind)
        for short, long in _BLOCKS.items():
            code, block = getattr(config, f"Get{long}")(axis)
            if code:
                yield f"{where}: {long} cannot be read: {error_name(code)} (error {code})"
            else:
                yield from _compare(where, block, blocks[short])


def _of_axis(param: Any, axis: int) -> dict[str, Any]:
    return {
        "gearRatioNumerator": param.gearRatioNumerator[axis],
        "gearRatioDenominator": param.gearRatioDenominator[axis],
        "axisPolarity": param.axisPolarity[axis],
        "absoluteEncoderMode": param.absoluteEncoderMode[axis],
        "absoluteEncoderHomeOffset": param.absoluteEncoderHomeOffset[axis],
    }


def _wanted_of_axis(kind: AxisKind) -> dict[str, Any]:
    """Without an absolute encoder the offset is that of the last homing."""
    wanted = {
        "gearRatioNumerator": kind.gear_numerator,
        "gearRatioDenominator": kind.gear_denominator,
        "axisPolarity": kind.polarity,
        "absoluteEncoderMode": kind.absolute_encoder,
    }
    return wanted | ({"absoluteEncoderHomeOffset": kind.home_offset_rad} if kind.absolute_encoder else {})


def _compare(where: str, found: Any, wanted: Any, but: tuple[str, ...] = ()) -> Iterator[str]:
    for field in fields(wanted):
        if field.name not in but:
            value, expected = getattr(found, field.name), getattr(wanted, field.name)
            if not _same(value, expected):
                yield _difference(where, field.name, value, expected)


def _same(found: Any, expected: Any) -> bool:
    return found == expected or math.isclose(found, expected, rel_tol=_SAME)


def _difference(where: str, name: str, found: Any, expected: Any) -> str:
    return f"{where}: {name} is {_text(found)}, expected {_text(expected)}"


def _text(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float) else f"{int(value)}"
