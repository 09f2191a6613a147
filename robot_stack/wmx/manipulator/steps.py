"""The request of each step of the manipulator's start, and the check of its effect in the status."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import AxisCommandMode, AxisSelection, OperationState, error_name
from robot_stack.wmx.axes import BoolRow, StatusSnapshot
from robot_stack.wmx.manipulator.startup import Level, Line, Outcome, Result, Step

_ASKED = Outcome(Result.ASKED)
_DONE = Outcome(Result.DONE)


class StartupRequests:
    """Sends requests to one engine; records what it has switched on and started, to be undone at its end.

    tell: function that logs lines. names: of the joints; joint j is axis j.
    """

    def __init__(
        self, engine: MotionEngine, n_joints: int, names: tuple[str, ...], tell: Callable[[Line], None]
    ) -> None:
        self._engine = engine
        self._n_joints = n_joints
        self._names = names
        self._report = tell
        self._started_bus = False
        self._switched_on: set[int] = set()
        self._stopping = False
        self.bus_is_others = False

    # --- requests ----------------------------------------------------------------------------------------------------

    def scan(self, snapshot: StatusSnapshot) -> Outcome:
        """A running network is not scanned, because a scan would disturb it and it is already known. A failed scan is
        only logged: communication starts with the configured network.
        """
        if snapshot.communicating:
            return Outcome(Result.DONE, "left out, the network runs")
        code = self._engine.ecat.ScanNetwork(0)
        if not code:
            return _DONE
        refusal = self._refusal(code, self._engine.ecat.ErrorToString)
        return Outcome(Result.DONE, f"failed, going on without: {refusal.text}", Level.WARNING)

    def start_communication(self, snapshot: StatusSnapshot) -> Outcome:
        if snapshot.communicating:
            return Outcome(Result.DONE, "runs")
        if self.bus_is_others:
            return Outcome(Result.HELD, "was stopped by another device, which has to start it again")
        code = self._engine.api.StartCommunication(0)
        if code:
            return self._refusal(code, self._engine.api.ErrorToString)
        self._started_bus = True
        return _ASKED

    def import_parameters(self, path: str) -> Outcome:
        if not path:
            text = "wmx_param_file_path is not set, the engine's parameters stay as they are"
            return Outcome(Result.DONE, text, Level.WARNING)
        code = self._engine.core_motion.config.ImportAndSetAll(path)
        if code:
            refusal = self._refusal(code, self._engine.core_motion.ErrorToString)
            return Outcome(refusal.result, f"{path}: {refusal.text}; servos stay off")
        return Outcome(Result.DONE, f"set from {path}")

    def report_axes(self) -> Outcome:
        """Logs one line per joint. A read error does not stop the start."""
        code, param = self._engine.core_motion.config.GetAxisParam()
        if code:
            refusal = self._refusal(code, self._engine.core_motion.ErrorToString)
            return Outcome(Result.DONE, f"cannot be read: {refusal.text}", Level.WARNING)
        for axis in range(self._n_joints):
            numerator, denominator = param.GetGearRatioNumerator(axis), param.GetGearRatioDenominator(axis)
            mode, encoder = param.GetAxisCommandMode(axis), param.GetAbsoluteEncoderMode(axis)
            text = (
                f"{self._names[axis]}: axis {axis}, gear ratio {numerator:.10g} / {denominator:.10g}, "
                f"polarity {param.GetAxisPolarity(axis)}, {'absolute' if encoder else 'incremental'} encoder, "
                f"{AxisCommandMode(mode).name} mode"
            )
            self._report(Line(Level.INFO, text))
        return _DONE

    def clear_alarms(self, snapshot: StatusSnapshot, wanted: bool, stop: bool) -> Outcome:
        """Logs alarms before they are cleared."""
        if not wanted:
            return _DONE
        if stop:
            return Outcome(Result.HELD, "emergency stop")
        for axis in self._joints(snapshot.amp_alarm):
            code = int(snapshot.amp_alarm_code[axis])
            self._report(Line(Level.WARNING, f"{self._names[axis]}: clearing amplifier alarm {code}"))
        control = self._engine.core_motion.axisControl
        for axis in range(self._n_joints):
            code = control.ClearAmpAlarm(axis)
            if not code and snapshot.following_error_alarm[axis]:
                code = control.ClearAxisAlarm(axis)
            if code:
                return self._refusal(code, self._engine.core_motion.ErrorToString, axis)
        return _ASKED

    def switch_on(self, snapshot: StatusSnapshot, wanted: bool, stop: bool) -> Outcome:
        if not wanted:
            return Outcome(Result.DONE, "left as they are, auto_servo_on is false")
        if stop or snapshot.emergency_stop:
            return Outcome(Result.HELD, "emergency stop" if stop else "emergency stop of the engine")
        for axis in self._joints(~snapshot.servo_on):
            code = self._engine.core_motion.axisControl.SetServoOn(axis, 1)
            if code:
                return self._refusal(code, self._engine.core_motion.ErrorToString, axis)
            self._switched_on.add(axis)
        return _ASKED

    # --- checks ------------------------------------------------------------------------------------------------------

    def look(self, step: Step, snapshot: StatusSnapshot) -> Outcome:
        """Checks the effect of ``step``'s request."""
        match step:
            case Step.COMMUNICATION:
                return Outcome(Result.DONE, "started") if snapshot.communicating else _still("not started")
            case Step.CLEAR_ALARMS:
                missing = self._joints(snapshot.amp_alarm | snapshot.following_error_alarm)
                return _still(f"alarm of {self._list(missing)}") if missing else _DONE
            case Step.SERVO_ON:
                missing = self._joints(~snapshot.servo_on)
                if missing:
                    return _still(f"servo off: {self._list(missing)}")
                return Outcome(Result.DONE, self._list(range(self._n_joints)))
        return _DONE

    # --- the end -----------------------------------------------------------------------------------------------------

    def switch_off(self, snapshot: StatusSnapshot, hurry: bool) -> bool:
        """Switches off the servos switched on here, after stopping moving joints. True once requested."""
        moving = [axis for axis in sorted(self._switched_on) if snapshot.op_state[axis] != OperationState.Idle]
        if moving and not hurry:
            if not self._stopping:
                self._stop(moving, snapshot)
            return False
        for axis in sorted(self._switched_on):
            self._engine.core_motion.axisControl.SetServoOn(axis, 0)
        self._switched_on.clear()
        return True

    def stop_communication(self) -> None:
        """Stops the bus only if it was started here and no other client has a device."""
        code, devices = self._engine.api.GetAllDevices()
        if self._started_bus and not code and devices.count <= 1:
            self._engine.api.StopCommunication(0)

    def _stop(self, axes: list[int], snapshot: StatusSnapshot) -> None:
        self._stopping = True
        self._report(Line(Level.WARNING, f"stopping {self._list(axes)}"))
        velocity = [axis for axis in axes if snapshot.command_mode[axis] == AxisCommandMode.Velocity]
        position = [axis for axis in axes if axis not in velocity]
        if position:
            self._engine.core_motion.motion.Stop_AxisSel(AxisSelection.of(*position))
        if velocity:
            self._engine.core_motion.velocity.Stop_AxisSel(AxisSelection.of(*velocity))

    # --- details -----------------------------------------------------------------------------------------------------

    def _joints(self, wrong: BoolRow) -> list[int]:
        return [axis for axis in range(self._n_joints) if wrong[axis]]

    def _list(self, axes: Iterable[int]) -> str:
        return " ".join(self._names[axis] for axis in axes)

    def _refusal(self, code: int, text: Callable[[int], str], axis: int | None = None) -> Outcome:
        where = "" if axis is None else f"{self._names[axis]}: "
        return Outcome(Result.REFUSED, f"{where}{text(code)} ({error_name(code)}, error {code})")


def _still(text: str) -> Outcome:
    return Outcome(Result.ASKED, text)
