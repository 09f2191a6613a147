"""The simulated engine as a process: ``python -m robot_stack.wmx.engine_server``, on drives without physics."""

from __future__ import annotations

import argparse
import gc
import signal
import sys
from pathlib import Path

from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import AlreadyRunning, runtime_dir
from robot_stack.wmx.config import EngineConfig, load_engine_config, read_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.server import EngineServer
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives


def run_engine(config: EngineConfig, folder: Path, speed: float = 1.0) -> None:
    """Serves an engine on virtual drives until SIGINT or SIGTERM; axes are stopped first. Raises AlreadyRunning."""
    asked_to_end = False

    def end(*_: object) -> None:
        nonlocal asked_to_end
        asked_to_end = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    engine = _engine(config)
    server = EngineServer(engine, folder)
    gc.collect()
    gc.freeze()  # present objects stay: exclude them from garbage collection during cycles
    server.serve_forever(lambda: asked_to_end, speed)
    server.shut_down()


def _engine(config: EngineConfig) -> Engine:
    drives = VirtualDrives(config.n_axes, config.cycle_time_s)
    signal = config.estop_signal
    if (
        signal is None
    ):  # nothing is wired to virtual drives: a client's signal may be any input, all are normally closed
        drives.inputs = dict.fromkeys(range(config.n_input_bytes), 0xFF)
    elif not signal.active:
        drives.inputs = {signal.byte: 1 << signal.bit}
    return Engine(config, drives)


def main() -> int:
    parser = argparse.ArgumentParser(description="Simulated motion engine on drives without physics.")
    parser.add_argument("--config", type=Path, help="engine configuration; default config/wmx_engine.yaml")
    parser.add_argument("--runtime-dir", type=Path, help="folder of socket and status; default the stack's own")
    parser.add_argument("--speed", type=float, default=1.0, help="engine time per real time, for tests")
    parser.add_argument("--compile", action="store_true", help="only compile the cycle for later starts, and end")
    arguments = parser.parse_args()
    if not 0.0 < arguments.speed <= 1000.0:
        parser.error(f"--speed must be in (0, 1000], is {arguments.speed}")
    try:
        config = load_engine_config() if arguments.config is None else _read(arguments.config)
        if arguments.compile:
            _engine(config)
            return 0
        run_engine(config, arguments.runtime_dir or runtime_dir(), arguments.speed)
    except (ConfigError, AlreadyRunning, OSError) as error:
        print(f"engine: {error}", file=sys.stderr)
        return 1
    return 0


def _read(path: Path) -> EngineConfig:
    return read_engine_config(path)


if __name__ == "__main__":
    sys.exit(main())
