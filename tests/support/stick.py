"""A simulated teleoperation stick that runs on the world's clock."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from robot_stack.core.node_record import NodeRecord
from robot_stack.core.world_clock import WorldClock

PERIOD_S = 0.05
_LOOK_S = 0.002


class Stick:
    """Calls ``publish`` at 20 Hz while it is held.

    A world that waits for its robot also waits for the stick, so that a short delay of the test on a busy machine does
    not count as a release.
    """

    def __init__(self) -> None:
        clock = WorldClock.find()
        assert clock is not None, "no simulated world runs here"
        self._clock = clock
        self._record = NodeRecord("stick")
        self._record.constructing("a test")
        self._publish: Callable[[], None] | None = None
        self._published_s = -math.inf
        self._changed = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="stick", daemon=True)
        self._thread.start()

    def hold(self, publish: Callable[[], None]) -> None:
        """Publishes from now on, until ``let_go``; replaces the previous function."""
        self._set(publish)

    def let_go(self) -> None:
        """After this returns, nothing is published."""
        self._set(None)

    @property
    def idle_s(self) -> float:
        """Time since the last message, on the world's clock; 0 while the stick is held."""
        return 0.0 if self._publish is not None else self._clock.now_s() - self._published_s

    @contextmanager
    def held_up(self) -> Iterator[None]:
        """Blocks the stick, like a process without CPU time."""
        with self._changed:
            yield

    def close(self) -> None:
        with self._changed:
            self._publish, self._ended = None, True
            self._changed.notify()
        self._thread.join()
        self._record.due(math.inf)
        self._record.close()

    def _set(self, publish: Callable[[], None] | None) -> None:
        with self._changed:
            self._publish = publish
            self._changed.notify()

    def _run(self) -> None:
        due_s = -math.inf
        while True:
            with self._changed:
                while self._publish is None and not self._ended:
                    self._record.due(math.inf)
                    self._changed.wait()
                    due_s = -math.inf
                if self._ended:
                    return
                now_s = self._clock.now_s()
                if now_s >= due_s:
                    assert self._publish is not None
                    self._publish()
                    self._published_s = now_s
                    due_s = now_s + PERIOD_S
                    self._record.due(due_s)
            time.sleep(_LOOK_S)
