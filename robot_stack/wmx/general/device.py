"""The node's device on the engine: opened, reopened after a loss; and the axes that it has set in motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from robot_stack.wmx import EngineError, MotionEngine
from robot_stack.wmx.api import (
    CoreMotionErrorCode,
    ErrorCode,
    OperationState,
    error_text,
)
from robot_stack.wmx.axes import Flag, StatusSnapshot
from robot_stack.wmx.failures import BUSY
from robot_stack.wmx.session import EngineSession, Events, Log, Patience

OpenEngine = Callable[[str | None, str], MotionEngine]
"""(path or None for the configured one, device name) -> an open device, without waiting. Raises EngineError."""

# A command shows in the status in the next cycle; one more, because the status may be from the cycle before.
SETTLED_CYCLES: Final = 2

# The installation roots of the documents: they mean the engine of this machine.
_INSTALLATION_ROOTS: Final = ("", "/opt/lmx", "/opt/wmx3")


class Device:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(
        self, name: str, open_engine: OpenEngine, log: Log, attempts: int, retry_s: float, probe_period_s: float
    ) -> None:
        """attempts, retry_s, probe_period_s: see ``Patience``; any rejection of a device counts as an attempt."""
        self.wanted = True
        self.name = name
        self.path: str | None = None
        self.started_communication = False
        self._session = EngineSession(
            lambda: open_engine(self.path, self.name),
            Patience(retry_s, attempts, retry_s, probe_period_s, waited_for=frozenset()),
            Events(self._on_opened, self._on_refused, self._on_lost),
        )
        self._log = log
        self._attempts, self._retry_s = attempts, retry_s
        self._device_id = 0
        self._moved: dict[int, int] = {}
        self._doubtful: set[int] = set()

    # --- life --------------------------------------------------------------------------------------------------------

    @property
    def engine(self) -> MotionEngine | None:
        return self._session.engine

    def poll(self, now_s: float) -> None:
        """Opens the device if it is wanted and due; probes the engine at intervals."""
        if self.engine is not None or self.wanted:
            self._session.poll(now_s)

    def open(self, path: str | None, name: str) -> EngineError | None:
        """Opens a device called ``name``. Returns None if it is open, else the reason."""
        before = self.path, self.name
        self.path, self.name = path, name
        error = self._session.open()
        if error is not None:
            self.path, self.name = before
        return error

    def close(self) -> int:
        """Stops remaining motion quickly and closes the device, because the engine would continue. Returns its code."""
        _, snapshot = self.read()
        if snapshot is not None and snapshot.communicating:
            self.stop(self.moving(snapshot), snapshot, quick=True)
        code = self._session.close()
        self._forget()
        return code

    def rename(self, name: str) -> int:
        """The code of the engine. A second device would leave the first one open."""
        code = self.call(lambda engine: engine.api.SetDeviceName(name))
        if not code:
            self.name = name
        return code

    def is_at(self, path: str | None) -> bool:
        """True if ``path`` names the engine of this device, or the configured one."""
        return path is None or _place(path) == _place(self.path or "")

    def _on_opened(self, engine: MotionEngine) -> None:
        self.wanted = True
        self._forget()
        self._device_id = engine.api.GetDeviceID()[1]
        self._log.info(f"created a device with name: {self.name}")

    def _on_refused(self, error: EngineError, failures: int) -> None:
        attempt = f"attempt {failures} of {self._attempts}"
        if failures < self._attempts and error.code in BUSY:
            self._log.warning(
                f"{attempt}: lock contention, another client creates a device; again in {self._retry_s} s"
            )
        elif failures < self._attempts:
            self._log.warning(f"{attempt}: {error}; again in {self._retry_s} s")
        elif failures == self._attempts:
            self._log.error(f"{attempt}: {error}; the node continues without a device and retries")

    def _on_lost(self) -> None:
        self._log.error("the motion engine has ended: the device is lost")
        self._forget()

    def _forget(self) -> None:
        self._moved.clear()
        self._doubtful.clear()
        self._device_id = 0
        self.started_communication = False

    # --- calls -------------------------------------------------------------------------------------------------------

    def call(self, request: Callable[[MotionEngine], int]) -> int:
        """The engine's code; DeviceIsNull without a device."""
        return self._session.call(request)

    def read(self) -> tuple[int, StatusSnapshot | None]:
        """(0, the present status), or the error code and None."""
        return self._session.status()

    def check_code(self, code: int) -> int:
        """Handles the code's effect on the device and returns it."""
        return self._session.check_code(code)

    def base_text(self, code: int) -> str:
        """The meaning of a code of a device call."""
        return error_text(code, ErrorCode) if self.engine is None else self.engine.api.ErrorToString(code)

    def motion_text(self, code: int) -> str:
        """The meaning of a code of an axis call."""
        if self.engine is None:
            return error_text(code, CoreMotionErrorCode, ErrorCode)
        return self.engine.core_motion.ErrorToString(code)

    # --- motion ------------------------------------------------------------------------------------------------------

    def moved(self, axes: Sequence[int], snapshot: StatusSnapshot) -> None:
        """This device has set ``axes`` in motion; ``snapshot`` was read just before."""
        for axis in axes:
            self._moved[axis] = snapshot.cycle_counter

    def doubt(self, axes: Sequence[int]) -> None:
        """Marks ``axes`` as uncertain: the engine did not answer a command for them, and may still execute it."""
        self._doubtful.update(axes)

    def settle_doubts(self, snapshot: StatusSnapshot) -> None:
        """Stops the axes with an uncertain state once the engine responds again: it executes requests in order."""
        for axis, code in self.stop(sorted(self._doubtful), snapshot).items():
            if code != ErrorCode.APIChannelTimeOut:
                self._doubtful.discard(axis)
                self._log.error(f"axis {axis} is stopped: the engine did not answer to its command")

    def moving(self, snapshot: StatusSnapshot) -> list[int]:
        """The axes that this device set in motion and that have not come to rest; others may have taken over since."""
        for axis, since in list(self._moved.items()):
            settled = snapshot.cycle_counter > since + SETTLED_CYCLES
            owner = int(snapshot.flags[Flag.OWNER, axis])  # 0 if the engine does not report it
            at_rest = snapshot.op_state[axis] == OperationState.Idle
            if settled and (at_rest or owner not in (0, self._device_id)):
                del self._moved[axis]
        return sorted(self._moved)

    def stop(self, axes: Sequence[int], snapshot: StatusSnapshot, *, quick: bool = False) -> dict[int, int]:
        """See ``EngineSession.stop``."""
        return self._session.stop(axes, snapshot, quick=quick)


def _place(path: str) -> str:
    trimmed = path.rstrip("/")
    return "" if trimmed in _INSTALLATION_ROOTS else trimmed
