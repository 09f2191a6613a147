"""Two wheels on the motion engine: from no connection to enabled servos, and back after a loss.

``poll`` is called often and never blocks: it reads the engine's status once and requests the next missing step. A fault
while the wheels were ready stops both of them at the engine's quick-stop deceleration. An alarm or a dropped servo then
waits until a client clears it and switches it on again, or for an emergency stop and its
release; a lost engine or bus restarts the sequence.
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
from robot_stack.wmx.differential.params import DiffDriveParams
from robot_stack.wmx.session import Applied, EngineSession
from robot_stack.wmx.start_up import Machine, Missing, SessionState, Stage, StartUp
from robot_stack.wmx.timed_velocity import start

_WHEELS = ("left wheel", "right wheel")
_DRIVING, _QUICK_STOP = "driving", "quick stop"
_BY_HAND = "needs clear_alarm and set_on, or an emergency stop and its release"
# Share of a command's lifetime after which it is sent again.
_RENEWED = 1.0 / 3.0
_SHORTEST_RAMP_S = 1e-3
_HALTING = (DetailOperationState.Stop_QStop, DetailOperationState.Stop_EStop)
_HELD_UP = "delayed between the engine's status and the command"


class WheelSession:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(self, engine: EngineSession, params: DiffDriveParams, parameter_file: str) -> None:
        """parameter_file: the engine's parameter XML, empty for none."""
        self._engine = engine
        self._params, self._timing = params, params.session
        self._selection = AxisSelection.of(*params.axes)
        machine = Machine(
            dict(zip(params.axes, _WHEELS, strict=True)),
            dict.fromkeys(params.axes, AxisCommandMode.Velocity),
            params.session.communication_retry_s,
            params.session.request_pause_s,
            parameter_file=parameter_file,
            restarts=True,
        )
        self._start = StartUp(engine, machine, fault=self._fault, standing=self.standing)
        self._steps = (
            self._start.communication,
            self._start.parameters,
            self._stopped,
            self._start.alarms,
            self._modes,
            self._start.servos,
            self._motion,
        )
        self._stop = False
        self._sent: WheelPair | None = None
        self._sent_s = 0.0
        self._ramps_end_s = (0.0, 0.0)
        self._driving_since_s: float | None = None

    @property
    def state(self) -> SessionState:
        return self._start.state

    @property
    def ready(self) -> bool:
        return self._start.ready

    # --- the next step -----------------------------------------------------------------------------------------------

    def poll(self, now_s: float, *, stop: bool) -> SessionState:
        """Reads the status and requests the next missing step. stop: an emergency stop is active."""
        self._stop = stop
        state = self._start.poll(now_s, self._steps)
        if not self.ready:
            self._sent = self._driving_since_s = None
        return state

    def _stopped(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        if not (self._stop or snapshot.emergency_stop):
            return None
        self._halt(snapshot)
        self._start.was_ready = False
        self._start.clear_alarms(snapshot, now_s)
        return Stage.STOPPED, "emergency stop" if self._stop else "the engine is in emergency stop"

    def _modes(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        """Also of ready wheels, after another client has changed one."""
        if self._start.wrong_modes(snapshot):
            self._halt(snapshot)
        return self._start.modes(snapshot, now_s)

    def _motion(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        """Stops both wheels if another client stopped one: driving on with the other would turn the base."""
        axes = self._params.axes
        strange = [
            axis for axis in axes if snapshot.op_state[axis] not in (OperationState.Idle, OperationState.Velocity)
        ]
        if strange:
            self._halt(snapshot)
            return Stage.STOPPING, f"{self._names(strange)} is being stopped"
        since_s = self._driving_since_s
        if since_s is None or 0.0 <= snapshot.engine_time_s - since_s <= self._timing.follow_s:
            return None
        idle = [axis for axis in axes if snapshot.op_state[axis] == OperationState.Idle]
        if not idle:
            return None
        self._halt(snapshot)
        return Stage.FAULT, f"{self._names(idle)} was stopped by another client"

    # --- motion ------------------------------------------------------------------------------------------------------

    def follow(self, speeds: WheelPair, now_s: float, ramp_s: float | None = None) -> Applied[WheelPair]:
        """Drives both wheels at speeds of their axes (rad/s), or neither. ramp_s: time to reach them, None for the
        parameters' value.

        Turning wheels are commanded again well within the lifetime of their command, which keeps them turning.
        """
        snapshot = self.state.snapshot
        if not self.ready or snapshot is None:
            return Applied(None, f"not ready: {self.state.text}")
        present = self._commanded(snapshot)
        if speeds == REST and self._sent is None and present == REST:
            return Applied(speeds)
        if speeds == self._sent:
            fresh = 0.0 <= now_s - self._sent_s < _RENEWED * self._timing.command_lifetime_s
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
        params = self._params
        if now * wanted < 0.0:
            return params.dec_time + params.acc_time
        return params.acc_time if abs(wanted) > abs(now) else params.dec_time

    def _drive(self, seen: StatusSnapshot, speeds: WheelPair, now_s: float) -> Applied[WheelPair]:
        """Commands the wheels from the status ``seen``. After a longer pause the engine may have stopped them, and this
        would restart them: then it is rejected.
        """
        if speeds != REST and self._held_up(seen):
            return Applied(None, _HELD_UP)
        params = self._params
        present = self._commanded(seen)
        resting, turning = [], []
        rows = zip(
            params.axes, (present.left, present.right), (speeds.left, speeds.right), self._ramps_end_s, strict=True
        )
        for axis, now, wanted, end_s in rows:
            remaining_s = max(end_s - now_s, _SHORTEST_RAMP_S)
            if wanted:
                lifetime_s = self._timing.command_lifetime_s
                turning.append(requests.run_at(axis, now, wanted, remaining_s, params.dec_time, lifetime_s))
            else:
                resting.append(requests.rest(axis, remaining_s))

        accepted = self._engine.ask(_DRIVING, lambda engine: start(engine.core_motion, resting, turning))
        self._sent, self._sent_s = speeds if accepted else None, now_s
        if turning and self._held_up(seen):  # the call itself must not exceed this time either
            self._sent = None
            self.quick_stop()
            return Applied(None, _HELD_UP)
        return Applied(self._sent, "" if self._sent is not None else self._engine.refusal(_DRIVING, self._engine.text))

    def _held_up(self, seen: StatusSnapshot) -> bool:
        """True if the status is too old for a command by the engine's time, in which the wheels move."""
        now = self._engine.read()
        return now is None or now.engine_time_s - seen.engine_time_s > self._timing.follow_s

    def _commanded(self, snapshot: StatusSnapshot) -> WheelPair:
        return WheelPair(*snapshot.velocity_cmd[list(self._params.axes)].tolist())

    def quick_stop(self) -> str:
        """Stops both wheels in the engine at once. Returns the reason of a failure, or an empty text."""
        if self._engine.ask(
            _QUICK_STOP, lambda engine: engine.core_motion.velocity.ExecQuickStop_AxisSel(self._selection)
        ):
            return ""
        # If one wheel is not in velocity mode, each is stopped in its own mode.
        stopped = [self._engine.ask(_QUICK_STOP, requests.quick_stop(axis)) for axis in self._params.axes]
        return "" if all(stopped) else self._engine.refusal(_QUICK_STOP, "no engine to stop")

    def standing(self, snapshot: StatusSnapshot) -> bool:
        """True if both wheels stand, commanded and measured."""
        axes, slowest = list(self._params.axes), self._timing.standstill_radps
        return not snapshot.velocity_cmd[axes].any() and bool((abs(snapshot.actual_velocity[axes]) <= slowest).all())

    def servos_off(self) -> None:
        """Switches the servos off. Only for standing wheels."""
        self._start.switch_off()

    # --- details -----------------------------------------------------------------------------------------------------

    def _fault(self, snapshot: StatusSnapshot, text: str) -> tuple[Stage, str]:
        self._halt(snapshot)
        return Stage.FAULT, f"{text}; {_BY_HAND}"

    def _halt(self, snapshot: StatusSnapshot) -> None:
        """Requests a quick stop, unless both wheels are at rest or already in one."""
        states, details = snapshot.op_state, snapshot.flags[Flag.DETAIL_OP_STATE]
        if any(states[axis] != OperationState.Idle and details[axis] not in _HALTING for axis in self._params.axes):
            self.quick_stop()

    def _names(self, axes: list[int]) -> str:
        return " and ".join(_WHEELS[self._params.axes.index(axis)] for axis in axes)
