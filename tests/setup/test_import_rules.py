"""The import rules of the architecture are effective: each forbidden import in a copy of the code breaks its rule."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINT = Path(sys.executable).with_name("lint-imports")
FORBIDDEN = {
    "a subsystem imports another": (
        "safety/intruder.py",
        "import robot_stack.mission.kernel",
        "Subsystems communicate",
    ),
    "core imports the engine": ("core/intruder.py", "import robot_stack.wmx", "Subsystems communicate"),
    "the stack imports the simulation": ("core/intruder.py", "import sim", "never imports the simulation"),
    "the stack imports the benchmarks": ("cli/intruder.py", "import tests.benchmarks", "imports the tests"),
    "the simulation imports the tests": ("../sim/intruder.py", "import tests.support", "imports the tests"),
    "a kernel imports rclpy": ("safety/intruder.py", "from rclpy.node import Node", "Only the ROS implementation"),
    "a kernel imports messages": ("safety/intruder.py", "import std_msgs.msg", "Only nodes and their base modules"),
    "a kernel imports the node base": (
        "safety/intruder.py",
        "import robot_stack.middleware.node",
        "Only nodes and tools",
    ),
    "a node imports rclpy": ("safety/nodes/intruder.py", "import rclpy", "Only the ROS implementation"),
    "a node imports the ROS implementation": (
        "safety/nodes/intruder.py",
        "import robot_stack.ros.executor",
        "Only tools, the command line",
    ),
    "a kernel reads the clock": ("safety/intruder.py", "import time", "Kernels read no clock"),
    "a driver imports the simulation": ("drivers/intruder.py", "import sim.lidar", "never imports the simulation"),
    "a driver's node imports the simulation": (
        "drivers/nodes/intruder.py",
        "import sim",
        "never imports the simulation",
    ),
    "a subsystem imports a driver": (
        "perception/intruder.py",
        "import robot_stack.drivers.counters",
        "Subsystems communicate",
    ),
    "a driver's kernel opens a port": ("drivers/intruder.py", "import serial", "Kernels read no clock"),
    "a driver's kernel opens a bus": ("drivers/intruder.py", "import can", "Kernels read no clock"),
    "a kernel logs": ("drive/intruder.py", "import logging", "Kernels read no clock"),
}


@pytest.fixture
def code(tmp_path: Path) -> Path:
    for package in ("robot_stack", "sim"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(code: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(code), "COLUMNS": "200"}
    return subprocess.run(
        [LINT, "--no-cache", "--no-logo"], cwd=code, env=environment, capture_output=True, text=True, check=False
    )


def test_each_forbidden_import_breaks_its_rule(code: Path) -> None:
    """All at once, each in a module of its own; the report of a rule names the modules that break it."""
    for number, (module, statement, _) in enumerate(FORBIDDEN.values()):
        (code / "robot_stack" / module.replace("intruder", f"intruder_{number}_")).write_text(f"{statement}\n")

    result = lint(code)

    assert result.returncode == 1, result.stdout + result.stderr
    _, *reports = re.split(r"\n(.+)\n-+\n", result.stdout.partition("Broken contracts")[2])
    found = dict(zip(reports[::2], reports[1::2], strict=True))
    for number, (breach, (*_, rule)) in enumerate(FORBIDDEN.items()):
        assert any(rule in name and f"intruder_{number}_" in text for name, text in found.items()), (breach, found)


def test_package_without_a_place_in_the_layers_is_refused(code: Path) -> None:
    (code / "robot_stack/helpers").mkdir()
    (code / "robot_stack/helpers/__init__.py").touch()

    assert "robot_stack.helpers" in lint(code).stdout
