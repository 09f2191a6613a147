"""An open device with its API objects, for every implementation."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from robot_stack.wmx.api import ErrorCode, error_name, port
from robot_stack.wmx.axes import AxisFeedback, StatusSnapshot, axis_feedback

_CLOSE_POLL_S: Final = 0.02
_CLOSE_TRIES: Final = 20
"""Timeout while other devices are closing. After it the engine cleans up, which detects the end of the process."""


class EngineError(Exception):
    """The engine rejected a request; ``code`` is its error code, ``text`` its meaning."""

    def __init__(self, what: str, code: int, text: str) -> None:
        super().__init__(f"{what}: {text} ({error_name(code)}, error {code})")
        self.code = code
        self.text = text


FeedbackReader = Callable[[], AxisFeedback | None]


@dataclass(frozen=True, slots=True)
class Library:
    """The constructors of one implementation, and its reader of the status as arrays.

    ``feedback_reader`` makes a reader of the feedback of one device; None: it is taken from the status.
    """

    WMX3Api: Callable[[], port.WMX3Api]
    CoreMotion: Callable[[port.WMX3Api], port.CoreMotion]
    Io: Callable[[port.WMX3Api], port.Io]
    Ecat: Callable[[port.WMX3Api], port.Ecat]
    AdvancedMotion: Callable[[port.WMX3Api], port.AdvancedMotion]
    read_status: Callable[[port.WMX3Api, port.CoreMotion, port.Io], tuple[int, StatusSnapshot]]
    feedback_reader: Callable[[port.WMX3Api], FeedbackReader] | None = None


class MotionEngine:
    """An open device with its API objects. Belongs to one thread; a context manager that closes the device.

    ``read_feedback()`` reads only the axis positions of the status, for readers at several hundred Hz;
    None where ``read_status`` has another code than 0.
    """

    def __init__(self, library: Library, api: port.WMX3Api) -> None:
        self._library = library
        self.api = api
        self.core_motion = library.CoreMotion(api)
        self.io = library.Io(api)
        self.ecat = library.Ecat(api)
        self.advanced_motion = library.AdvancedMotion(api)
        reader = library.feedback_reader
        self.read_feedback: FeedbackReader = self._feedback_of_status if reader is None else reader(api)

    def read_status(self) -> tuple[int, StatusSnapshot]:
        """(code, snapshot) of all axes, without a round trip. With a code other than 0 the snapshot is invalid."""
        return self._library.read_status(self.api, self.core_motion, self.io)

    def _feedback_of_status(self) -> AxisFeedback | None:
        code, snapshot = self.read_status()
        return None if code else axis_feedback(snapshot)

    def close(self) -> int:
        """Closes the device; returns the engine's code. Motion that it started continues: stop it before."""
        code = self.api.CloseDevice()
        for _ in range(_CLOSE_TRIES):
            if code != ErrorCode.CloseDeviceLockError:
                break
            time.sleep(_CLOSE_POLL_S)
            code = self.api.CloseDevice()
        return code

    def __enter__(self) -> MotionEngine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
