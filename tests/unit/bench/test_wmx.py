"""What the benchmark of the joint states computes."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.bench import wmx, wmx_engine
from robot_stack.wmx.simulated.engine import Engine
from robot_stack.wmx.simulated.virtual_drives import VirtualDrives
from tests.unit.wmx.harness import engine_config, runtime_folder

MS = 1_000_000


def test_jitter_is_the_distance_of_periods_from_the_nominal_one():
    times_ns = np.array([0, 2 * MS, 5 * MS, 6 * MS], np.int64)
    assert wmx._off_ms(times_ns, 2.0 * MS) == [0.0, 1.0, 1.0]


def test_the_engine_notes_its_cycles_against_their_deadlines(monkeypatch: pytest.MonkeyPatch):
    config = engine_config()
    # A late begin is made up for; a cycle that ends late by more than a period leaves periods out.
    cycles_ms = [(10.0, 10.25), (12.25, 12.5), (12.5, 12.75), (13.0, 15.5), (15.5, 15.75), (16.0, 16.25)]
    with runtime_folder() as folder:
        drives = VirtualDrives(config.n_axes, config.cycle_time_s)
        server = wmx_engine.NotingServer(Engine(config, drives), folder)
        times = iter([time for cycle in cycles_ms for time in cycle])
        monkeypatch.setattr(wmx_engine.time, "monotonic_ns", lambda: round(next(times) * MS))
        for _ in cycles_ms:
            server.cycle()
        monkeypatch.undo()
        server.close()
    due_ms = (server.notes[: server.count, 0] / MS).tolist()
    assert due_ms == [10.0, 11.0, 12.0, 13.0, 15.0, 16.0]
    assert (server.notes[: server.count, 1] / MS).tolist() == [begin for begin, _ in cycles_ms]
