"""What the engine's codes mean for a client's device: the same for everybody who opens one and has to keep it."""

from __future__ import annotations

from typing import Final

from robot_stack.wmx.api import ErrorCode

BUSY: Final = frozenset({ErrorCode.CreateDeviceLockError, ErrorCode.StartProcessLockError})
"""Another process creates a device, or starts the engine, at this moment: wait and ask again."""

ABSENT: Final = BUSY | {
    ErrorCode.IMLibIsNotRunning,
    ErrorCode.EngineNotStartedInSpecifiedTime,
    ErrorCode.SystemInitializationNotDone,
}
"""There is no engine to work with yet: waited for in silence, it has refused nothing. A creation of a device that is
given a time to see the engine in order, and does not, answers the last of these (WMX3Api::CreateDevice).
"""

LOST: Final = frozenset({ErrorCode.IMLibIsNotRunning, ErrorCode.DeviceIsNull, ErrorCode.APIChannelError})
"""The device is worth nothing any more: the engine has ended, was stopped by somebody, or has closed the device."""

PASSING: Final = ABSENT | {ErrorCode.APIChannelTimeOut}
"""Of a device's creation: goes away by waiting."""
