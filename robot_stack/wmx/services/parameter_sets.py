"""Parameters of the engine: a file imported as a whole, and the parameters of axes as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum
from typing import Any

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import AxisCommandMode, OperationState
from robot_stack.wmx.api.port import CoreMotion
from robot_stack.wmx.general.answers import Answer, failure, joined


@dataclass(frozen=True, slots=True)
class ParametersRead:
    """texts: one per axis, empty for one that did not answer."""

    answer: Answer
    texts: tuple[str, ...] = ()


def load_file(engine: MotionEngine, path: str) -> Answer:
    """Imports a parameter file, unless an axis moves: its gear or its limits would change under it."""
    what = f"Failed to load parameters from {path!r}"
    if not path.startswith("/"):
        return Answer(False, f"{what}: file_path must be absolute")
    code, snapshot = engine.read_status()
    if code:
        return failure(what, code, engine.core_motion.ErrorToString)
    moving = [axis for axis, state in enumerate(snapshot.op_state.tolist()) if state != OperationState.Idle]
    if moving:
        return Answer(False, f"{what}: axes {', '.join(map(str, moving))} are moving")
    code = engine.core_motion.config.ImportAndSetAll(path)
    if code:
        return failure(what, code, engine.core_motion.ErrorToString)
    return Answer(True, f"Loaded parameters from {path}")


def show(engine: MotionEngine, index: Sequence[int]) -> ParametersRead:
    """The parameters of some axes, or of all the engine has."""
    axes = list(index)
    if not axes:
        code, snapshot = engine.read_status()
        if code:
            return ParametersRead(failure("Failed to get parameters", code, engine.core_motion.ErrorToString))
        axes = list(range(snapshot.n_axes))
    entries = [_axis(engine.core_motion, axis) for axis in axes]
    return ParametersRead(joined(answer for answer, _ in entries), tuple(text for _, text in entries))


def _axis(core_motion: CoreMotion, axis: int) -> tuple[Answer, str]:
    lines = []
    for code, name, value in _parameters(core_motion, axis):
        if code:
            return failure(f"Failed to get {name} of axis {axis}", code, core_motion.ErrorToString), ""
        lines.append(f"{name}: {value}")
    return Answer(True, f"Parameters of axis {axis}"), "\n".join([f"axis: {axis}", *lines])


def _parameters(core_motion: CoreMotion, axis: int) -> Iterator[tuple[int, str, object]]:
    """(code, name, value) of every parameter."""
    config = core_motion.config
    code, numerator, denominator = config.GetGearRatio(axis)
    yield code, "gear ratio", f"{numerator:.12g} / {denominator:.12g}"
    code, polarity = config.GetAxisPolarity(axis)
    yield code, "polarity", polarity
    code, mode = core_motion.axisControl.GetAxisCommandMode(axis)
    yield code, "command mode", _name(AxisCommandMode, mode)
    blocks: list[tuple[str, tuple[int, Any]]] = [
        ("feedback", config.GetFeedbackParam(axis)),
        ("home", config.GetHomeParam(axis)),
        ("limit", config.GetLimitParam(axis)),
        ("motion", config.GetMotionParam(axis)),
        ("alarm", config.GetAlarmParam(axis)),
    ]
    for name, (code, block) in blocks:
        if code:
            yield code, f"{name} parameters", ""
        defaults = asdict(type(block)())
        for key, value in asdict(block).items():
            kind = type(defaults[key])
            yield 0, f"{name}.{key}", _name(kind, value) if issubclass(kind, IntEnum) else value


def _name(kind: type[IntEnum], value: int) -> str:
    try:
        return kind(value).name
    except ValueError:
        return str(value)
