"""All parameters of the engine at once, as numbers in the order of the parameter file; set as a whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robot_stack.wmx.api.enums import AxisCommandMode, OperationState
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.parameters import Config_EmergencyStopParam
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.engine_server import rows
from robot_stack.wmx.engine_server.checks import LARGEST, target
from robot_stack.wmx.engine_server.parameter_checks import gear_in_range, valid_block
from robot_stack.wmx.engine_server.parameters import Parameters
from robot_stack.wmx.engine_server.state import EngineArrays
from robot_stack.wmx.parameter_blocks import BLOCKS, AxisBlock, Entries, engine_entries, fill_blocks
from robot_stack.wmx.simulated import parameter_layout as layout


@dataclass(frozen=True, slots=True)
class _Axis:
    """The file's values of one axis, checked."""

    entries: Entries
    blocks: dict[str, AxisBlock]
    mode: int
    gear: tuple[float, float]
    polarity: int
    absolute: bool
    home_offset: float


class ParameterSet:
    """Collects the parameters for a file, and sets those of one. Entries that nothing uses are kept as they came."""

    def __init__(self, parameters: Parameters, arrays: EngineArrays) -> None:
        self._parameters = parameters
        self._a = arrays
        self._of_engine: Entries = {}
        self._of_axes: list[Entries] = []
        self.reset()

    def reset(self) -> None:
        """Clears the values of an earlier file."""
        self._of_engine = dict(layout.GLOBAL_ENTRIES)
        self._of_axes = [dict(layout.AXIS_ENTRIES) for _ in range(self._a.n_axes)]
        for axis, entries in enumerate(self._of_axes):
            for key in layout.FURTHER_IN_POS_WIDTHS:
                entries[key] = float(self._a.params[rows.IN_POS_WIDTH, axis])

    def collect(self) -> tuple[list[layout.Number], list[list[layout.Number]]]:
        """Numbers of the engine, and of each axis."""
        whole = engine_entries(self._parameters.emergency_stop, self._of_engine)
        return list(whole.values()), [list(self._collect_axis(axis).values()) for axis in range(self._a.n_axes)]

    def _collect_axis(self, axis: int) -> Entries:
        entries, parameters = dict(self._of_axes[axis]), self._parameters
        fill_blocks(entries, {name: parameters.get(name, axis) for name in layout.BLOCK_FIELDS})
        entries[layout.ESTOP_DEC] = parameters.emergency_stop.eStopDec[axis]
        entries[layout.COMMAND_MODE] = int(self._a.flags[Flag.COMMAND_MODE, axis])
        entries[layout.GEAR_NUMERATOR], entries[layout.GEAR_DENOMINATOR] = parameters.gear[axis]
        entries[layout.POLARITY] = parameters.polarity[axis]
        absolute = parameters.absolute(axis)
        entries[layout.ABSOLUTE_ENCODER] = int(absolute)
        entries[layout.HOME_OFFSET] = float(self._a.reals[Real.HOME_OFFSET, axis]) if absolute else 0.0
        return entries

    def apply(self, of_engine: Sequence[Any], of_axes: Sequence[Sequence[Any]], communicating: bool) -> int:
        """Sets everything. NotIdleState while an axis moves, ParameterSettingsInvalid for a value that is refused."""
        invalid = CoreMotionErrorCode.ParameterSettingsInvalid
        if len(of_axes) != self._a.n_axes:
            return ErrorCode.AxisCountOutOfRange
        if (self._a.flags[Flag.OP_STATE] != OperationState.Idle).any():
            return ErrorCode.NotIdleState
        whole = _entries(layout.GLOBAL_ENTRIES, of_engine)
        axes = [_axis(_entries(layout.AXIS_ENTRIES, numbers)) for numbers in of_axes]
        checked = [axis for axis in axes if axis is not None]
        if whole is None or len(checked) != len(axes):
            return invalid
        stop = _block(Config_EmergencyStopParam, layout.EMERGENCY_STOP_FIELDS, whole)
        stop.eStopDec = [float(axis.entries[layout.ESTOP_DEC]) for axis in checked]
        if self._parameters.set_emergency_stop(stop):
            return invalid
        self._of_engine = whole
        self._of_axes = [axis.entries for axis in checked]
        for index, axis in enumerate(checked):
            self._set_axis(index, axis, communicating)
        return ErrorCode.PyNone

    def _set_axis(self, index: int, axis: _Axis, communicating: bool) -> None:
        parameters, a = self._parameters, self._a
        before = float(a.params[rows.COUNTS_PER_UNIT, index])
        offset = float(a.reals[Real.HOME_OFFSET, index])
        for name, block in axis.blocks.items():
            parameters.set(name, index, block)
        parameters.set_gear(index, *axis.gear)
        parameters.set_polarity(index, axis.polarity)
        parameters.set_absolute(index, axis.absolute)
        if a.flags[Flag.COMMAND_MODE, index] != axis.mode:
            a.flags[Flag.COMMAND_MODE, index] = axis.mode
            a.reals[Real.POS_CMD, index] = a.reals[Real.PROFILE_TARGET_POS, index] = a.reals[Real.ACTUAL_POS, index]
        if axis.absolute:
            a.reals[Real.HOME_OFFSET, index] = axis.home_offset
        moved = before != a.params[rows.COUNTS_PER_UNIT, index] or offset != a.reals[Real.HOME_OFFSET, index]
        if moved:
            rescale(a, index)
        if axis.absolute and communicating:
            a.flags[Flag.HOME_DONE, index] = 1


def rescale(a: EngineArrays, axis: int) -> None:
    """User positions from the encoder counts by the present ratio and offset; the axis has to be homed again."""
    scale, offset = a.params[rows.COUNTS_PER_UNIT, axis], a.reals[Real.HOME_OFFSET, axis]
    a.reals[Real.ACTUAL_POS, axis] = a.flags[Flag.ENCODER_FEEDBACK, axis] / scale - offset
    command = a.flags[Flag.ENCODER_COMMAND, axis] / scale - offset
    a.reals[Real.POS_CMD, axis] = a.reals[Real.PROFILE_TARGET_POS, axis] = command
    a.flags[Flag.HOME_DONE, axis] = 0


def _entries(known: Mapping[str, layout.Number], numbers: Sequence[Any]) -> Entries | None:
    """The numbers by name, each of its entry's type; None if there are too few or one is out of range."""
    if len(numbers) != len(known):
        return None
    entries: Entries = {}
    for (key, default), number in zip(known.items(), numbers, strict=True):
        if type(number) not in (int, float) or not abs(number) <= LARGEST:
            return None
        if isinstance(default, int) and number != int(number):
            return None
        entries[key] = type(default)(number)
    return entries


def _axis(entries: Entries | None) -> _Axis | None:
    if entries is None:
        return None
    blocks = {name: _block(BLOCKS[name], names, entries) for name, names in layout.BLOCK_FIELDS.items()}
    numerator, denominator = float(entries[layout.GEAR_NUMERATOR]), float(entries[layout.GEAR_DENOMINATOR])
    mode, polarity = int(entries[layout.COMMAND_MODE]), int(entries[layout.POLARITY])
    absolute, offset = entries[layout.ABSOLUTE_ENCODER], float(entries[layout.HOME_OFFSET])
    good = (
        all(valid_block(name, block) for name, block in blocks.items())
        and gear_in_range(numerator)
        and gear_in_range(denominator)
        and polarity in (1, -1)
        and mode in (AxisCommandMode.Position, AxisCommandMode.Velocity)
        and absolute in (0, 1)
        and not target(offset, numerator / denominator, 0.0)
    )
    if not good:
        return None
    return _Axis(entries, blocks, mode, (numerator, denominator), polarity, bool(absolute), offset)


def _block(kind: type[Any], names: Mapping[str, str], entries: Entries) -> Any:
    """A block whose fields have the types of its defaults; a flag that is neither 0 nor 1 makes the block invalid."""
    defaults = kind()
    return kind(**{name: _like(entries[key], getattr(defaults, name)) for key, name in names.items()})


def _like(number: layout.Number, default: Any) -> Any:
    if isinstance(default, bool):
        return bool(number) if number in (0, 1) else number
    return float(number) if isinstance(default, float) else int(number)
