"""A fake engine that returns the real return codes. Unlike in the real engine, a request changes the status at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_stack.wmx.api import AxisSelection, Config_AxisParam, EngineState, ErrorCode, OperationState
from robot_stack.wmx.api.status import DevicesInfo
from robot_stack.wmx.axes import AxisFeedback, Flag, StatusSnapshot, axis_feedback, empty_snapshot


class FakeEngine:
    """``codes``: return code by call name; all other calls succeed. ``deaf``: calls without an effect."""

    def __init__(self, n_axes: int = 3) -> None:
        self.codes: dict[str, int] = {}
        self.deaf: set[str] = set()
        self.calls: list[str] = []
        self.n_devices = 1
        self.open = True
        snapshot = replace(empty_snapshot(n_axes), outputs=np.zeros(2, np.uint8), inputs=np.zeros(2, np.uint8))
        self.snapshot: StatusSnapshot = replace(snapshot, engine_state=EngineState.Running)
        self.api = self.core_motion = self.ecat = self
        self.axisControl = self.motion = self.velocity = self.config = self

    def read_status(self) -> tuple[int, StatusSnapshot]:
        self.snapshot = replace(self.snapshot, cycle_counter=self.snapshot.cycle_counter + 1)
        return int(self.codes.get("read_status", ErrorCode.PyNone)), self.snapshot

    def read_feedback(self) -> AxisFeedback | None:
        code, snapshot = self.read_status()
        return None if code else axis_feedback(snapshot)

    def close(self) -> None:
        self.calls.append("close")
        self.open = False

    def flag(self, flag: Flag, axis: int | slice, value: int) -> None:
        flags = self.snapshot.flags.copy()
        flags[flag, axis] = value
        self.snapshot = replace(self.snapshot, flags=flags)

    def communicates(self, on: bool, error: int = 0) -> None:
        state = EngineState.Communicating if on else EngineState.Running
        self.snapshot = replace(self.snapshot, engine_state=state, engine_error=error)
        if not on:
            self.flag(Flag.SERVO_ON, slice(None), 0)

    def _answer(self, call: str) -> bool:
        """Returns True if the call has an effect."""
        self.calls.append(call)
        name = call.partition("(")[0]
        return name not in self.deaf and not self._code(call)

    def _code(self, call: str) -> int:
        return int(self.codes.get(call, self.codes.get(call.partition("(")[0], ErrorCode.PyNone)))

    # --- the vendor's names

    @staticmethod
    def ErrorToString(code: int) -> str:
        return f"text {code}"

    def GetDeviceName(self) -> tuple[int, str]:
        self._answer("GetDeviceName")
        return self._code("GetDeviceName"), "fake"

    def GetAllDevices(self) -> tuple[int, DevicesInfo]:
        return 0, DevicesInfo(self.n_devices)

    def ScanNetwork(self, master: int) -> int:
        self._answer(f"ScanNetwork({master})")
        return self._code("ScanNetwork")

    def StartCommunication(self, milliseconds: int) -> int:
        assert milliseconds == 0, "a wait would hold the thread up"
        if self._answer("StartCommunication"):
            self.communicates(True)
        return self._code("StartCommunication")

    def StopCommunication(self, milliseconds: int) -> int:
        self._answer("StopCommunication")
        return 0

    def ImportAndSetAll(self, path: str) -> int:
        self._answer(f"ImportAndSetAll({path})")
        return self._code("ImportAndSetAll")

    def GetAxisParam(self) -> tuple[int, Config_AxisParam]:
        n = self.snapshot.n_axes
        param = Config_AxisParam([0] * n, [52953088.0] * n, [6.25] * n, [-1] * n, [True] * n, [0.0] * n)
        return self._code("GetAxisParam"), param

    def ClearAmpAlarm_AxisSel(self, selection: AxisSelection) -> int:
        return self._set(f"ClearAmpAlarm({_axes(selection)})", Flag.AMP_ALARM, selection, 0)

    def ClearAxisAlarm_AxisSel(self, selection: AxisSelection) -> int:
        return self._set(f"ClearAxisAlarm({_axes(selection)})", Flag.FOLLOWING_ERROR_ALARM, selection, 0)

    def SetServoOn_AxisSel(self, selection: AxisSelection, on: int) -> int:
        return self._set(f"SetServoOn({_axes(selection)}, {on})", Flag.SERVO_ON, selection, on)

    def Stop_AxisSel(self, selection: AxisSelection) -> int:
        return self._set(f"Stop_AxisSel({_axes(selection)})", Flag.OP_STATE, selection, OperationState.Idle)

    def _set(self, call: str, flag: Flag, selection: AxisSelection, value: int) -> int:
        if self._answer(call):
            for axis in _axes(selection):
                self.flag(flag, axis, value)
        return self._code(call)


def _axes(selection: AxisSelection) -> list[int]:
    return [selection.GetAxis(i) for i in range(selection.axisCount)]
