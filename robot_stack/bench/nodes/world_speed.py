"""How fast the simulated world runs: engine cycles, which are steps of its physics, over real time."""

from __future__ import annotations

import time
from collections.abc import Callable

from robot_stack.bench.framework import BenchError
from robot_stack.wmx import EngineError, connect


def world_speed() -> Callable[[], float]:
    """Begins to measure; the returned function ends it and gives simulated over real time."""
    begun = _engine_time_s()

    def end() -> float:
        engine_s, real_s = _engine_time_s()
        return (engine_s - begun[0]) / (real_s - begun[1])

    return end


def _engine_time_s() -> tuple[float, float]:
    try:
        with connect("bench", timeout_s=2.0) as engine:
            code, status = engine.read_status()
            now_s = time.monotonic()
    except EngineError as error:
        raise BenchError(str(error)) from error
    if code:
        raise BenchError(f"the engine's status cannot be read: error {code}")
    return status.engine_time_s, now_s
