"""A simulated motion engine on drives without physics; a test sets inputs and faults in a file.

Usage: engine_process.py CONTROL_FILE. The file holds JSON with optional keys: ``input0``, ``input1`` (bytes 0 and
1 of the inputs; by default the button is released and the safety edge is free),
``alarms`` (axis -> code; an alarm stays until it is cleared), ``connected`` (the bus). Each cycle reads the file if it
exists; it may be replaced at any time.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.server import EngineServer
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives


class Control:
    """Applies the file's commands to the drives. Called once per cycle; returns True to end the process."""

    def __init__(self, path: Path, drives: VirtualDrives) -> None:
        self._path, self._drives = path, drives
        self._seen = -1
        self.end = False
        self._apply({})
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def __call__(self) -> bool:
        try:
            changed = os.stat(self._path).st_mtime_ns
        except FileNotFoundError:
            return self.end
        if changed != self._seen:
            self._seen = changed
            self._apply(json.loads(self._path.read_text()))
        return self.end

    def _apply(self, requested: dict[str, Any]) -> None:
        alarms = requested.get("alarms", {})
        self._drives.inputs = {0: requested.get("input0", 1), 1: requested.get("input1", 0xFF)}
        self._drives.connected = requested.get("connected", True)
        self._drives.stubborn = bool(alarms)
        for axis, code in alarms.items():
            self._drives.alarms[int(axis)] = code

    def _on_signal(self, *_: object) -> None:
        self.end = True


def main() -> None:
    config = load_engine_config()
    drives = VirtualDrives(config.n_axes, config.cycle_time_s)
    server = EngineServer(Engine(config, drives), runtime_dir())
    control = Control(Path(sys.argv[1]), drives)
    server.serve_forever(control, 1.0)
    server.shut_down()


if __name__ == "__main__":
    main()
