"""Compiles or loads the kernels of the engine's cycle."""

from __future__ import annotations

from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives


def warm_up() -> None:
    """Creates an engine, whose constructor runs all compiled code."""
    config = load_engine_config()
    Engine(config, VirtualDrives(config.n_axes, config.cycle_time_s))
