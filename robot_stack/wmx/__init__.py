"""The motion engine: one port (``api``), two implementations, one place that chooses between them.

``connect`` gives a node its engine by configuration; ``load_library`` gives the classes of an implementation to code
that creates its devices itself, as programs for the vendor's library do.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from robot_stack.wmx import api as port
from robot_stack.wmx.api import ErrorCode, error_name
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import ClientConfig, load_client_config

_POLL_S: Final = 0.02


class EngineError(Exception):
    """The engine refused; ``code`` is its error code, ``text`` what that means."""

    def __init__(self, what: str, code: int, text: str) -> None:
        super().__init__(f"{what}: {text} ({error_name(code)}, error {code})")
        self.code = code
        self.text = text


@dataclass(frozen=True, slots=True)
class Library:
    """The constructors of one implementation, and how it reads the status as arrays."""

    WMX3Api: Callable[[], port.WMX3Api]
    CoreMotion: Callable[[port.WMX3Api], port.CoreMotion]
    Io: Callable[[port.WMX3Api], port.Io]
    Ecat: Callable[[port.WMX3Api], port.Ecat]
    AdvancedMotion: Callable[[port.WMX3Api], port.AdvancedMotion]
    read_status: Callable[[port.WMX3Api, port.CoreMotion, port.Io], tuple[int, StatusSnapshot]]


def load_library(config: ClientConfig) -> Library:
    """The implementation that ``config`` names. Raises EngineError if the vendor's library is missing or unfit."""
    if config.engine == "vendor":
        from robot_stack.wmx.vendor import vendor_library

        return vendor_library(config.library_path, config.vendor_axes, config.vendor_io_bytes, config.status_stale_s)
    from robot_stack.wmx.simulated.library import simulated_library

    return simulated_library(config.call_timeout_s, config.status_stale_s)


class MotionEngine:
    """An open device with its API objects. Belongs to one thread; a context manager that closes the device."""

    def __init__(self, library: Library, api: port.WMX3Api) -> None:
        self._library = library
        self.api = api
        self.core_motion = library.CoreMotion(api)
        self.io = library.Io(api)
        self.ecat = library.Ecat(api)
        self.advanced_motion = library.AdvancedMotion(api)

    def read_status(self) -> tuple[int, StatusSnapshot]:
        """(code, snapshot) of all axes, without a round trip. With a code other than 0 it must not be acted on."""
        return self._library.read_status(self.api, self.core_motion, self.io)

    def close(self) -> None:
        """Gives the device back: axes it commanded last are stopped by the engine."""
        for _ in range(_CLOSE_TRIES):
            if self.api.CloseDevice() != ErrorCode.CloseDeviceLockError:
                return
            time.sleep(_POLL_S)

    def __enter__(self) -> MotionEngine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def connect(name: str, config: ClientConfig | None = None, timeout_s: float | None = None) -> MotionEngine:
    """A device called ``name`` on the configured engine. Raises EngineError.

    Waits for an engine that does not run yet and for others who create devices at the same moment, up to ``timeout_s``
    (by default the configured one). 0 tries once and does not block, so that a node can try again from a timer.
    """
    config = config or load_client_config()
    library = load_library(config)
    api = library.WMX3Api()
    deadline = time.monotonic() + (config.connect_timeout_s if timeout_s is None else timeout_s)
    while True:
        code = api.CreateDevice(config.path, 0, 0)
        if code == ErrorCode.PyNone:
            break
        if code not in _PASSING or time.monotonic() >= deadline:
            raise EngineError(f"{name}: cannot create a device", code, api.ErrorToString(code))
        # Several nodes that start together must not keep meeting: the pause differs from one to the next.
        locked = code == ErrorCode.CreateDeviceLockError
        time.sleep(config.lock_retry_s * random.uniform(0.5, 1.5) if locked else _POLL_S)
    code = api.SetDeviceName(name)
    if code:
        api.CloseDevice()
        raise EngineError(f"{name}: cannot name the device", code, api.ErrorToString(code))
    return MotionEngine(library, api)


_CLOSE_TRIES: Final = 20
"""While others close theirs. Whoever is not let in leaves it to the engine, which sees the process end."""
_PASSING: Final = frozenset(
    {
        ErrorCode.CreateDeviceLockError,
        ErrorCode.IMLibIsNotRunning,
        ErrorCode.EngineNotStartedInSpecifiedTime,
        ErrorCode.APIChannelTimeOut,
    }
)
"""Errors of device creation that go away by waiting."""

__all__ = ["EngineError", "Library", "MotionEngine", "connect", "load_library"]
