"""Opens devices: in the call, or in a thread, because the vendor's library may take seconds."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol

from robot_stack.wmx import MotionEngine

OpenEngine = Callable[[], MotionEngine]
"""Opens a device after a short wait at most. Raises EngineError."""


class DeviceOpener(Protocol):
    """Opens one device at a time."""

    @property
    def under_way(self) -> bool: ...

    def __call__(self) -> MotionEngine | None:
        """The device once it is open, None before. Raises the exception of its opening."""
        ...

    def abandon(self) -> None:
        """Closes a device that opens too late."""
        ...


class PromptOpener:
    """Opens the device in the call."""

    under_way = False

    def __init__(self, open_engine: OpenEngine) -> None:
        self._open_engine = open_engine

    def __call__(self) -> MotionEngine | None:
        return self._open_engine()

    def abandon(self) -> None:
        """Does nothing, because no opening is pending."""


class ThreadedOpener:
    """Opens one device at a time. Belongs to one thread itself."""

    def __init__(self, open_engine: OpenEngine) -> None:
        self._open_engine = open_engine
        self._attempt: _Attempt | None = None

    @property
    def under_way(self) -> bool:
        return self._attempt is not None

    def __call__(self) -> MotionEngine | None:
        """The device once it is open, None before. Raises the exception of its opening."""
        if self._attempt is None:
            self._attempt = _Attempt(self._open_engine)
        if not self._attempt.ended.is_set():
            return None
        attempt, self._attempt = self._attempt, None
        return attempt.result()

    def abandon(self) -> None:
        """Closes a device that opens too late."""
        attempt, self._attempt = self._attempt, None
        if attempt is not None:
            attempt.abandon()


class _Attempt:
    def __init__(self, open_engine: OpenEngine) -> None:
        self.ended = threading.Event()
        self._open_engine = open_engine
        self._turn = threading.Lock()
        self._abandoned = False
        self._engine: MotionEngine | None = None
        self._error: BaseException | None = None
        threading.Thread(target=self._run, name="engine opening", daemon=True).start()

    def result(self) -> MotionEngine | None:
        if self._error is not None:
            raise self._error
        return self._engine

    def abandon(self) -> None:
        with self._turn:
            self._abandoned = True
            engine, self._engine = self._engine, None
        if engine is not None:
            engine.close()

    def _run(self) -> None:
        engine: MotionEngine | None = None
        try:
            engine = self._open_engine()
        except BaseException as error:
            self._error = error
        with self._turn:
            if not self._abandoned:
                self._engine, engine = engine, None
        if engine is not None:
            engine.close()
        self.ended.set()
