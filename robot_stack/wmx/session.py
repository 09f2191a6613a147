"""A client's session with the motion engine, shared by all clients: connects, monitors, and reconnects after a loss.

Requests have a name; the reason of a rejected one is kept under its name until it succeeds. Nothing here
blocks except the opening of a device, which may take seconds in the vendor's library: without its own thread, a client
uses the session's. The requests to a new device, and their order, are the steps of ``start_up``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar

from robot_stack.wmx import EngineError, MotionEngine
from robot_stack.wmx.api import AxisCommandMode, AxisSelection, ErrorCode, error_name
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.device_opener import DeviceOpener, OpenEngine, PromptOpener
from robot_stack.wmx.failures import ABSENT, LOST

_WAITING: Final = "waiting for the motion engine"
_ENDED: Final = "the motion engine has ended"
_CONNECT, _STATUS, _PROBE, _COMMUNICATION = "connect", "engine status", "engine's answer", "starting communication"
_HUNG_PAUSE_S: Final = 3.0

SetPointsT = TypeVar("SetPointsT")


@dataclass(frozen=True, slots=True)
class Patience:
    """retry_s: between attempts while no engine runs. attempts, attempt_pause_s: of opening a device that the
    engine rejects; reported after that many, retries continue. probe_period_s: period of probing the engine:
    the status of a dead one only ages. waited_for: the codes of an engine that does not run. probe_always: False probes
    only while the status is invalid, for a thread that must not wait for round trips.
    """

    retry_s: float
    attempts: int
    attempt_pause_s: float
    probe_period_s: float
    waited_for: frozenset[ErrorCode] = ABSENT
    probe_always: bool = True


def _nothing(*_: Any) -> None:
    """Default callback."""


@dataclass(frozen=True, slots=True)
class Events:
    """Callbacks on changes of the device. refused: with the number of consecutive failures, this one included."""

    opened: Callable[[MotionEngine], None] = _nothing
    refused: Callable[[EngineError, int], None] = _nothing
    lost: Callable[[], None] = _nothing


class Log(Protocol):
    def info(self, text: str, /) -> object: ...
    def warning(self, text: str, /) -> object: ...
    def error(self, text: str, /) -> object: ...


class Applied(NamedTuple, Generic[SetPointsT]):
    """The set points that the engine has accepted, None for none; and why not all of them, else empty."""

    set_points: SetPointsT | None
    problem: str = ""


class EngineSession:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(
        self,
        open_engine: OpenEngine,
        patience: Patience,
        events: Events | None = None,
        *,
        opener: Callable[[OpenEngine], DeviceOpener] = PromptOpener,
    ) -> None:
        """opener: opens a device; an executor's tick must not wait for one (``ThreadedOpener``)."""
        self._opener = opener(open_engine)
        self._patience = patience
        self._events = events or Events()
        self._failures = 0
        self._pauses: dict[str, tuple[float, float]] = {}
        self._refusals: dict[str, str] = {}
        self.engine: MotionEngine | None = None
        self.connections = 0
        self.started_communication = False
        self.text = _WAITING

    # --- the device --------------------------------------------------------------------------------------------------

    def poll(self, now_s: float) -> bool:
        """Searches for an engine, or probes the present one. True while there is one."""
        return self.connect(now_s) if self.engine is None else self.probe(now_s)

    def connect(self, now_s: float) -> bool:
        """Opens a device if there is none and a retry is due. True if there is one."""
        if self.engine is not None:
            return True
        if not self.due(_CONNECT, now_s, self._patience.retry_s) and not self._opener.under_way:
            return False
        before, error = self.connections, self.open()
        if error is not None:
            self._refuse(error, now_s)
        connected = self.connections != before
        if connected:
            self._pause(_PROBE, now_s, self._patience.probe_period_s)
        return connected

    def open(self) -> EngineError | None:
        """Tries to open a device now. Returns the reason of a failure; None if it is open or the thread is busy."""
        try:
            engine = self._opener()
        except EngineError as error:
            return error
        if engine is not None:
            self.engine = engine
            self.connections += 1
            self._failures, self.text, self.started_communication = 0, "connected", False
            self._pauses.clear()  # requests to an earlier engine are irrelevant
            self._refusals.clear()
            self._events.opened(engine)
        return None

    def _refuse(self, error: EngineError, now_s: float) -> None:
        if error.code in self._patience.waited_for:
            self.text = _WAITING
            return
        self._failures += 1
        self._pause(_CONNECT, now_s, self._patience.attempt_pause_s)
        attempts = self._patience.attempts
        if self._failures < attempts:
            self.text = f"attempt {self._failures} of {attempts}: {error}"
        else:
            self.text = f"{self._failures} attempts failed, still trying: {error}"
        self._events.refused(error, self._failures)

    def probe(self, now_s: float) -> bool:
        """Probes the engine at intervals. False once it is gone."""
        wanted = self._patience.probe_always or _STATUS in self._refusals
        if wanted and self.due(_PROBE, now_s, self._patience.probe_period_s):
            answered = self.ask(_PROBE, lambda engine: engine.api.GetDeviceName()[0])
            if not answered:  # a hanging engine delays every call: limit the time spent on it
                self._pause(_PROBE, now_s, _HUNG_PAUSE_S)
        return self.engine is not None

    def close(self) -> int:
        """Closes the device; returns the engine's code. Motion that it started continues: stop it before."""
        self._opener.abandon()
        if self.engine is None:
            return ErrorCode.DeviceIsNull
        engine, self.engine = self.engine, None
        return engine.close()

    # --- requests ----------------------------------------------------------------------------------------------------

    def read(self) -> StatusSnapshot | None:
        """The status at this moment, None if it is invalid."""
        return self.status()[1]

    def status(self) -> tuple[int, StatusSnapshot | None]:
        """(0, the status at this moment), or (the error code, None)."""
        if self.engine is None:
            return ErrorCode.DeviceIsNull, None
        code, snapshot = self.engine.read_status()
        return code, snapshot if self._succeeded(_STATUS, code) else None

    def call(self, request: Callable[[MotionEngine], int]) -> int:
        """The engine's code; DeviceIsNull without a device."""
        return ErrorCode.DeviceIsNull if self.engine is None else self.check_code(int(request(self.engine)))

    def ask(self, what: str, request: Callable[[MotionEngine], int]) -> bool:
        """Sends one request to the engine; False without an engine, or if it was rejected, see ``refusal``."""
        return self.engine is not None and self._succeeded(what, request(self.engine))

    def refusal(self, what: str, otherwise: str) -> str:
        """The reason if the last request of this name was rejected, else ``otherwise``."""
        return self._refusals.get(what, otherwise)

    @property
    def problem(self) -> str:
        """The reason if there is no status."""
        return self.refusal(_STATUS, self.text)

    def start_communication(self, now_s: float, pause_s: float, otherwise: str) -> str:
        """Requests the bus. Returns the reason of a rejection, else ``otherwise``.

        pause_s: repetition period of an accepted request, in which the bus may start; a rejected one is repeated like
        the opening of a device if that is sooner.
        """
        if self.due(_COMMUNICATION, now_s, pause_s):
            if self.ask(_COMMUNICATION, lambda engine: engine.api.StartCommunication(0)):
                self.started_communication = True
            else:
                self._pause(_COMMUNICATION, now_s, min(pause_s, self._patience.attempt_pause_s))
        return self.refusal(_COMMUNICATION, otherwise)

    def stop(self, axes: Sequence[int], snapshot: StatusSnapshot, *, quick: bool = False) -> dict[int, int]:
        """Stops axes, one call for each kind. Returns the code per axis; a refused group is retried axis by axis."""
        codes: dict[int, int] = {}
        for velocity in (False, True):
            group = [a for a in axes if (snapshot.command_mode[a] == AxisCommandMode.Velocity) == velocity]
            if not group:
                continue
            code = self._stop(group, velocity, quick)
            alone = bool(code) and len(group) > 1
            codes |= {axis: self._stop([axis], velocity, quick) if alone else code for axis in group}
        return codes

    def _stop(self, axes: Sequence[int], velocity: bool, quick: bool) -> int:
        selection = AxisSelection.of(*axes)

        def request(engine: MotionEngine) -> int:
            family = engine.core_motion.velocity if velocity else engine.core_motion.motion
            return family.ExecQuickStop_AxisSel(selection) if quick else family.Stop_AxisSel(selection)

        return self.call(request)

    def due(self, what: str, now_s: float, pause_s: float) -> bool:
        """True once, then not before ``pause_s`` have passed. If the clock goes back, everything is due."""
        asked_s, due_s = self._pauses.get(what, (now_s, now_s))
        if asked_s <= now_s < due_s:
            return False
        self._pause(what, now_s, pause_s)
        return True

    def check_code(self, code: int) -> int:
        """Handles the code's effect on the device and returns it."""
        if code in LOST and self.engine is not None:
            self.text = _ENDED
            self._refusals.clear()
            self.close()
            self._events.lost()
        return code

    def _pause(self, what: str, now_s: float, pause_s: float) -> None:
        self._pauses[what] = now_s, now_s + pause_s

    def _succeeded(self, what: str, code: int) -> bool:
        if code:
            self._refusals[what] = f"{what}: {error_name(code)} (error {code})"
            self.check_code(code)
        else:
            self._refusals.pop(what, None)
        return not code
