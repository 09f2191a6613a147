"""Writes the engine's status to shared memory once per cycle, in the layout of ``simulated.status_memory``."""

from __future__ import annotations

import mmap
import os
import platform
import struct
import zlib
from pathlib import Path

import numpy as np

from robot_stack.wmx.axes import N_FLAGS, N_REALS
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.simulated.status_memory import (
    CHECKSUM_AT,
    HEAD,
    LAYOUT,
    MAGIC,
    META,
    ORDERED_MACHINES,
    SEQUENCE_AT,
    STATUS_FILE,
    PageLayout,
)


class StatusWriter:
    """Publishes an engine's status in ``folder``. ``checked`` forces the checksum on or off."""

    def __init__(self, engine: Engine, folder: Path, checked: bool | None = None) -> None:
        self._engine = engine
        self._checked = platform.machine() not in ORDERED_MACHINES if checked is None else checked
        arrays, inputs, outputs = engine.arrays, engine.feedback.inputs, engine.commands.outputs
        n_axes = arrays.n_axes
        layout = PageLayout(n_axes, inputs.size, outputs.size)
        self._page = _create(folder / STATUS_FILE, layout.size)
        head = (MAGIC, LAYOUT, n_axes, inputs.size, outputs.size, int(self._checked), 0, 0)
        HEAD.pack_into(self._page, 0, *head)
        self._sequence = 0
        self._number = np.frombuffer(self._page, np.int64, 1, SEQUENCE_AT)
        self._reals = np.frombuffer(self._page, np.float64, N_REALS * n_axes, layout.reals).reshape(N_REALS, n_axes)
        self._flags = np.frombuffer(self._page, np.int64, N_FLAGS * n_axes, layout.flags).reshape(N_FLAGS, n_axes)
        self._inputs = np.frombuffer(self._page, np.uint8, inputs.size, layout.inputs)
        self._outputs = np.frombuffer(self._page, np.uint8, outputs.size, layout.outputs)
        self._contents = memoryview(self._page)[HEAD.size : layout.size]

    def publish(self, stamp_ns: int) -> None:
        """Writes the present status, stamped with the monotonic clock."""
        engine, condition = self._engine, self._engine.condition
        self._sequence += 2
        self._number[0] = self._sequence - 1
        META.pack_into(
            self._page,
            HEAD.size,
            condition.state,
            condition.epoch,
            condition.cycles,
            stamp_ns,
            round(1e9 * condition.cycle_time_s),
            condition.error,
            condition.emergency_stop,
            condition.emergency_stop_level,
            condition.lost_cycles,
            condition.overruns,
        )
        self._reals[:] = engine.arrays.reals
        self._flags[:] = engine.arrays.flags
        self._inputs[:] = engine.feedback.inputs
        self._outputs[:] = engine.commands.outputs
        if self._checked:
            struct.pack_into("<q", self._page, CHECKSUM_AT, zlib.crc32(self._contents))
        self._number[0] = self._sequence


def _create(path: Path, size: int) -> mmap.mmap:
    """Creates a new page under a temporary name, then replaces the old one: readers never see half a page."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}")
    descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    try:
        os.ftruncate(descriptor, size)
        page = mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)
    HEAD.pack_into(page, 0, 0, LAYOUT, 0, 0, 0, 0, 0, 1)
    os.rename(temporary, path)
    return page
