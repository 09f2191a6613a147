"""Two wheels on the motion engine: from no engine at all to servos that are on, and back whenever something is lost.

``poll`` is called often and never waits: it looks at the engine's status once and asks for the next thing that is
missing. What breaks while the wheels were ready stops both of them at the engine's quick-stop deceleration. An alarm or
a servo that dropped out then waits for whoever clears it and switches it on again, or for an emergency stop and its
release; a lost engine or bus is gone through from the start.
"""

from __future__ import annotations

from robot_stack.wmx.api import (
    AxisCommandMode,
    AxisSelection,
    DetailOperationState,
    OperationState,
)
from robot_stack.wmx.axes import Flag, StatusSnapshot
from robot_stack.wmx.differential import requests
from robot_stack.wmx.differential.kinematics import REST, WheelPair
from robot_stack.wmx.differential.states import SessionSettings, SessionState, Stage
from robot_stack.wmx.link import EngineLink

_WHEELS = ("left", "right")
_COMMUNICATION, _MODE, _SERVO, _ALARMS = "starting communication", "velocity mode", "servo on", "clearing alarms"
_DRIVING, _QUICK_STOP = "driving", "quick stop"
_BY_HAND = "needs clear_alarm and set_on, or an emergency stop and its release"
_NO_BUS_YET = "the engine does not communicate yet"
_HALTING = (DetailOperationState.Stop_QStop, DetailOperationState.Stop_EStop)


Step = tuple[Stage, str] | None


class WheelSession:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(self, link: EngineLink, settings: SessionSettings) -> None:
        self._link = link
        self._settings = settings
        self._selection = AxisSelection.of(*settings.axes)
        self._connection = 0
        self._parameters_set = False
        self._was_ready = False
        self._bus = _NO_BUS_YET
        self._sent: WheelPair | None = None
        self._driving_since_s: float | None = None
        self.state = SessionState(Stage.CONNECTING, link.text)

    @property
    def ready(self) -> bool:
        return self.state.stage is Stage.READY

    # --- the next step -----------------------------------------------------------------------------------------------

    def poll(self, now_s: float, *, stop: bool) -> SessionState:
        """Looks, and asks for what is missing. stop: an emergency stop is in force."""
        self.state = self._next(now_s, stop)
        self._was_ready = self._was_ready or self.ready
        if not self.ready:
            self._sent = self._driving_since_s = None
        return self.state

    def _next(self, now_s: float, stop: bool) -> SessionState:
        self._link.poll(now_s)
        if self._link.connections != self._connection:
            self._connection = self._link.connections
            self._was_ready = self._parameters_set = False
            self._bus = _NO_BUS_YET
        snapshot = self._link.read()
        if snapshot is None:
            return SessionState(Stage.CONNECTING, self._link.problem)
        if snapshot.n_axes <= max(self._settings.axes):
            return SessionState(Stage.CONNECTING, f"axes {self._settings.axes} of an engine with {snapshot.n_axes}")
        stage, text = (
            self._communication(snapshot, now_s)
            or self._parameters(now_s)
            or self._stopped(snapshot, now_s, stop)
            or self._alarms(snapshot, now_s)
            or self._modes(snapshot, now_s)
            or self._servos(snapshot, now_s)
            or self._motion(snapshot, now_s)
            or (Stage.READY, "ready")
        )
        if self._link.engine is None:  # lost on the way
            return SessionState(Stage.CONNECTING, self._link.problem)
        return SessionState(stage, text, snapshot if snapshot.communicating else None)

    def _communication(self, snapshot: StatusSnapshot, now_s: float) -> Step:
        if snapshot.communicating:
            return None
        if self._was_ready:
            self._was_ready, self._bus = False, "communication with the drives is lost"
        if self._link.due(_COMMUNICATION, now_s, self._settings.communication_retry_s):
            self._link.ask(_COMMUNICATION, lambda engine: engine.api.StartCommunication(0))
        return Stage.COMMUNICATION, self._link.refusal(_COMMUNICATION, self._bus)

    def _parameters(self, now_s: float) -> Step:
        """Without its parameters a wheel has the wrong gear: it is not switched on."""
        path = self._settings.parameter_file
        if self._parameters_set or not path:
            return None
        what = f"wmx_param_file_path {path}"
        if self._link.due(what, now_s, self._settings.communication_retry_s):
            self._parameters_set = self._link.ask(what, lambda engine: engine.core_motion.config.ImportAndSetAll(path))
        return None if self._parameters_set else (Stage.PARAMETERS, self._link.refusal(what, what))

    def _stopped(self, snapshot: StatusSnapshot, now_s: float, stop: bool) -> Step:
        if not (stop or snapshot.emergency_stop):
            return None
        self._halt(snapshot)
        self._was_ready = False
        self._clear_alarms(snapshot, now_s)
        return Stage.STOPPED, "emergency stop" if stop else "the engine is in emergency stop"

    def _alarms(self, snapshot: StatusSnapshot, now_s: float) -> Step:
        faults = self._faults(snapshot)
        if not faults:
            return None
        if self._was_ready:
            return self._fault(snapshot, f"{faults}; {_BY_HAND}")
        self._clear_alarms(snapshot, now_s)
        return Stage.SWITCHING_ON, self._link.refusal(_ALARMS, faults)

    def _modes(self, snapshot: StatusSnapshot, now_s: float) -> Step:
        wrong = [axis for axis in self._settings.axes if snapshot.command_mode[axis] != AxisCommandMode.Velocity]
        if not wrong:
            return None
        self._halt(snapshot)
        if self._link.due(_MODE, now_s, self._settings.request_pause_s):
            all(self._link.ask(_MODE, requests.velocity_mode(axis)) for axis in wrong)
        return Stage.SWITCHING_ON, self._link.refusal(_MODE, f"{self._names(wrong)} wheel not in velocity mode")

    def _servos(self, snapshot: StatusSnapshot, now_s: float) -> Step:
        off = [axis for axis in self._settings.axes if not snapshot.servo_on[axis]]
        if not off:
            return None
        text = f"{self._names(off)} wheel: servo off"
        if self._was_ready:
            return self._fault(snapshot, f"{text}; {_BY_HAND}")
        if self._link.due(_SERVO, now_s, self._settings.request_pause_s):
            selection = AxisSelection.of(*off)
            self._link.ask(_SERVO, lambda engine: engine.core_motion.axisControl.SetServoOn_AxisSel(selection, 1))
        return Stage.SWITCHING_ON, self._link.refusal(_SERVO, text)

    def _motion(self, snapshot: StatusSnapshot, now_s: float) -> Step:
        """A wheel that another stopped: with the other wheel driven on, the base would turn."""
        axes = self._settings.axes
        strange = [
            axis for axis in axes if snapshot.op_state[axis] not in (OperationState.Idle, OperationState.Velocity)
        ]
        if strange:
            self._halt(snapshot)
            return Stage.STOPPING, f"{self._names(strange)} wheel is being stopped"
        if self._driving_since_s is None or now_s - self._driving_since_s <= self._settings.follow_s:
            return None
        idle = [axis for axis in axes if snapshot.op_state[axis] == OperationState.Idle]
        return self._fault(snapshot, f"{self._names(idle)} wheel was stopped by another") if idle else None

    # --- motion ------------------------------------------------------------------------------------------------------

    def follow(self, speeds: WheelPair, now_s: float) -> str:
        """Has both wheels at speeds of their axes (rad/s), or neither. Returns why not, an empty text if it is so.

        What has been sent is not sent again: it would begin the change of speed anew. What was refused is.
        """
        snapshot = self.state.snapshot
        if not self.ready or snapshot is None:
            return f"not ready: {self.state.text}"
        at_rest = not snapshot.velocity_cmd[list(self._settings.axes)].any()
        if speeds == self._sent or (speeds == REST and self._sent is None and at_rest):
            return ""
        problem = self._drive(speeds)
        self._sent = None if problem else speeds
        self._driving_since_s = now_s if self._sent not in (None, REST) else None
        return problem

    def _drive(self, speeds: WheelPair) -> str:
        settings = self._settings
        times_s = settings.acc_time_s, settings.dec_time_s
        commands = [
            requests.run_at(settings.left_axis, speeds.left, *times_s),
            requests.run_at(settings.right_axis, speeds.right, *times_s),
        ]
        done = self._link.ask(_DRIVING, lambda engine: engine.core_motion.velocity.StartVel(len(commands), commands))
        return "" if done else self._link.refusal(_DRIVING, self._link.text)

    def quick_stop(self) -> str:
        """Stops both wheels in the engine, at once. Returns why it could not, an empty text if it could."""
        if self._link.ask(
            _QUICK_STOP, lambda engine: engine.core_motion.velocity.ExecQuickStop_AxisSel(self._selection)
        ):
            return ""
        # One of them is not in velocity mode: each in its own.
        stopped = [self._link.ask(_QUICK_STOP, requests.quick_stop(axis)) for axis in self._settings.axes]
        return "" if all(stopped) else self._link.refusal(_QUICK_STOP, "no engine to stop")

    def standing(self, snapshot: StatusSnapshot) -> bool:
        """Both wheels, commanded and measured."""
        axes, slowest = list(self._settings.axes), self._settings.standstill_radps
        return not snapshot.velocity_cmd[axes].any() and bool((abs(snapshot.actual_velocity[axes]) <= slowest).all())

    def servos_off(self) -> None:
        """Only for wheels that stand."""
        self._link.ask(_SERVO, lambda engine: engine.core_motion.axisControl.SetServoOn_AxisSel(self._selection, 0))

    # --- details -----------------------------------------------------------------------------------------------------

    def _fault(self, snapshot: StatusSnapshot, text: str) -> tuple[Stage, str]:
        self._halt(snapshot)
        return Stage.FAULT, text

    def _halt(self, snapshot: StatusSnapshot) -> None:
        """A quick stop, unless both wheels rest or are in one already."""
        states, details = snapshot.op_state, snapshot.flags[Flag.DETAIL_OP_STATE]
        if any(states[axis] != OperationState.Idle and details[axis] not in _HALTING for axis in self._settings.axes):
            self.quick_stop()

    def _clear_alarms(self, snapshot: StatusSnapshot, now_s: float) -> None:
        """Asks the drives to forget their alarms, once the wheels stand. Nothing moves by it: the servos are off."""
        drives = [axis for axis in self._settings.axes if snapshot.amp_alarm[axis]]
        following = [axis for axis in self._settings.axes if snapshot.following_error_alarm[axis]]
        if not (drives or following) or not self.standing(snapshot):
            return
        if not self._link.due(_ALARMS, now_s, self._settings.request_pause_s):
            return
        for axis in drives:
            self._link.ask(_ALARMS, requests.clear_drive(axis))
        for axis in following:
            self._link.ask(_ALARMS, requests.clear_axis(axis))

    def _faults(self, snapshot: StatusSnapshot) -> str:
        texts = [
            f"{self._names([axis])} wheel: alarm {int(snapshot.amp_alarm_code[axis])}"
            for axis in self._settings.axes
            if snapshot.amp_alarm[axis]
        ]
        following = [axis for axis in self._settings.axes if snapshot.following_error_alarm[axis]]
        return ", ".join([*texts, *(f"{self._names([axis])} wheel: following error" for axis in following)])

    def _names(self, axes: list[int]) -> str:
        return " and ".join(_WHEELS[self._settings.axes.index(axis)] for axis in axes)
