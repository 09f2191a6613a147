"""The port on the vendor's library. What is not a plain call is here: everything else is a row of the tables of calls.

An overloaded or optional shape of the vendor is settled by the first call that needs it: its wrapper refuses arguments
of a wrong type before it does anything, so a shape that is refused is followed by the next one.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode, error_name
from robot_stack.wmx.api.status import CoreMotionStatus
from robot_stack.wmx.api.values import INFINITE, AxisSelection
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.vendor import calls
from robot_stack.wmx.vendor.calls import WRONG_ARGUMENTS, Call, Member
from robot_stack.wmx.vendor.records import MissingField, Records
from robot_stack.wmx.vendor.snapshots import Age, SnapshotReader
from robot_stack.wmx.vendor.waiting import motion_result

_POLL_S: Final = 0.001
_STARTS: Final = ("StartPos", "StartMov", "StartJog", "StartJog_TimedJog", "StartVel", "StartVel_TimedVel")


class Module(Member):
    """An object with a text for its error codes."""

    def ErrorToString(self, code: int) -> str:
        """This module's own text of a code; one that the port does not know keeps the vendor's number in it."""
        number = self.records.errors.theirs(int(code))
        text = str(self.theirs.ErrorToString(number))
        return text if number == code or error_name(code) != str(int(code)) else f"{text} (vendor's number {number})"


class Device(Module):
    """WMX3Api. Whoever gives no time is not told that the time is over: the vendor goes on with what was asked."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, calls.API, records)
        self._create = self.bound("CreateDevice", calls.API["CreateDevice"])
        self._start = self.bound("StartCommunication", calls.API["StartCommunication"])
        self._stop = self.bound("StopCommunication", calls.API["StopCommunication"])
        self._quit = self.bound("AutoQuitWithoutActiveDev", calls.API["AutoQuitWithoutActiveDev"])
        self._creating = False

    def CreateDevice(self, path: str, deviceType: int = 0, waitTimeMilliseconds: int = 0) -> int:
        """A second device on an open handle is refused: what the vendor makes of it is not documented."""
        if self.IsDeviceValid():  # type: ignore[attr-defined]
            came_late, self._creating = self._creating, False
            return ErrorCode.PyNone if came_late else ErrorCode.ResourceInUse
        code: int = self._create(path, deviceType, waitTimeMilliseconds)
        self._creating = code == ErrorCode.EngineNotStartedInSpecifiedTime
        return code

    def StartCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        code: int = self._start(waitTimeMilliseconds)
        on_its_way = code == ErrorCode.CommNotStartedInSpecifiedTime and not waitTimeMilliseconds
        return ErrorCode.PyNone if on_its_way else code

    def StopCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        code: int = self._stop(waitTimeMilliseconds)
        on_its_way = code == ErrorCode.CommNotStoppedInSpecifiedTime and not waitTimeMilliseconds
        return ErrorCode.PyNone if on_its_way else code

    def AutoQuitWithoutActiveDev(self, quit: bool) -> int:
        code: int = self._quit(bool(quit))
        return code

    def communicating(self) -> int:
        """PyNone if the bus communicates, else the code that says why not."""
        code, status = self.GetEngineStatus()  # type: ignore[attr-defined]
        return code or (ErrorCode.PyNone if status.state == EngineState.Communicating else ErrorCode.CommNotStarted)


class _Starts(Member):
    """Motion calls: one command, or a count and a list that must be as long."""

    def __init__(self, theirs: Any, table: calls.Calls, records: Records) -> None:
        super().__init__(theirs, table, records)
        for name in _STARTS:
            if name in table:
                setattr(self, name, self._start(getattr(self, name)))

    @staticmethod
    def _start(run: Callable[..., int]) -> Callable[..., int]:
        def start(command: Any, commands: Sequence[Any] | None = None) -> int:
            if commands is None:
                return ErrorCode.ArgumentOutOfRange if isinstance(command, int) else run(command)
            count = operator.index(command)
            if not 0 <= count <= len(commands):  # the vendor would read beyond the list
                return ErrorCode.ArgumentOutOfRange
            return run(count, list(commands[:count]))

        return start


class Motion(_Starts):
    """motion; its Wait calls poll the status and never block in the vendor's library."""

    def __init__(self, theirs: Any, records: Records, read: Callable[[], tuple[int, StatusSnapshot]]) -> None:
        super().__init__(theirs, calls.MOTION, records)
        self._read = read

    def Wait(self, axis: int) -> int:
        return self._wait([axis], INFINITE)

    def Wait_AxisSel(self, axisSelection: AxisSelection) -> int:
        return self._wait(_axes(axisSelection), INFINITE)

    def Wait_TimeMilli(self, axis: int, waitTimeMilliseconds: int) -> int:
        return self._wait([axis], waitTimeMilliseconds)

    def Wait_AxisSel_TimeMilli(self, axisSelection: AxisSelection, waitTimeMilliseconds: int) -> int:
        return self._wait(_axes(axisSelection), waitTimeMilliseconds)

    def _wait(self, axes: Sequence[int], milliseconds: float) -> int:
        deadline = None if milliseconds >= INFINITE else time.monotonic() + 1e-3 * milliseconds
        while True:
            code, snapshot = self._read()
            result = code or motion_result(snapshot, axes)
            if result is not None:
                return result
            if deadline is not None and time.monotonic() >= deadline:
                return CoreMotionErrorCode.WaitTimeout
            time.sleep(_POLL_S)


class Config(Member):
    """config. A block is read, the port's fields are changed, and it is written: the vendor's other fields stay."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, calls.CONFIG, records)
        for name in calls.BLOCKS:
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
        super().__init__(theirs, calls.CORE_MOTION, records)
        self._reader = SnapshotReader(records)
        self._age = Age(stale_s)
        self.axisControl = Member(theirs.axisControl, calls.AXIS_CONTROL, records)
        self.motion = Motion(theirs.motion, records, lambda: self.snapshot(None))
        self.velocity = _Starts(theirs.velocity, calls.VELOCITY, records)
        self.home = Member(theirs.home, calls.HOME, records)
        self.config = Config(theirs.config, records)

    def GetStatus(self) -> tuple[int, CoreMotionStatus]:
        """StatusChannelError: the engine does not cycle any more."""
        code, status, _ = self._latest()
        return (code, CoreMotionStatus()) if code else (code, self.records.status(status))

    def snapshot(self, io: InputsOutputs | None) -> tuple[int, StatusSnapshot]:
        """The status as arrays, with the I/O bytes if ``io`` is given."""
        code, status, stamp_ns = self._latest()
        if code:
            return code, empty_snapshot()
        communicating = self._reader.engine_state(status) is EngineState.Communicating
        inputs, outputs = io.images(communicating) if io is not None else ([], [])
        return code, self._reader.read(status, inputs, outputs, stamp_ns, self._age.epoch)

    def _latest(self) -> tuple[int, Any, int]:
        """Code, the vendor's status, and when its engine was last seen to cycle."""
        code, *rest = self.theirs.GetStatus()
        if code:
            return self.records.errors.ours(int(code)), None, 0
        status, now_ns = rest[0], time.monotonic_ns()
        communicating = self._reader.engine_state(status) is EngineState.Communicating
        stamp_ns = self._age.stamp(int(status.GetCycleCounter(0)), communicating, now_ns)
        code = ErrorCode.StatusChannelError if self._age.stale(now_ns) else ErrorCode.PyNone
        return code, status, stamp_ns


class InputsOutputs(Module):
    """Io. Inputs without communication fail: a dead bus has no inputs, whatever the vendor's image still holds."""

    def __init__(self, theirs: Any, records: Records, device: Device, n_bytes: int) -> None:
        super().__init__(theirs, calls.IO, records)
        self._device = device
        self._n_bytes = n_bytes
        for name in ("GetInBit", "GetInByte", "GetInBytes"):
            setattr(self, name, self._guarded(calls.IO[name], getattr(self, name)))
        self._set_bytes = self.bound("SetOutBytes", calls.IO["SetOutBytes"])

    def _guarded(self, call: Call, run: Callable[..., Any]) -> Callable[..., Any]:
        def read(*arguments: int) -> Any:
            code = self._device.communicating()
            return self.answer(call, code) if code else run(*arguments)

        return read

    def SetOutBytes(self, byte: int, size: int, data: Sequence[int]) -> int:
        if size != len(data):  # the vendor would read beyond the list
            return ErrorCode.IOSizeOutOfRange
        code: int = self._set_bytes(byte, size, list(data))
        return code

    def images(self, communicating: bool) -> tuple[list[int], list[int]]:
        """Input and output bytes; an image that cannot be read is empty, and a bit beyond an image reads 0."""
        outputs = self.received(calls.IO["GetOutBytes"], self.theirs.GetOutBytes(0, self._n_bytes))[1]
        if not communicating:
            return [], outputs
        return self.received(calls.IO["GetInBytes"], self.theirs.GetInBytes(0, self._n_bytes))[1], outputs


class Network(Module):
    """Ecat. The Python calls of engine 3.5 are without the master that those of other versions want first."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, calls.ECAT, records)
        for name, call in calls.ECAT.items():
            if not hasattr(type(self), name):
                setattr(self, name, self._of_a_master(self.bound(name, call)))
        self._scan = self._of_a_master(self.bound("ScanNetwork", calls.ECAT["ScanNetwork"]))

    @staticmethod
    def _of_a_master(run: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            try:
                return run(*arguments)
            except WRONG_ARGUMENTS:
                return run(0, *arguments)

        return call

    def ScanNetwork(self, masterId: int = 0) -> int:
        if masterId:
            return ErrorCode.ArgumentOutOfRange
        code: int = self._scan()
        return code


def _axes(selection: AxisSelection) -> list[int]:
    return [selection.GetAxis(index) for index in range(selection.axisCount)]
