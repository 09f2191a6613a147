"""The simulated engine with a note of when each of its cycles began: ``wmx_engine NOTES.npy [sleep]``.

sleep: it waits by sleeping, regardless of its configuration.

Notes are pairs of monotonic times in nanoseconds: when the cycle was due, and when it began.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.engine_server import __main__ as process
from robot_stack.wmx.engine_server.server import EngineServer

_LONGEST_S = 300.0


class NotingServer(EngineServer):
    """``cycle_log[:count]``: (n, 2), see the module."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.cycle_log = np.zeros((round(_LONGEST_S / self.engine.config.cycle_time_s), 2), np.int64)
        self.count = 0

    def cycle(self) -> None:
        if self.count < len(self.cycle_log):
            self.cycle_log[self.count] = self.due_ns, time.monotonic_ns()
            self.count += 1
        super().cycle()


def main() -> None:
    cycle_log = Path(sys.argv[1])
    servers: list[NotingServer] = []

    def server(*arguments: Any) -> NotingServer:
        servers.append(NotingServer(*arguments))
        return servers[-1]

    vars(process)["EngineServer"] = server
    config = load_engine_config()
    if "sleep" in sys.argv[2:]:
        config = config.model_copy(update={"server": config.server.model_copy(update={"spin": None})})
    process.run_engine(config, runtime_dir())
    np.save(cycle_log, servers[0].cycle_log[: servers[0].count])


if __name__ == "__main__":
    main()
