"""A simulated motion engine in the process of the test: a call acts at once, the test cycles the engine."""

from __future__ import annotations

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.config import EngineConfig, load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from robot_stack.wmx.simulated.library import library_of
from sim.plant.local_engine import LocalDevice


def new_engine(config: EngineConfig | None = None) -> Engine:
    """An engine on virtual drives, all contacts closed; by default the robot's, with the vendor's parameters."""
    config = config or load_engine_config()
    drives = VirtualDrives(config.n_axes, config.cycle_time_s)
    drives.inputs = dict.fromkeys(range(config.n_input_bytes), 0xFF)
    return Engine(config, drives)


def new_device(engine: Engine | None = None) -> MotionEngine:
    """A device on ``engine``, by default on a new one."""
    device = LocalDevice(engine or new_engine())
    library = library_of(lambda: device)
    api = library.WMX3Api()
    assert api.CreateDevice("", 0, 0) == 0
    return MotionEngine(library, api)
