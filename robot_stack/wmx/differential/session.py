"""Two wheels on the motion engine: from no connection to enabled servos, and back after a loss.

``poll`` is called often and never blocks: it reads the engine's status once and requests the next missing step. A fault
while the wheels were ready stops both of them at the engine's quick-stop deceleration. An alarm or a dropped servo then
waits until a client clears it and switches it on again, or for an emergency stop and its
release; a lost engine or bus restarts the sequence.
"""

from __future__ import annotations

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AxisCommandMode,
    AxisSelection,
    DetailOperationState,
    OperationState,
)
from robot_stack.wmx.axes import Flag, StatusSnapshot
from robot_stack.wmx.axis_group import CLEARING, SERVO_ON, AxisGroup
from robot_stack.wmx.differential import requests
from robot_stack.wmx.differential.kinematics import REST, WheelPair
from robot_stack.wmx.differential.states import SessionSettings, Stage
from robot_stack.wmx.session import Applied, EngineSession
from robot_stack.wmx.start_up import SessionState, StartUp

_WHEELS = ("left", "right")
_MODE = "velocity mode"
_DRIVING, _QUICK_STOP = "driving", "quick stop"
_BY_HAND = "needs clear_alarm and set_on, or an emergency stop and its release"
_NO_BUS_YET = "the engine does not communicate yet"
# Share of a command's lifetime after which it is sent again.
_RENEWED = 1.0 / 3.0
_SHORTEST_RAMP_S = 1e-3
_HALTING = (DetailOperationState.Stop_QStop, DetailOperationState.Stop_EStop)
_HELD_UP = "delayed between the engine's status and the command"

Missing = tuple[Stage, str] | None


class WheelSession:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(self, engine: EngineSession, settings: SessionSettings) -> None:
        self._engine = engine
        self._settings = settings
        self._selection = AxisSelection.of(*settings.axes)
        names = {axis: f"{wheel} wheel:" for axis, wheel in zip(settings.axes, _WHEELS, strict=True)}
        self._group = AxisGroup(engine, names, settings.request_pause_s)
        steps = (
            self._communication,
            self._parameters,
            self._stopped,
            self._alarms,
            self._modes,
            self._servos,
            self._motion,
        )
        self._start = StartUp(
            engine, settings.axes, steps, Stage.CONNECTING, Stage.READY, connected=self._on_connection
        )
        self._stop = False
        self._parameters_set = False
        self._was_ready = False
        self._bus = _NO_BUS_YET
        self._sent: WheelPair | None = None
        self._sent_s = 0.0
        self._ramps_end_s = (0.0, 0.0)
        self._driving_since_s: float | None = None
        self.state = SessionState(Stage.CONNECTING, engine.text)

    @property
    def ready(self) -> bool:
        return self.state.stage is Stage.READY

    # --- the next step -----------------------------------------------------------------------------------------------

    def poll(self, now_s: float, *, stop: bool) -> SessionState[Stage]:
        """Reads the status and requests the next missing step. stop: an emergency stop is active."""
        self._stop = stop
        self.state = self._start.poll(now_s)
        self._was_ready = self._was_ready or self.ready
        if not self.ready:
            self._sent = self._driving_since_s = None
        return self.state

    def _on_connection(self) -> None:
        self._was_ready = self._parameters_set = False
        self._bus = _NO_BUS_YET

    def _communication(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        if snapshot.communicating:
            return None
        if self._was_ready:
            self._was_ready, self._bus = False, "communication with the drives is lost"
        pause_s = self._settings.communication_retry_s
        return Stage.COMMUNICATION, self._engine.start_communication(now_s, pause_s, self._bus)

    def _parameters(self, _: StatusSnapshot, now_s: float) -> Missing:
        """Loads the parameters first: without them a wheel has the wrong gear and must not be switched on."""
        path = self._settings.parameter_file
        if self._parameters_set or not path:
            return None
        what = f"wmx_param_file_path {path}"
        if self._engine.due(what, now_s, self._settings.communication_retry_s):
            self._parameters_set = self._engine.ask(
                what, lambda engine: engine.core_motion.config.ImportAndSetAll(path)
            )
        return None if self._parameters_set else (Stage.PARAMETERS, self._engine.refusal(what, what))

    def _stopped(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        if not (self._stop or snapshot.emergency_stop):
            return None
        self._halt(snapshot)
        self._was_ready = False
        self._clear_alarms(snapshot, now_s)
        return Stage.STOPPED, "emergency stop" if self._stop else "the engine is in emergency stop"

    def _alarms(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        faults = self._group.faults(snapshot)
        if not faults:
            return None
        if self._was_ready:
            return self._fault(snapshot, f"{faults}; {_BY_HAND}")
        self._clear_alarms(snapshot, now_s)
        return Stage.SWITCHING_ON, self._engine.refusal(CLEARING, faults)

    def _modes(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        wrong = [axis for axis in self._settings.axes if snapshot.command_mode[axis] != AxisCommandMode.Velocity]
        if not wrong:
            return None
        self._halt(snapshot)
        if self._engine.due(_MODE, now_s, self._settings.request_pause_s):
            all(self._engine.ask(_MODE, requests.velocity_mode(axis)) for axis in wrong)
        return Stage.SWITCHING_ON, self._engine.refusal(_MODE, f"{self._names(wrong)} wheel not in velocity mode")

    def _servos(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        off = self._group.where(~snapshot.servo_on)
        if not off:
            return None
        text = f"{self._names(off)} wheel: servo off"
        if self._was_ready:
            return self._fault(snapshot, f"{text}; {_BY_HAND}")
        if self._engine.due(SERVO_ON, now_s, self._settings.request_pause_s):
            self._group.switch_on(off)
        return Stage.SWITCHING_ON, self._engine.refusal(SERVO_ON, text)

    def _motion(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        """Stops both wheels if another client stopped one: driving on with the other would turn the base."""
        axes = self._settings.axes
        strange = [
            axis for axis in axes if snapshot.op_state[axis] not in (OperationState.Idle, OperationState.Velocity)
        ]
        if strange:
            self._halt(snapshot)
            return Stage.STOPPING, f"{self._names(strange)} wheel is being stopped"
        since_s = self._driving_since_s
        if since_s is None or 0.0 <= snapshot.engine_time_s - since_s <= self._settings.follow_s:
            return None
        idle = [axis for axis in axes if snapshot.op_state[axis] == OperationState.Idle]
        return self._fault(snapshot, f"{self._names(idle)} wheel was stopped by another client") if idle else None

    # --- motion ------------------------------------------------------------------------------------------------------

    def follow(self, speeds: WheelPair, now_s: float, ramp_s: float | None = None) -> Applied[WheelPair]:
        """Drives both wheels at speeds of their axes (rad/s), or neither. ramp_s: time to reach them, None for the
        settings' value.

        Turning wheels are commanded again well within the lifetime of their command, which keeps them turning.
        """
        snapshot = self.state.snapshot
        if not self.ready or snapshot is None:
            return Applied(None, f"not ready: {self.state.text}")
        present = self._commanded(snapshot)
        if speeds == REST and self._sent is None and present == REST:
            return Applied(speeds)
        if speeds == self._sent:
            fresh = 0.0 <= now_s - self._sent_s < _RENEWED * self._settings.command_lifetime_s
            return Applied(speeds) if speeds == REST or fresh else self._drive(snapshot, speeds, now_s)
        self._ramps_end_s = (
            now_s + (ramp_s or self._ramp_s(present.left, speeds.left)),
            now_s + (ramp_s or self._ramp_s(present.right, speeds.right)),
        )
        applied = self._drive(snapshot, speeds, now_s)
        if self._sent in (None, REST):
            self._driving_since_s = None
        elif self._driving_since_s is None:
            self._driving_since_s = snapshot.engine_time_s
        return applied

    def _ramp_s(self, now: float, wanted: float) -> float:
        """Duration of a change of speed; through zero it falls first and then grows."""
        settings = self._settings
        if now * wanted < 0.0:
            return settings.dec_time_s + settings.acc_time_s
        return settings.acc_time_s if abs(wanted) > abs(now) else settings.dec_time_s

    def _drive(self, seen: StatusSnapshot, speeds: WheelPair, now_s: float) -> Applied[WheelPair]:
        """Commands the wheels from the status ``seen``. After a longer pause the engine may have stopped them, and this
        would restart them: then it is rejected.
        """
        if speeds != REST and self._held_up(seen):
            return Applied(None, _HELD_UP)
        settings = self._settings
        present = self._commanded(seen)
        resting, turning = [], []
        rows = zip(
            settings.axes, (present.left, present.right), (speeds.left, speeds.right), self._ramps_end_s, strict=True
        )
        for axis, now, wanted, end_s in rows:
            remaining_s = max(end_s - now_s, _SHORTEST_RAMP_S)
            if wanted:
                lifetime_s = settings.command_lifetime_s
                turning.append(requests.run_at(axis, now, wanted, remaining_s, settings.dec_time_s, lifetime_s))
            else:
                resting.append(requests.rest(axis, remaining_s))

        def drive(engine: MotionEngine) -> int:
            velocity = engine.core_motion.velocity
            code = velocity.StartVel(len(resting), resting) if resting else 0
            return code or (velocity.StartVel_TimedVel(len(turning), turning) if turning else 0)

        self._sent, self._sent_s = speeds if self._engine.ask(_DRIVING, drive) else None, now_s
        if turning and self._held_up(seen):  # the call itself must not exceed this time either
            self._sent = None
            self.quick_stop()
            return Applied(None, _HELD_UP)
        return Applied(self._sent, "" if self._sent is not None else self._engine.refusal(_DRIVING, self._engine.text))

    def _held_up(self, seen: StatusSnapshot) -> bool:
        """True if the status is too old for a command by the engine's time, in which the wheels move."""
        now = self._engine.read()
        return now is None or now.engine_time_s - seen.engine_time_s > self._settings.follow_s

    def _commanded(self, snapshot: StatusSnapshot) -> WheelPair:
        return WheelPair(*snapshot.velocity_cmd[list(self._settings.axes)].tolist())

    def quick_stop(self) -> str:
        """Stops both wheels in the engine at once. Returns the reason of a failure, or an empty text."""
        if self._engine.ask(
            _QUICK_STOP, lambda engine: engine.core_motion.velocity.ExecQuickStop_AxisSel(self._selection)
        ):
            return ""
        # If one wheel is not in velocity mode, each is stopped in its own mode.
        stopped = [self._engine.ask(_QUICK_STOP, requests.quick_stop(axis)) for axis in self._settings.axes]
        return "" if all(stopped) else self._engine.refusal(_QUICK_STOP, "no engine to stop")

    def standing(self, snapshot: StatusSnapshot) -> bool:
        """True if both wheels stand, commanded and measured."""
        axes, slowest = list(self._settings.axes), self._settings.standstill_radps
        return not snapshot.velocity_cmd[axes].any() and bool((abs(snapshot.actual_velocity[axes]) <= slowest).all())

    def servos_off(self) -> None:
        """Switches the servos off. Only for standing wheels."""
        self._group.switch_off()

    # --- details -----------------------------------------------------------------------------------------------------

    def _fault(self, snapshot: StatusSnapshot, text: str) -> tuple[Stage, str]:
        self._halt(snapshot)
        return Stage.FAULT, text

    def _halt(self, snapshot: StatusSnapshot) -> None:
        """Requests a quick stop, unless both wheels are at rest or already in one."""
        states, details = snapshot.op_state, snapshot.flags[Flag.DETAIL_OP_STATE]
        if any(states[axis] != OperationState.Idle and details[axis] not in _HALTING for axis in self._settings.axes):
            self.quick_stop()

    def _clear_alarms(self, snapshot: StatusSnapshot, now_s: float) -> None:
        if self.standing(snapshot):
            self._group.clear_alarms(snapshot, now_s)

    def _names(self, axes: list[int]) -> str:
        return " and ".join(_WHEELS[self._settings.axes.index(axis)] for axis in axes)
