"""A scenario of the whole stack through the scenario runner: its events happen, its figures and pictures are there."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.processes import ROOT

pytestmark = pytest.mark.timeout(900)

SCENARIO = """
description: Half a metre per second by hand, an emergency stop, the release, the stick let go, and on.
kind: stack
world: flat
seed: 3
speed: 0.8
settings: [lidar_driver.columns=400, perception_pipeline.watch.points_min=2500]
limit_s: 14
twists:
  - {at_s: 0.5, vx_mps: 0.5}
  - {at_s: 8.0, vx_mps: 0.0}
  - {at_s: 8.5, vx_mps: 0.5}
events:
  - {at_s: 4.0, estop: true}
  - {at_s: 6.0, estop: false}
  - {at_s: 7.0, reset: true}
  - {at_s: 9.0, fault: imu_silent, duration_s: 1.0}
expect:
  - {figure: distance_m, above: 2.0}
  - {figure: stop_distance_m, below: 0.30}
  - {figure: estimate_error_final_m, below: 0.10}
  - {figure: final_safety_state, equals: NORMAL}
  - {figure: emergency_stop, equals: false}
"""


def test_a_stack_scenario_runs_and_leaves_its_folder(ros_domain: int, tmp_path: Path) -> None:
    file = tmp_path / "hand_drive.yaml"
    file.write_text(SCENARIO)
    command = [sys.executable, "-m", "sim.run.runner", str(file), "--output", str(tmp_path / "results")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=200)
    assert done.returncode == 0, done.stdout + done.stderr
    folder = tmp_path / "results" / "hand_drive-latest"
    result = json.loads((folder / "figures.json").read_text())
    assert result["problems"] == []
    states = result["figures"]["safety_states"]
    assert "EMERGENCY_STOP (ESTOP_PRESSED)" in states
    assert "DEGRADED (IMU_TIMEOUT)" in states
    for name in ("path.png", "speed.png", "wheels.png", "safety.png", "scenario.yaml", "log.txt"):
        assert (folder / name).stat().st_size > 100
    assert (folder / "logs" / "latest" / "sim_world.log").is_file()
    assert "reset granted" in (folder / "log.txt").read_text()
