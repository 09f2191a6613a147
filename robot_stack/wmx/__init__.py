"""The motion engine: one port (``api``), two implementations, and one place that selects between them.

``connect`` gives a node the configured engine; ``load_library`` gives the classes of an implementation to code that
creates its own devices, like programs for the vendor's library.
"""

from __future__ import annotations

import logging
import random
import time
from typing import Final

from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.config import ClientConfig, load_client_config
from robot_stack.wmx.engine import EngineError, Library, MotionEngine
from robot_stack.wmx.failures import BUSY, LOST, PASSING

_POLL_S: Final = 0.02
_log = logging.getLogger(__name__)


def load_library(config: ClientConfig) -> Library:
    """The implementation that ``config`` names. Raises EngineError if the vendor's library is missing or unfit."""
    if config.engine == "vendor" and not config.bridged:
        from robot_stack.wmx.vendor import vendor_library

        return vendor_library(config.library_path, config.vendor_axes, config.vendor_io_bytes, config.status_stale_s)
    from robot_stack.wmx.simulated.library import simulated_library

    return simulated_library(config.call_timeout_s, config.status_stale_s)


def connect(name: str, config: ClientConfig | None = None, timeout_s: float | None = None) -> MotionEngine:
    """A device called ``name`` on the configured engine. Raises EngineError.

    Waits for an engine that does not run yet and for concurrent device creations, up to ``timeout_s``
    (by default the configured one). 0 tries once, so that a node can retry from a timer. One try blocks for up to the
    configured time with the vendor's engine, which the first device starts; an executor leaves it to a thread.

    A device that cannot be named is used without a name: closing it, if it is the only one, would end the engine.
    """
    config = config or load_client_config()
    library = load_library(config)
    api = library.WMX3Api()
    deadline = time.monotonic() + (config.connect_timeout_s if timeout_s is None else timeout_s)
    # The process of the simulated engine, or of the bridge, is started by others: waiting inside would not start it.
    start_ms = round(1e3 * config.connect_timeout_s) if config.engine == "vendor" and not config.bridged else 0
    while True:
        code = api.CreateDevice(config.device_path, 0, start_ms)
        if code == ErrorCode.PyNone:
            break
        if code not in PASSING or time.monotonic() >= deadline:
            raise EngineError(f"{name}: cannot create a device", code, api.ErrorToString(code))
        # The pause is random, so that nodes that start together do not collide again and again.
        locked = code in BUSY
        time.sleep(config.lock_retry_s * random.uniform(0.5, 1.5) if locked else _POLL_S)
    code = api.SetDeviceName(name)
    if code in LOST:
        raise EngineError(f"{name}: the device was lost at once", code, api.ErrorToString(code))
    if code:
        _log.warning("%s: the device has no name: %s (error %d)", name, api.ErrorToString(code), code)
    return MotionEngine(library, api)


__all__ = ["EngineError", "Library", "MotionEngine", "connect", "load_library"]
