"""The port on the simulated engine for its clients: the surface's calls as requests, and calls with client-side parts.

The path of CreateDevice: the vendor's installation roots and "" mean the stack's own runtime folder, any other path is
the runtime folder of an engine. The engine's process is started by its owner (the simulation, or
``python -m robot_stack.wmx.engine_server``), never by a client: a device can only be created where one runs.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any, Final, cast

from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx.api import port
from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.api.errors import (
    AdvancedMotionErrorCode,
    CoreMotionErrorCode,
    EcErrorCode,
    ErrorCode,
    error_text,
)
from robot_stack.wmx.api.status import EngineStatus
from robot_stack.wmx.api.surface import SURFACE, Call
from robot_stack.wmx.api.values import (
    INFINITE,
    MAX_SPLINE_DIMENSIONS,
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
)
from robot_stack.wmx.axes import AxisFeedback, Flag, StatusSnapshot, empty_snapshot
from robot_stack.wmx.simulated.channel import Channel, Reply, StatusView
from robot_stack.wmx.simulated.parameter_file import ParameterFileError, ParameterValues, read_file, write_file
from robot_stack.wmx.simulated.protocol import pack
from robot_stack.wmx.simulated.wire import decode, encode_all, integer, request_name

INSTALLATION_ROOTS: Final = ("", "/opt/lmx", "/opt/wmx3")
_POLL_S: Final = 0.001


def engine_folder(path: str) -> Path:
    """The runtime folder that a device path means."""
    return runtime_dir() if path.rstrip("/") in INSTALLATION_ROOTS else Path(path)


class Member:
    """One object of the surface: its calls are requests of a device, except those that a subclass implements.

    Not typed: the caller that exposes it declares its protocol of the port.
    """

    def __init__(self, api: Device, owner: str, *errors: type[IntEnum]) -> None:
        """errors: enumerations with the texts of ErrorToString."""
        self._api = api
        self._errors = errors
        for name, call in SURFACE[owner].items():
            if not call.own:
                setattr(self, name, _asking(api, request_name(owner, name), call))

    def ErrorToString(self, code: int) -> str:
        return error_text(code, *self._errors)


def _asking(api: Device, request: str, call: Call) -> Callable[..., Any]:
    def ask(*arguments: Any) -> Any:
        sent = encode_all(call.takes, arguments)
        if sent is None:
            return call.zero(ErrorCode.ArgumentOutOfRange)
        code, values = api.call(request, *sent)
        if code or not (call.values or call.echo):
            return call.zero(code, *arguments[-1:])
        answered = (decode(kind, value) for kind, value in zip(call.values, values, strict=True))
        return (code, *answered, *(arguments[-1:] if call.echo else ()))

    return ask


class Device(Member):
    """WMX3Api on the simulated engine."""

    def __init__(self, call_timeout_s: float, status_stale_s: float) -> None:
        """call_timeout_s: of a call. status_stale_s: greatest age of a status."""
        super().__init__(self, "WMX3Api", ErrorCode)
        self._call_timeout_s, self._status_stale_s = call_timeout_s, status_stale_s
        self._channel: Channel | None = None
        self._status: StatusView | None = None
        self._device_id = 0
        self._epoch = -1

    # -- used by the other API objects of this device -----------------------------------------------------------------

    def call(self, method: str, *arguments: Any) -> Reply:
        """(code, values) of a request by this device."""
        if self._channel is None or not self._device_id:
            return ErrorCode.DeviceIsNull, []
        code, values = self._channel.call(method, *arguments)
        if code == ErrorCode.DeviceIsNull:
            self._forget()
        return code, values

    def command(self, method: str, *arguments: Any) -> int:
        """The code of a request without further results."""
        return self.call(method, *arguments)[0]

    def snapshot(self) -> tuple[int, StatusSnapshot]:
        """The latest status without a round trip; DeviceIsNull once any client has stopped the engine."""
        if self._status is None or not self._device_id:
            return ErrorCode.DeviceIsNull, empty_snapshot()
        code, snapshot = self._status.read()
        if not code and snapshot.epoch != self._epoch:
            self._forget()
            return ErrorCode.DeviceIsNull, empty_snapshot()
        return code, snapshot

    def feedback(self) -> AxisFeedback | None:
        """The latest feedback of this device's engine; None where ``snapshot`` has a code."""
        if self._status is None or not self._device_id:
            return None
        feedback = self._status.read_feedback()
        return feedback if feedback is not None and feedback.epoch == self._epoch else None

    # -- the vendor's surface -----------------------------------------------------------------------------------------

    def CreateDevice(self, path: str, deviceType: int = 0, waitTimeMilliseconds: int = 0) -> int:
        """Waits up to the given time for an engine that is just starting or stopping; not for the creation lock."""
        if self.IsDeviceValid():
            return ErrorCode.ResourceInUse
        self._forget()
        deadline = time.monotonic() + 1e-3 * min(waitTimeMilliseconds, INFINITE)
        while True:
            code = self._create(engine_folder(path), operator.index(deviceType))
            starting = code in (ErrorCode.IMLibIsNotRunning, ErrorCode.EngineNotStartedInSpecifiedTime)
            if not starting or time.monotonic() >= deadline:
                return code
            time.sleep(10 * _POLL_S)

    def _create(self, folder: Path, device_type: int) -> int:
        try:
            channel = Channel(folder, self._call_timeout_s)
        except OSError:
            return ErrorCode.IMLibIsNotRunning
        code, values = channel.call("CreateDevice", device_type)
        if code:
            channel.close()
            return code
        self._channel = channel
        self._device_id, self._epoch = values
        self._status = StatusView(folder, self._status_stale_s)
        return ErrorCode.PyNone

    def CloseDevice(self) -> int:
        code = self.command("CloseDevice")
        if code != ErrorCode.CloseDeviceLockError:
            self._forget()
        return code

    def IsDeviceValid(self) -> bool:
        return self.snapshot()[0] == ErrorCode.PyNone and self._channel is not None and self._channel.alive

    def StopEngine(self, waitTimeMilliseconds: int = 0) -> int:
        status = self._status
        code = self.command("StopEngine")
        self._forget()
        if code or status is None or not waitTimeMilliseconds:
            return code

        def ended() -> int | None:
            code, snapshot = status.read()
            return code if code or snapshot.engine_state is not EngineState.Shutdown else None

        return _until(ended, waitTimeMilliseconds, ErrorCode.EngineNotStoppedInSpecifiedTime)

    def StartCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        code = self.command("StartCommunication")
        if code or not waitTimeMilliseconds:
            return code

        def started() -> int | None:
            code, snapshot = self.snapshot()
            return code if code or snapshot.communicating else None

        return _until(started, waitTimeMilliseconds, ErrorCode.CommNotStartedInSpecifiedTime)

    def GetEngineStatus(self) -> tuple[int, EngineStatus]:
        code, snapshot = self.snapshot()
        if code:
            return code, EngineStatus()
        return code, EngineStatus(snapshot.engine_state, snapshot.engine_error, 1)

    def GetDeviceID(self) -> tuple[int, int]:
        self.snapshot()  # detects that the engine was stopped
        return (ErrorCode.PyNone if self._device_id else ErrorCode.DeviceIsNull), self._device_id

    def _forget(self) -> None:
        if self._channel is not None:
            self._channel.close()
        self._channel = None
        self._status = None
        self._device_id = 0


def _until(decided: Callable[[], int | None], milliseconds: float, timeout_code: int) -> int:
    """Polls until ``decided`` gives a code, or the time is over."""
    deadline = time.monotonic() + 1e-3 * milliseconds
    while True:
        code = decided()
        if code is not None:
            return code
        if time.monotonic() >= deadline:
            return timeout_code
        time.sleep(_POLL_S)


class CoreMotion(Member):
    """Motion control of the simulated engine."""

    def __init__(self, api: Device) -> None:
        super().__init__(api, "CoreMotion", CoreMotionErrorCode, ErrorCode)
        self.axisControl = cast(port.AxisControl, AxisControl(api, "axisControl"))
        self.motion = cast(port.Motion, Member(api, "motion"))
        self.velocity = cast(port.Velocity, Member(api, "velocity"))
        self.home = cast(port.Home, Member(api, "home"))
        self.config = cast(port.Config, Config(api, "config"))


class AxisControl(Member):
    """Servo, alarms and modes."""

    def GetAxisCommandMode(self, axis: int) -> tuple[int, int]:
        code, snapshot = self._api.snapshot()
        if not code and not 0 <= axis < snapshot.n_axes:
            code = ErrorCode.AxisOutOfRange
        return (code, 0) if code else (code, int(snapshot.flags[Flag.COMMAND_MODE, axis]))


class Config(Member):
    """Parameters; their files are read and written here, with the caller's rights."""

    def ImportAndSetAll(self, filePath: str) -> int:
        code, snapshot = self._api.snapshot()
        if code:
            return code
        try:
            values = read_file(filePath, snapshot.n_axes)
        except ParameterFileError:
            return CoreMotionErrorCode.ParameterFileParseError
        except (OSError, ValueError):
            return ErrorCode.FileOperationFailed
        return self._api.command("SetAllParameters", values.of_engine, values.of_axes)

    def GetAndExportAll(self, filePath: str) -> int:
        code, values = self._api.call("GetAllParameters")
        if code:
            return code
        try:
            write_file(filePath, ParameterValues(*values))
        except (OSError, ValueError):
            return ErrorCode.FileOperationFailed
        return ErrorCode.PyNone


class Io(Member):
    """Digital outputs; reading is without a round trip."""

    def __init__(self, api: Device) -> None:
        super().__init__(api, "Io", ErrorCode)

    def GetOutBit(self, byte: int, bit: int) -> tuple[int, int]:
        code, snapshot = self._api.snapshot()
        if not code and not (0 <= byte < snapshot.outputs.size and 0 <= bit < 8):
            code = ErrorCode.IOAddressOutOfRange
        return (code, 0) if code else (code, int(snapshot.output_bit(byte, bit)))


class AdvMotion(Member):
    """Spline buffers and spline motions."""

    def StartCSplinePos_PointTime(
        self,
        channel: int,
        command: AdvMotion_PointTimeSplineCommand,
        numPoints: int,
        points: Sequence[AdvMotion_SplinePoint],
        pointTimeMilliseconds: Sequence[float],
    ) -> int:
        if not numPoints == len(points) == len(pointTimeMilliseconds):
            return ErrorCode.ArgumentOutOfRange
        n = operator.index(command.dimensionCount)
        if n > MAX_SPLINE_DIMENSIONS:
            n = 0  # which the engine rejects, after its earlier checks
        axes = [command.GetAxis(dimension) for dimension in range(n)]
        rows = [[float(point.GetPos(dimension)) for dimension in range(n)] for point in points]
        times = [float(time) for time in pointTimeMilliseconds] if n > 0 else []
        return self._api.command("StartSpline", integer(channel), axes, pack(rows), pack(times))


class AdvancedMotion(Member):
    """Motions of several axes together on the simulated engine."""

    def __init__(self, api: Device) -> None:
        self._errors = (AdvancedMotionErrorCode, CoreMotionErrorCode, ErrorCode)
        self.advMotion = cast(port.AdvMotion, AdvMotion(api, "advMotion"))


class Ecat(Member):
    """One master, one slave per axis."""

    def __init__(self, api: Device) -> None:
        super().__init__(api, "Ecat", EcErrorCode, ErrorCode)
