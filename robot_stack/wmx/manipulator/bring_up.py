"""The manipulator's session with the engine: from no connection to enabled servos, and back after a loss.

``poll`` is called from one thread and never waits for an effect: it reads the status, and requests the next missing
step. ``look`` is for the time between polls, in which only the joints change. Requests are round trips to the engine;
once everything is ready there are none, only the status is read.
"""

from __future__ import annotations

import math
from collections import deque

from robot_stack.wmx.api import AxisCommandMode, ErrorCode, OperationState, error_name
from robot_stack.wmx.axes import AxisFeedback, StatusSnapshot
from robot_stack.wmx.device_opener import OpenEngine
from robot_stack.wmx.failures import ABSENT, BUSY
from robot_stack.wmx.manipulator.params import ManipulatorStateParams
from robot_stack.wmx.session import EngineSession, Log
from robot_stack.wmx.start_up import Machine, Missing, SessionState, Stage, StartUp

_SCAN, _STOP_BUS = "network scan", "stopping communication"
_LOST, _STOPPED = "communication with the drives is lost", "communication was stopped by another device"


class BringUp:
    """Belongs to one thread. Times are steady seconds. ``state`` and its history ``changes`` may be read from another.

    A lost bus is started again. After the start, an alarm or a servo that dropped out is a fault for an operator.
    """

    def __init__(self, open_engine: OpenEngine, params: ManipulatorStateParams, parameter_file: str, log: Log) -> None:
        """open_engine: opens a device after a short wait; raises EngineError. parameter_file: empty for none."""
        self._params, self._parameter_file, self._log = params, parameter_file, log
        settings = params.session
        patience = settings.patience(waited_for=ABSENT - BUSY, probe_always=False)
        machine = Machine(
            dict(enumerate(params.joint_name[: params.joint_number])),
            {},
            settings.communication_retry_s,
            settings.request_pause_s,
            parameter_file=parameter_file,
        )
        self._session = EngineSession(open_engine, patience)
        self._start = StartUp(
            self._session,
            machine,
            fault=lambda _, text: (Stage.FAULT, text),
            standing=lambda _: True,
            connected=self._on_connection,
        )
        self._steps = (
            self._scan,
            self._bus,
            self._start.communication,
            self._start.parameters,
            self._report_axes,
            self._stopped,
            self._start.alarms,
            *((self._start.servos,) if params.auto_servo_on else ()),
        )
        self._cycle, self._cycle_s = -1, math.inf
        self._emergency = self._usable = self._stopping = False
        self._on_connection()
        self.state: SessionState = self._start.state
        self.changes: deque[SessionState] = deque(maxlen=200)

    @property
    def started(self) -> bool:
        """True from the end of the start until the bus or the engine is lost."""
        engine, stage = self._session.engine, self.state.stage
        return self._start.was_ready and engine is not None and stage is not Stage.COMMUNICATION

    # --- the next step -----------------------------------------------------------------------------------------------

    def poll(self, now_s: float, *, stop: bool) -> StatusSnapshot | None:
        """The present status while the joints are valid: the bus runs, parameters are set, cycles continue.

        stop: an emergency stop is active, during which no servo is switched on.
        """
        self._emergency = stop
        state = self._start.poll(now_s, self._steps)
        snapshot = state.snapshot
        advances = snapshot is None or self._advances(snapshot.cycle_counter, now_s)
        if not advances and now_s - self._cycle_s >= self._params.status_stale_s:
            state, snapshot = SessionState(Stage.CONNECTING, "the engine's cycles do not advance"), None
        if (state.stage, state.text) != (self.state.stage, self.state.text):
            self.changes.append(state)
        self.state, self._usable = state, snapshot is not None
        return snapshot

    def look(self, now_s: float) -> AxisFeedback | None:
        """The joints' feedback while the state is as in the last ``poll``; None: call ``poll`` again."""
        engine = self._session.engine
        feedback = engine.read_feedback() if self._usable and engine is not None else None
        if feedback is None or not feedback.communicating or not self._advances(feedback.cycle_counter, now_s):
            return None
        return feedback

    def _advances(self, cycle: int, now_s: float) -> bool:
        if cycle == self._cycle:
            return False
        self._cycle, self._cycle_s = cycle, now_s
        return True

    # --- steps -------------------------------------------------------------------------------------------------------

    def _on_connection(self) -> None:
        self._scanned = self._reported = self._bus_ran = self._bus_stopped = False

    def _scan(self, snapshot: StatusSnapshot, _: float) -> Missing:
        """A running network is not scanned, because a scan would disturb it and it is already known. A failed scan is
        only logged: communication starts with the configured network.
        """
        scan, self._scanned = not (self._scanned or snapshot.communicating), True
        if scan and not self._session.ask(_SCAN, lambda engine: engine.ecat.ScanNetwork(0)):
            self._log.warning(f"{self._session.refusal(_SCAN, _SCAN)}, going on without")
        return None

    def _bus(self, snapshot: StatusSnapshot, _: float) -> Missing:
        """Reports a loss before the restart. After a client's stop, only that client restarts the bus. An engine that
        does not distinguish the two, like the vendor's, counts as lost.
        """
        lost = self._bus_ran and not snapshot.communicating
        self._bus_ran = snapshot.communicating
        if lost:
            self._bus_stopped = snapshot.engine_error == ErrorCode.PyNone
        elif snapshot.communicating:
            self._bus_stopped = False
        if self._bus_stopped:
            return Stage.COMMUNICATION, f"{_STOPPED}, which has to start it again"
        return (Stage.COMMUNICATION, _LOST) if lost else None

    def _report_axes(self, *_: object) -> Missing:
        """Logs the parameters in force, one line per joint. A read error does not stop the start."""
        engine = self._session.engine
        if self._reported or engine is None:
            return None
        self._reported = True
        if self._parameter_file:
            self._log.info(f"parameters are set from {self._parameter_file}")
        else:
            self._log.warning("wmx_param_file_path is not set, the engine's parameters stay as they are")
        code, param = engine.core_motion.config.GetAxisParam()
        if self._session.check_code(code):
            self._log.warning(f"axis parameters cannot be read: {error_name(code)} (error {code})")
            return None
        for axis in range(self._params.joint_number):
            numerator, denominator = param.GetGearRatioNumerator(axis), param.GetGearRatioDenominator(axis)
            mode, encoder = param.GetAxisCommandMode(axis), param.GetAbsoluteEncoderMode(axis)
            self._log.info(
                f"{self._params.joint_name[axis]}: axis {axis}, gear ratio {numerator:.10g} / {denominator:.10g}, "
                f"polarity {param.GetAxisPolarity(axis)}, {'absolute' if encoder else 'incremental'} encoder, "
                f"{AxisCommandMode(mode).name} mode"
            )
        return None

    def _stopped(self, snapshot: StatusSnapshot, _: float) -> Missing:
        """No servo comes on during an emergency stop. Without auto_servo_on none does and no alarm is cleared: an alarm
        is a fault at once.
        """
        self._start.was_ready = self._start.was_ready or not self._params.auto_servo_on
        if self._start.was_ready or not (self._emergency or snapshot.emergency_stop):
            return None
        return Stage.STOPPED, "emergency stop" if self._emergency else "the engine is in emergency stop"

    # --- the end -----------------------------------------------------------------------------------------------------

    def end(self, *, hurry: bool) -> bool:
        """Undoes this session's steps: the servos once their joints stand, then the bus, the device. True when done.

        hurry: does not wait for joints that still move, nor for servos that are still on.
        """
        snapshot = self._session.read()
        if snapshot is not None and snapshot.communicating:
            on = [axis for axis in sorted(self._start.switched_on) if snapshot.servo_on[axis]]
            moving = [axis for axis in on if snapshot.op_state[axis] != OperationState.Idle]
            if moving and not hurry:
                self._stop_joints(moving, snapshot)
                return False
            if on:
                self._start.switch_off(on)
                if not hurry:
                    return False
        self._stop_bus()
        self._session.close()
        return True

    def _stop_joints(self, axes: list[int], snapshot: StatusSnapshot) -> None:
        if not self._stopping:
            self._stopping = True
            self._log.warning(f"stopping {' '.join(self._params.joint_name[axis] for axis in axes)}")
            self._session.stop(axes, snapshot)

    def _stop_bus(self) -> None:
        """Only if it was started here and no other client has a device."""
        engine = self._session.engine
        if engine is None or not (self._params.stop_communication and self._session.started_communication):
            return
        code, devices = engine.api.GetAllDevices()
        if not code and devices.count <= 1:
            self._session.ask(_STOP_BUS, lambda engine: engine.api.StopCommunication(0))
