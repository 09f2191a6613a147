"""The port on the vendor's library: calls with special handling. All others are rows of the surface's tables.

An overloaded or optional signature of the vendor is determined at the first call that needs it: its wrapper rejects
arguments of a wrong type before any effect, so after a rejected signature the next one is tried.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from robot_stack.wmx.api import surface
from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode, error_name
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.vendor.member import WRONG_ARGUMENTS, Member
from robot_stack.wmx.vendor.records import MissingField, Records
from robot_stack.wmx.vendor.snapshots import Age, SnapshotReader


class Module(Member):
    """An object with a text for its error codes."""

    def ErrorToString(self, code: int) -> str:
        """This module's own text of a code; an unknown one keeps the vendor's number in it."""
        number = self.records.errors.theirs(int(code))
        text = str(self.theirs.ErrorToString(number))
        return text if number == code or error_name(code) != str(int(code)) else f"{text} (vendor's number {number})"


class Device(Module):
    """WMX3Api. Without a given time no timeout is reported: the vendor continues with the request."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, surface.API, records)
        self._create = self.bound("CreateDevice", surface.API["CreateDevice"])
        self._start = self.bound("StartCommunication", surface.API["StartCommunication"])
        self._stop = self.bound("StopCommunication", surface.API["StopCommunication"])
        self._creating = False

    def CreateDevice(self, path: str, deviceType: int = 0, waitTimeMilliseconds: int = 0) -> int:
        """A second device on an open handle is rejected: the vendor does not document its effect."""
        if self.IsDeviceValid():  # type: ignore[attr-defined]
            came_late, self._creating = self._creating, False
            return ErrorCode.PyNone if came_late else ErrorCode.ResourceInUse
        code: int = self._create(path, deviceType, waitTimeMilliseconds)
        self._creating = code in (ErrorCode.SystemInitializationNotDone, ErrorCode.EngineNotStartedInSpecifiedTime)
        return code

    def StartCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        code: int = self._start(waitTimeMilliseconds)
        on_its_way = code == ErrorCode.CommNotStartedInSpecifiedTime and not waitTimeMilliseconds
        return ErrorCode.PyNone if on_its_way else code

    def StopCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        code: int = self._stop(waitTimeMilliseconds)
        on_its_way = code == ErrorCode.CommNotStoppedInSpecifiedTime and not waitTimeMilliseconds
        return ErrorCode.PyNone if on_its_way else code


class Config(Member):
    """config. A block is read, the port's fields are changed, and it is written: the vendor's other fields stay."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, surface.CONFIG, records)
        for name in (*surface.BLOCKS, surface.ENGINE_BLOCK):
            setattr(self, f"Set{name}", self._setter(name))

    def _setter(self, name: str) -> Callable[..., tuple[int, Any]]:
        getter, setter = getattr(self.theirs, f"Get{name}", None), getattr(self.theirs, f"Set{name}", None)

        def write(*arguments: Any) -> tuple[int, Any]:
            *axis, param = arguments
            if getter is None or setter is None:
                return ErrorCode.NoSupportedFunction, param
            if hasattr(param, "eStopDec") and len(param.eStopDec) != self.records.n_axes:
                return CoreMotionErrorCode.ParameterSettingsInvalid, param
            try:
                code, block = getter(*map(int, axis))
                if not code:
                    code, _ = setter(*map(int, axis), self.records.fill(param, block))
            except OverflowError:
                return CoreMotionErrorCode.ParameterSettingsInvalid, param
            except MissingField:
                return ErrorCode.NoSupportedFunction, param
            return self.records.errors.ours(int(code)), param

        return write


class CoreMotion(Module):
    """CoreMotion and its members."""

    def __init__(self, theirs: Any, records: Records, stale_s: float) -> None:
        super().__init__(theirs, surface.CORE_MOTION, records)
        self._reader = SnapshotReader(records)
        self._age = Age(stale_s)
        self.axisControl = Member(theirs.axisControl, surface.AXIS_CONTROL, records)
        self.motion = Member(theirs.motion, surface.MOTION, records)
        self.velocity = Member(theirs.velocity, surface.VELOCITY, records)
        self.home = Member(theirs.home, surface.HOME, records)
        self.config = Config(theirs.config, records)

    def snapshot(self, io: InputsOutputs) -> tuple[int, StatusSnapshot]:
        """The status as arrays, with the I/O bytes. StatusChannelError: the engine has stopped cycling."""
        code, status, stamp_ns = self._latest()
        if code:
            return code, empty_snapshot()
        communicating = self._reader.engine_state(status) is EngineState.Communicating
        inputs, outputs = io.images(communicating)
        return code, self._reader.read(status, inputs, outputs, stamp_ns, self._age.epoch)

    def _latest(self) -> tuple[int, Any, int]:
        """Code, the vendor's status, and the time of its engine's last observed cycle."""
        code, *rest = self.theirs.GetStatus()
        if code:
            return self.records.errors.ours(int(code)), None, 0
        status, now_ns = rest[0], time.monotonic_ns()
        communicating = self._reader.engine_state(status) is EngineState.Communicating
        stamp_ns = self._age.stamp(int(status.GetCycleCounter(0)), communicating, now_ns)
        code = ErrorCode.StatusChannelError if self._age.stale(now_ns) else ErrorCode.PyNone
        return code, status, stamp_ns


class InputsOutputs(Module):
    """Io, and the images of the status. A dead bus has no inputs, whatever the vendor's image still contains."""

    def __init__(self, theirs: Any, records: Records, n_bytes: int) -> None:
        super().__init__(theirs, surface.IO, records)
        self._n_bytes = n_bytes

    def images(self, communicating: bool) -> tuple[list[int], list[int]]:
        """Input and output bytes; an unreadable image is empty, and a bit beyond an image reads 0."""
        return self._image(self.theirs.GetInBytes) if communicating else [], self._image(self.theirs.GetOutBytes)

    def _image(self, read: Callable[[int, int], Any]) -> list[int]:
        code, *values = read(0, self._n_bytes)
        return [] if code else [int(value) for value in values[0]]


class Network(Module):
    """Ecat. The Python calls of engine 3.5 lack the master argument of other versions."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, surface.ECAT, records)
        self._scan = self.bound("ScanNetwork", surface.ECAT["ScanNetwork"])

    def ScanNetwork(self, masterId: int = 0) -> int:
        if masterId:
            return ErrorCode.ArgumentOutOfRange
        try:
            code: int = self._scan()
        except WRONG_ARGUMENTS:
            code = self._scan(0)
        return code
