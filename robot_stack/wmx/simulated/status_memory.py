"""The engine's status in shared memory: written once per cycle, read by any process without a request to the engine.

A file in the runtime folder is mapped by the writer and by every reader. It is a sequence lock: the writer makes the
sequence number odd, writes, makes it even; a reader copies between two reads of the number and retries if they
differ or are odd. A reader never blocks the writer, and readers are independent of each other.

Assumptions: each store to the sequence number is one aligned 8-byte store, and the interpreter does not reorder
statements. x86 keeps stores in order and loads in order, so there the two reads suffice. Other processors (ARM) may let
another core see the stores in another order, and Python has no memory barrier; there the page also carries a
checksum of its contents, which a reader verifies. It detects a torn copy in any order.

A writer that dies in the middle leaves the number odd; readers give up after a bounded number of tries. A dead
writer is detected by the age of the stamp. A new writer puts a new file in place of the old one, never into it.
"""

from __future__ import annotations

import mmap
import os
import struct
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.axes import N_FLAGS, N_REALS, AxisFeedback, Real, StatusSnapshot, axis_feedback

STATUS_FILE: Final = "engine.status"

MAGIC: Final = 0x53_58_4D_57  # "WMXS"
LAYOUT: Final = 4
HEAD: Final = struct.Struct("<qqqqqqqq")
"""magic, layout, axes, input bytes, output bytes, checksum used, checksum, sequence number"""
CHECKSUM_AT: Final = 48
SEQUENCE_AT: Final = 56
META: Final = struct.Struct("<qqqqqqqqqq")
"""state, epoch, cycles, stamp ns, cycle time ns, error, emergency stop, its level, lost cycles, overruns"""

_FEEDBACK_META: Final = struct.Struct("<qqqq")
"""The first of these."""
_COMMUNICATING: Final = int(EngineState.Communicating)

_STATES: Final = tuple(sorted(EngineState))  # 0, 1, ...: an index into a tuple instead of a call

_TRIES: Final = 2000
_PATIENT_TRIES: Final = 50
"""Tries at full speed before a reader yields its time slice between tries."""

ORDERED_MACHINES: Final = frozenset({"x86_64", "AMD64", "i686", "i386"})


class StatusUnreadable(Exception):
    """There is no status page, it is no status page of this layout, or its writer died in the middle of a write."""


class StatusReader:
    """Reads the status published in ``folder``. Raises StatusUnreadable where there is none."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / STATUS_FILE
        self._page, self._layout, self._checked = _open(self._path)
        self._number = memoryview(self._page)[SEQUENCE_AT : SEQUENCE_AT + 8].cast("q")
        self._contents = np.frombuffer(self._page, np.uint8, self._layout.size - HEAD.size, HEAD.size)
        self._row = struct.Struct(f"<{self._layout.n_axes}d")
        self._position_at, self._velocity_at = map(self._layout.real, (Real.ACTUAL_POS, Real.ACTUAL_VELOCITY))

    def read(self, pause: Callable[[float], object] = time.sleep) -> StatusSnapshot:
        """A consistent copy. Raises StatusUnreadable if there is none, e.g. after a crash of the writer."""
        number = self._number
        for attempt in range(_TRIES):
            before = number[0]
            if not before & 1:
                copy = self._contents.copy()
                checksum = struct.unpack_from("<q", self._page, CHECKSUM_AT)[0] if self._checked else 0
                if number[0] == before and (not self._checked or zlib.crc32(copy.data) == checksum):
                    return self._layout.snapshot(copy)
            if attempt >= _PATIENT_TRIES:
                pause(0.0)
        raise StatusUnreadable(f"{self._path}: no consistent status in {_TRIES} tries: its writer died while writing")

    def read_feedback(self) -> AxisFeedback:
        """A consistent copy of the values that change with every motion. Raises StatusUnreadable as ``read``."""
        if self._checked:  # the checksum is one of the whole page
            return axis_feedback(self.read())
        number, page, row = self._number, self._page, self._row
        for _ in range(_PATIENT_TRIES):
            before = number[0]
            state, epoch, cycles, stamp_ns = _FEEDBACK_META.unpack_from(page, HEAD.size)
            position = row.unpack_from(page, self._position_at)
            velocity = row.unpack_from(page, self._velocity_at)
            outputs = page[self._layout.outputs :]
            if number[0] == before and not before & 1:
                return AxisFeedback(state == _COMMUNICATING, epoch, cycles, stamp_ns, position, velocity, outputs)
        return axis_feedback(self.read())

    def replaced(self) -> bool:
        """A newer writer has put another file in place, or the file is gone."""
        try:
            return os.stat(self._path).st_ino != self._layout.inode
        except OSError:
            return True


class PageLayout:
    """Offsets in the page, in bytes from its start."""

    def __init__(self, n_axes: int, n_inputs: int, n_outputs: int, inode: int = 0) -> None:
        self.n_axes, self.n_inputs, self.n_outputs, self.inode = n_axes, n_inputs, n_outputs, inode
        self.reals = HEAD.size + META.size
        self.flags = self.reals + 8 * N_REALS * n_axes
        self.inputs = self.flags + 8 * N_FLAGS * n_axes
        self.outputs = self.inputs + n_inputs
        self.size = self.outputs + n_outputs

    def real(self, row: Real) -> int:
        """Offset of a quantity's values, one per axis."""
        return self.reals + 8 * self.n_axes * row

    def snapshot(self, contents: NDArray[np.uint8]) -> StatusSnapshot:
        """The snapshot in a copy of the page's contents, which begin after the head."""
        meta = META.unpack_from(contents.data)
        state, epoch, cycles, stamp_ns, cycle_ns, error, stop, level, lost, overruns = meta
        skip, n_axes = HEAD.size, self.n_axes
        reals: NDArray[np.float64] = np.ndarray((N_REALS, n_axes), np.float64, contents, self.reals - skip)
        flags: NDArray[np.int64] = np.ndarray((N_FLAGS, n_axes), np.int64, contents, self.flags - skip)
        return StatusSnapshot(
            engine_state=_STATES[state],
            epoch=epoch,
            cycle_counter=cycles,
            engine_time_s=cycles * cycle_ns * 1e-9,
            stamp_ns=stamp_ns,
            cycle_time_s=cycle_ns * 1e-9,
            engine_error=error,
            emergency_stop=bool(stop),
            emergency_stop_level=level,
            lost_cycles=lost,
            overruns=overruns,
            reals=reals,
            flags=flags,
            inputs=contents[self.inputs - skip : self.outputs - skip],
            outputs=contents[self.outputs - skip :],
        )


def _open(path: Path) -> tuple[mmap.mmap, PageLayout, bool]:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise StatusUnreadable(f"{path}: cannot be opened: {error.strerror or error}") from error
    try:
        found = os.fstat(descriptor)
        if found.st_size < HEAD.size + META.size:
            raise StatusUnreadable(f"{path}: has {found.st_size} bytes, too few for a status page")
        page = mmap.mmap(descriptor, found.st_size, prot=mmap.PROT_READ)
    finally:
        os.close(descriptor)
    magic, layout_number, n_axes, n_inputs, n_outputs, checked, _, _ = HEAD.unpack_from(page)
    layout = PageLayout(n_axes, n_inputs, n_outputs, found.st_ino)
    if (magic, layout_number) != (MAGIC, LAYOUT) or layout.size != found.st_size:
        raise StatusUnreadable(f"{path}: is no status page of layout {LAYOUT}")
    return page, layout, bool(checked)
