"""The figures of the joint state benchmark."""

from __future__ import annotations

import numpy as np

from robot_stack.core.pacing import SpinLimits
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from tests.benchmarks import wmx
from tests.benchmarks.support import wmx_engine
from tests.unit.wmx.harness import engine_config, runtime_folder

MS = 1_000_000


def test_jitter_is_the_distance_of_periods_from_the_nominal_one():
    times_ns = np.array([0, 2 * MS, 5 * MS, 6 * MS], np.int64)
    assert wmx._off_ms(times_ns, 2.0 * MS) == [0.0, 1.0, 1.0]


def test_an_engine_that_waits_awake_begins_no_cycle_early_and_notes_its_cycles():
    spin = SpinLimits(longest_s=0.0005, share=0.5, tolerance_s=0.0, on_time=0.9)
    config = engine_config()
    config = config.model_copy(update={"server": config.server.model_copy(update={"spin": spin})})
    with runtime_folder() as folder:
        server = wmx_engine.NotingServer(Engine(config, VirtualDrives(config.n_axes, config.cycle_time_s)), folder)
        server.serve_forever(lambda: server.count >= 100)
        server.close()
    due_ns, began_ns = server.cycle_log[: server.count].T
    assert (began_ns >= due_ns).all()
    assert (np.diff(due_ns) > 0).all()
    assert (np.diff(due_ns) % round(1e9 * config.cycle_time_s) == 0).all()
