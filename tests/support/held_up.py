"""For how long the machine has held this process up: nobody who is late by as much was slow."""

from __future__ import annotations

import threading
import time
from types import TracebackType
from typing import Self

_LOOK_S = 0.005
# What the kernel's timers and Python's threads take at rest.
_USUAL_S = 0.01


class HeldUp:
    """``with HeldUp() as machine: ...; assert took_s - machine.seconds < limit``.

    Sums what a thread that sleeps all the time is woken late. The processes under test compete for the same processors,
    at the same priority or a higher one, so that as much is to be granted to them.
    """

    def __init__(self) -> None:
        self.seconds = self.longest_s = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look, name="held_up", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()

    def _look(self) -> None:
        before_s = time.monotonic()
        while not self._ended.wait(_LOOK_S):
            now_s = time.monotonic()
            late_s = now_s - before_s - _LOOK_S
            if late_s > _USUAL_S:
                self.seconds += late_s
                self.longest_s = max(self.longest_s, late_s)
            before_s = now_s
