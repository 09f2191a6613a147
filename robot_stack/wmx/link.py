"""A node's link to the motion engine: found, kept alive, lost and found again, without ever waiting.

Requests are asked for by name. The reason of a refused one is kept under its name until it succeeds.
"""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.wmx import EngineError, MotionEngine
from robot_stack.wmx.api import ErrorCode, error_name
from robot_stack.wmx.axes import StatusSnapshot

# An engine that is not there yet is waited for; it refuses nothing.
_ABSENT = (ErrorCode.IMLibIsNotRunning, ErrorCode.EngineNotStartedInSpecifiedTime, ErrorCode.CreateDeviceLockError)
# After these the device is worthless: the engine has ended, or was stopped by somebody.
_LOST = (ErrorCode.IMLibIsNotRunning, ErrorCode.DeviceIsNull, ErrorCode.APIChannelError)
_WAITING = "waiting for the motion engine"
_HUNG_PAUSE_S = 3.0
_STATUS, _WATCHDOG = "engine status", "engine watchdog"


class EngineLink:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(
        self, open_engine: Callable[[], MotionEngine], *, retry_s: float, feed_period_s: float, watchdog_s: float
    ) -> None:
        """open_engine: opens a device without waiting, raises EngineError. retry_s: between looks for an engine.
        watchdog_s: the engine stops the axes of a link that was not polled for so long; 0 for one that moves nothing.
        """
        self._open_engine = open_engine
        self._retry_s = retry_s
        self._feed_period_s = feed_period_s
        self._watchdog_s = watchdog_s
        self._pauses: dict[str, tuple[float, float]] = {}
        self._refusals: dict[str, str] = {}
        self.engine: MotionEngine | None = None
        self.connections = 0
        self.text = _WAITING

    def poll(self, now_s: float) -> bool:
        """Looks for an engine, or tells the one there is that this client lives. True while there is one."""
        if self.engine is None:
            return self._connect(now_s)
        if self._watchdog_s and self.due(_WATCHDOG, now_s, self._feed_period_s):
            fed = self.ask(_WATCHDOG, lambda engine: engine.api.ResetWatchdogTimer())
            if not fed:  # an engine that hangs holds every call up: do not spend all time on it
                self._pauses[_WATCHDOG] = now_s, now_s + _HUNG_PAUSE_S
        return self.engine is not None

    def _connect(self, now_s: float) -> bool:
        if not self.due("connect", now_s, self._retry_s):
            return False
        try:
            self.engine = self._open_engine()
        except EngineError as error:
            self.text = _WAITING if error.code in _ABSENT else str(error)
            return False
        self.connections += 1
        self.text = "connected"
        self._pauses.clear()  # what was asked of an engine before this one does not count
        self._refusals.clear()
        milliseconds = round(1e3 * self._watchdog_s)
        return not milliseconds or self.ask(_WATCHDOG, lambda engine: engine.api.SetWatchdog(milliseconds))

    def read(self) -> StatusSnapshot | None:
        """The status at this moment, None if it cannot be trusted."""
        if self.engine is None:
            return None
        code, snapshot = self.engine.read_status()
        return snapshot if self._heed(_STATUS, code) else None

    def ask(self, what: str, request: Callable[[MotionEngine], int]) -> bool:
        """One request to the engine; False if there is none, or if it refused, see ``refusal``."""
        return self.engine is not None and self._heed(what, request(self.engine))

    def refusal(self, what: str, otherwise: str) -> str:
        """Why the last request of this name was refused, ``otherwise`` if it was not."""
        return self._refusals.get(what, otherwise)

    @property
    def problem(self) -> str:
        """Why there is no status."""
        return self.refusal(_STATUS, self.text)

    def due(self, what: str, now_s: float, pause_s: float) -> bool:
        """True once, then not before ``pause_s`` have passed. Time that ran back makes everything due."""
        asked_s, due_s = self._pauses.get(what, (now_s, now_s))
        if asked_s <= now_s < due_s:
            return False
        self._pauses[what] = now_s, now_s + pause_s
        return True

    def close(self) -> None:
        """Gives the device back; the engine stops what it moved."""
        if self.engine is not None:
            engine, self.engine = self.engine, None
            engine.close()

    def _heed(self, what: str, code: int) -> bool:
        if not code:
            self._refusals.pop(what, None)
            return True
        self._refusals[what] = f"{what}: {error_name(code)} (error {code})"
        if code in _LOST:
            self.text = "the motion engine has ended"
            self._refusals.clear()
            self.close()
        return False
