"""The perception node as a process: a parameter that it refuses. What it publishes when: tests/simulated/nodes."""

from __future__ import annotations

from collections.abc import Callable

from tests.support.processes import NodeProcess


def test_an_illegal_parameter_stops_the_start(start: Callable[..., NodeProcess]) -> None:
    process = start("perception_pipeline", "-p", "crop.range_min_m:=100.0")
    assert process.wait() == 2
    assert "range_min_m must be smaller than range_max_m" in process.output()
