"""A stand-in for a ROS installation that a shell has sourced."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path


def source(folder: Path, environment: Mapping[str, str]) -> dict[str, str]:
    """Creates the installation; returns the environment after sourcing it. Neither rclpy nor librcl can be loaded."""
    site = folder / f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
    (site / "rclpy").mkdir(parents=True)
    (site / "rclpy/__init__.py").write_text('raise ImportError("the stand-in\'s rclpy")\n')
    (folder / "lib/librcl.so").write_text("no library")
    index = folder / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (index / "rclpy").touch()
    additions = {"AMENT_PREFIX_PATH": folder, "PYTHONPATH": site, "LD_LIBRARY_PATH": folder / "lib"}
    hidden = {*additions, "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}  # also of the wheels' own hook: not in a fresh shell
    shell = {name: value for name, value in environment.items() if name not in hidden}
    return {**shell, **{name: str(entry) for name, entry in additions.items()}}
