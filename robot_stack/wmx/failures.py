"""The meaning of the engine's codes for a client's device, shared by all clients."""

from __future__ import annotations

from typing import Final

from robot_stack.wmx.api import ErrorCode

BUSY: Final = frozenset({ErrorCode.CreateDeviceLockError, ErrorCode.StartProcessLockError})
"""Another process is creating a device or starting the engine: retry."""

ABSENT: Final = BUSY | {
    ErrorCode.IMLibIsNotRunning,
    ErrorCode.EngineNotStartedInSpecifiedTime,
    ErrorCode.SystemInitializationNotDone,
}
"""No engine yet: retried silently, because no request was rejected. A device creation with a timeout in which the
engine does not become ready returns the last of these (WMX3Api::CreateDevice).
"""

LOST: Final = frozenset({ErrorCode.IMLibIsNotRunning, ErrorCode.DeviceIsNull, ErrorCode.APIChannelError})
"""The device is no longer valid: the engine has ended, was stopped, or has closed the device."""

PASSING: Final = ABSENT | {ErrorCode.APIChannelTimeOut}
"""Codes of a device creation that are resolved by waiting."""
