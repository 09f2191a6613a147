"""The meaning of the engine's codes for a client's device, shared by all clients."""

from __future__ import annotations

from typing import Final

from robot_stack.wmx.api import ErrorCode

BUSY: Final = frozenset({ErrorCode.CreateDeviceLockError, ErrorCode.StartProcessLockError})
"""Another process creates a device, or starts the engine, at this moment: retry."""

ABSENT: Final = BUSY | {
    ErrorCode.IMLibIsNotRunning,
    ErrorCode.EngineNotStartedInSpecifiedTime,
    ErrorCode.SystemInitializationNotDone,
}
"""No engine to work with yet: waited for silently, because it has rejected nothing. A device creation with a timeout
in which the engine does not become ready returns the last of these (WMX3Api::CreateDevice).
"""

LOST: Final = frozenset({ErrorCode.IMLibIsNotRunning, ErrorCode.DeviceIsNull, ErrorCode.APIChannelError})
"""The device is no longer valid: the engine has ended, was stopped, or has closed the device."""

PASSING: Final = ABSENT | {ErrorCode.APIChannelTimeOut}
"""Of a device's creation: resolved by waiting."""
