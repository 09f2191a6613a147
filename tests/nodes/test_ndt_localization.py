"""The localization node as a process: maps and parameters that it refuses. How it localizes: tests/simulated/nodes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from robot_stack.core.site_map import Grid, SiteMap, save_map
from tests.support.processes import NodeProcess
from tests.unit.localization.courtyard import cells

Start = Callable[..., NodeProcess]


def test_illegal_parameter_stops_the_start(start: Start) -> None:
    process = start("ndt_localization", "-p", "quality.odometry_silent_s:=0.05")
    assert process.wait() == 2
    assert "odometry_fresh_s must be smaller than odometry_silent_s" in process.output()


def test_a_map_is_loaded_and_one_that_is_missing_or_damaged_stops_the_start(start: Start, tmp_path: Path) -> None:
    folder = tmp_path / "courtyard"
    save_map(SiteMap("courtyard", cells(), Grid(1.0, -8.0, -6.0, np.zeros((14, 20), np.int8))), folder)
    node = start("ndt_localization", "-p", f"map:={folder}")
    node.wait_output("cells of 0.5 m")
    node.stop()
    assert node.process.returncode == 0
    missing = start("ndt_localization", "-p", "map:=nowhere")
    assert missing.wait() == 2
    assert "no map 'nowhere'" in missing.output()
    (folder / "grid.pgm").write_bytes(b"P5\n1 1\n255\n0")
    damaged = start("ndt_localization", "-p", f"map:={folder}")
    assert damaged.wait() == 2
    assert "grid.pgm is missing or is not the file" in damaged.output()
