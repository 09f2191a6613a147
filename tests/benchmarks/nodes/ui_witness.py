"""Detects the engine's stop."""

from __future__ import annotations

import time

from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.view import EngineView

_POLL_HZ = 1000.0


class UiWitness:
    """A context manager.

    stopped_s: system time at which the engine's emergency stop was first seen since ``watch``.
    """

    def __init__(self) -> None:
        self.stopped_s: float | None = None
        self.engine_stopped = False
        self._view = EngineView("ui_bench", _POLL_HZ, self._on_status)

    def __enter__(self) -> UiWitness:
        self._view.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._view.close()

    def watch(self) -> None:
        """Begins to measure the next stop."""
        self.stopped_s = None

    def _on_status(self, status: StatusSnapshot | None) -> None:
        if status is None:
            return
        if status.emergency_stop and not self.engine_stopped and self.stopped_s is None:
            self.stopped_s = time.time()
        self.engine_stopped = status.emergency_stop
