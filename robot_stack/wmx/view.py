"""Polls the motion engine in a dedicated thread, because opening a device or a call may block while an engine starts or
hangs, and no executor may wait for this.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

from robot_stack.core.pauses import PauseBudget
from robot_stack.wmx import MotionEngine, connect
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.session import EngineSession, Patience

# After a pause a process runs its threads in any order: for this time the executor lets this one go first.
_CATCH_UP_S = 0.005
# If a thread did not run for this long, it was paused, perhaps with the whole machine: the engine's status is then as
# old as the pause, until the engine has run again. The engine gets this time before it counts as silent.
_HELD_UP_S = 0.03
_PATIENCE_S = 0.05
# Retry period of a device that cannot be opened or read: no call is made that could show whether it is lost.
RETRY_S = 0.2
PATIENCE = Patience(retry_s=RETRY_S, attempts=5, attempt_pause_s=RETRY_S, probe_period_s=math.inf)


class EngineView:
    """Calls ``on_status`` at ``poll_hz`` in its thread: the present status, or None without a valid one.

    ``engine`` is for calls from within ``on_status``; the device belongs to that thread.
    """

    def __init__(self, name: str, poll_hz: float, on_status: Callable[[StatusSnapshot | None], None]) -> None:
        self._period_s = 1.0 / poll_hz
        self._on_status = on_status
        self._session = EngineSession(lambda: connect(name, timeout_s=0.0), PATIENCE)
        self._read_at_s = -math.inf
        self._ended = self._awaited = False
        self._polled = threading.Event()
        self._polled_at_s = -math.inf
        self._thread = threading.Thread(target=self._follow, name=f"{name} engine view", daemon=True)

    @property
    def engine(self) -> MotionEngine | None:
        """The open device, None while there is none."""
        return self._session.engine

    def start(self) -> None:
        self._thread.start()

    def catch_up(self) -> None:
        """Lets the thread read the status if it is behind: its delay must not count as the engine's."""
        if time.monotonic() - self._polled_at_s > 2.0 * self._period_s:
            self._polled.clear()
            self._awaited = True
            self._polled.wait(_CATCH_UP_S)
            self._awaited = False

    def close(self) -> None:
        """Ends the thread and closes the device."""
        self._ended = True
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)

    def _follow(self) -> None:
        due_s = before_s = patient_until_s = time.monotonic()
        pauses = PauseBudget(due_s)
        while not self._ended:
            now_s = time.monotonic()
            late_s, before_s = now_s - before_s - self._period_s, now_s
            if late_s > _HELD_UP_S:
                patience_s = min(late_s, _PATIENCE_S)
                # No partial excuse: it would outlast the next reading, and repeated pauses would excuse the engine.
                if pauses.excuse(late_s, now_s) >= patience_s:
                    patient_until_s = now_s + patience_s
            status = self._read()
            if status is not None or now_s >= patient_until_s:
                self._on_status(status)
            self._polled_at_s = time.monotonic()
            if self._awaited:
                self._polled.set()
            if self._session.engine is None and self._session.connect(self._polled_at_s):
                self._read_at_s = time.monotonic()
            due_s = max(due_s + self._period_s, time.monotonic())
            # Not an event with a timeout, which costs twice as much: the end waits at most one period.
            time.sleep(max(0.0, due_s - time.monotonic()))
        self._session.close()

    def _read(self) -> StatusSnapshot | None:
        snapshot = self._session.read()
        now_s = time.monotonic()
        if snapshot is not None:
            self._read_at_s = now_s
        elif now_s >= self._read_at_s + RETRY_S:
            self._session.close()
        return snapshot
