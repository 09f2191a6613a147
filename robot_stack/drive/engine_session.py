"""One session with the motion engine: from no engine at all to servos that are on, and back again whenever it is lost.

``poll`` is called often and never waits: it looks at the engine's status and asks for the next thing that is missing.
What it finds broken while the drives were ready trips: the engine's emergency stop, until somebody has gone through the
release of an emergency stop. A servo is switched on only with permission.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from robot_stack.contract.frames import DRIVE_AXES, JOINTS
from robot_stack.drive.wheel_axes import DriveMove, SteerMove
from robot_stack.wmx import EngineError, MotionEngine
from robot_stack.wmx.api import (
    AxisCommandMode,
    AxisSelection,
    ErrorCode,
    EStopLevel,
    Motion_PosCommand,
    Profile,
    Velocity_VelCommand,
    error_name,
)
from robot_stack.wmx.axes import BoolRow, StatusSnapshot

_N_AXES = len(JOINTS)
_MODES = np.array(
    [AxisCommandMode.Velocity if axis in DRIVE_AXES else AxisCommandMode.Position for axis in range(_N_AXES)]
)
# An engine that is not there yet is waited for; it refuses nothing.
_ABSENT = (ErrorCode.IMLibIsNotRunning, ErrorCode.EngineNotStartedInSpecifiedTime, ErrorCode.CreateDeviceLockError)
# After these the device is worthless: the engine has ended, or was stopped by somebody.
_LOST = (ErrorCode.IMLibIsNotRunning, ErrorCode.DeviceIsNull)

# Requests, as refusals name them.
_STATUS, _WATCHDOG, _COMMUNICATION = "engine status", "engine watchdog", "starting communication"
_ESTOP, _RELEASE, _SERVO_ON, _STEERING, _DRIVING = "emergency stop", "release", "servo on", "steering", "driving"


class Stage(Enum):
    """How far the session is."""

    CONNECTING = "connecting"
    COMMUNICATION = "starting communication"
    STOPPED = "emergency stop"
    TRIPPED = "tripped"
    SWITCHING_ON = "switching on"
    READY = "ready"


@dataclass(frozen=True, slots=True)
class SessionSettings:
    """absent_retry_s: between looks for an engine that does not run. attempts, attempt_pause_s: of opening a device
    that the engine refuses; after so many it is told, and goes on. communication_retry_s, request_pause_s: between
    repetitions of a request that has not been fulfilled. feed_period_s, watchdog_s: the engine stops the axes of a
    session that is silent for so long. standstill_radps: a slower wheel stands.
    """

    absent_retry_s: float
    attempts: int
    attempt_pause_s: float
    communication_retry_s: float
    request_pause_s: float
    feed_period_s: float
    watchdog_s: float
    standstill_radps: float


@dataclass(frozen=True, slots=True)
class SessionState:
    """snapshot: the engine's present status, None while there is none that can be trusted."""

    stage: Stage
    text: str
    snapshot: StatusSnapshot | None = None


class EngineSession:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(self, open_engine: Callable[[], MotionEngine], settings: SessionSettings) -> None:
        """open_engine: opens a device without waiting, raises EngineError."""
        self._open_engine = open_engine
        self._settings = settings
        self._engine: MotionEngine | None = None
        self._pauses: dict[str, tuple[float, float]] = {}
        self._refused = 0
        self._connection = "waiting for the motion engine"
        self._refusals: dict[str, str] = {}
        self._was_ready = False
        self._stopped = False
        self._tripped = ""
        self._state = SessionState(Stage.CONNECTING, "waiting for the motion engine")

    @property
    def state(self) -> SessionState:
        return self._state

    @property
    def ready(self) -> bool:
        return self._state.stage is Stage.READY

    # --- the next step -----------------------------------------------------------------------------------------------

    def poll(self, now_s: float, *, stop: bool, may_switch_on: bool) -> SessionState:
        """Looks, and asks for what is missing.

        stop: an emergency stop is in force. may_switch_on: servos may come on.
        """
        self._state = self._next(now_s, stop, may_switch_on)
        self._was_ready = self._was_ready or self.ready
        return self._state

    def _next(self, now_s: float, stop: bool, may_switch_on: bool) -> SessionState:
        self._stopped = self._stopped or stop
        if self._engine is None and not self._connect(now_s):
            return SessionState(Stage.CONNECTING, self._connection)
        snapshot = self._read(now_s)
        if snapshot is None:
            return SessionState(Stage.CONNECTING, self._refusals.get(_STATUS, self._connection))
        stage, text = (
            self._communication(snapshot, now_s)
            or self._stopping(snapshot, now_s, stop, may_switch_on)
            or self._alarms(snapshot, now_s)
            or self._servos(snapshot, now_s, may_switch_on)
            or (Stage.READY, "ready")
        )
        if self._engine is None:  # lost on the way
            return SessionState(Stage.CONNECTING, self._connection)
        return SessionState(stage, text, snapshot if snapshot.communicating else None)

    def _connect(self, now_s: float) -> bool:
        if not self._due("connect", now_s, self._settings.absent_retry_s):
            return False
        try:
            self._engine = self._open_engine()
        except EngineError as error:
            self._refuse_connection(error, now_s)
            return False
        self._refused, self._connection = 0, "connected"
        self._was_ready, self._tripped = False, ""
        self._pauses.clear()  # what was asked of an engine before this one does not count
        watchdog_ms = round(1e3 * self._settings.watchdog_s)
        return self._ask(_WATCHDOG, lambda engine: engine.api.SetWatchdog(watchdog_ms))

    def _refuse_connection(self, error: EngineError, now_s: float) -> None:
        if error.code in _ABSENT:
            self._connection = "waiting for the motion engine"
            return
        self._refused += 1
        self._pause("connect", now_s, self._settings.attempt_pause_s)
        if self._refused < self._settings.attempts:
            self._connection = f"attempt {self._refused} of {self._settings.attempts}: {error}"
        else:
            self._connection = f"{self._refused} attempts failed, still trying: {error}"

    def _read(self, now_s: float) -> StatusSnapshot | None:
        if self._due(_WATCHDOG, now_s, self._settings.feed_period_s):
            fed = self._ask(_WATCHDOG, lambda engine: engine.api.ResetWatchdogTimer())
            if not fed:  # an engine that hangs holds every call up: do not spend all time on it
                self._pause(_WATCHDOG, now_s, self._settings.attempt_pause_s)
        if self._engine is None:
            return None
        code, snapshot = self._engine.read_status()
        if not code and snapshot.n_axes < _N_AXES:
            code = ErrorCode.AxisOutOfRange
        self._heed(_STATUS, code)
        return None if code else snapshot

    def _communication(self, snapshot: StatusSnapshot, now_s: float) -> tuple[Stage, str] | None:
        if snapshot.communicating:
            return None
        if self._due("communication", now_s, self._settings.communication_retry_s):
            self._ask(_COMMUNICATION, lambda engine: engine.api.StartCommunication(0))
        text = "communication with the drives is lost" if self._was_ready else "the engine does not communicate yet"
        return Stage.COMMUNICATION, self._refusals.get(_COMMUNICATION, text)

    def _stopping(
        self, snapshot: StatusSnapshot, now_s: float, stop: bool, may_switch_on: bool
    ) -> tuple[Stage, str] | None:
        if stop:
            if not snapshot.emergency_stop:
                self.emergency_stop()
            self._clear_alarms(snapshot, now_s)  # they are what the release waits for
            return Stage.STOPPED, "emergency stop"
        if not snapshot.emergency_stop:
            if self._stopped:
                self._stopped = self._was_ready = False
                self._tripped = ""
            return None
        # Released by the safety monitor, or left over from a session before this one.
        if self._stopped or not self._was_ready:
            if not may_switch_on:
                return Stage.STOPPED, "emergency stop, waiting for the safety monitor"
            self._ask(_RELEASE, lambda engine: engine.core_motion.ReleaseEStop())
            return Stage.STOPPED, self._refusals.get(_RELEASE, "emergency stop released")
        cause = self._tripped or "an emergency stop that nobody here asked for"
        return Stage.TRIPPED, f"{cause}; needs an emergency stop and its release"

    def _alarms(self, snapshot: StatusSnapshot, now_s: float) -> tuple[Stage, str] | None:
        faults = _faults(snapshot)
        if not faults:
            return None
        if self._was_ready:
            return self._trip(faults)
        self._clear_alarms(snapshot, now_s)
        return Stage.SWITCHING_ON, faults

    def _servos(self, snapshot: StatusSnapshot, now_s: float, may_switch_on: bool) -> tuple[Stage, str] | None:
        off = _axes(~snapshot.servo_on)
        if not off:
            return None
        text = f"servo off: {_names(off)}"
        if self._was_ready:
            return self._trip(text)
        if not may_switch_on:
            return Stage.SWITCHING_ON, f"{text}; waiting for the safety monitor"
        if self._due("servo", now_s, self._settings.request_pause_s) and self._set_modes(snapshot):
            selection = AxisSelection.of(*off)
            self._ask(_SERVO_ON, lambda engine: engine.core_motion.axisControl.SetServoOn_AxisSel(selection, 1))
        return Stage.SWITCHING_ON, self._refusals.get(_SERVO_ON, text)

    def _set_modes(self, snapshot: StatusSnapshot) -> bool:
        def set_mode(axis: int) -> bool:
            mode = int(_MODES[axis])
            return self._ask(
                f"command mode of {JOINTS[axis]}",
                lambda engine: engine.core_motion.axisControl.SetAxisCommandMode(axis, mode),
            )

        return all(set_mode(axis) for axis in _axes(snapshot.command_mode[:_N_AXES] != _MODES))

    def _clear_alarms(self, snapshot: StatusSnapshot, now_s: float) -> None:
        """Asks the drives to forget their alarms, once the wheels stand. Nothing moves by it: the servos are off."""
        amplifier, following = _axes(snapshot.amp_alarm), _axes(snapshot.following_error_alarm)
        if not (amplifier or following) or not self.standing(snapshot):
            return
        if not self._due("alarms", now_s, self._settings.request_pause_s):
            return
        of_drives, of_engine = AxisSelection.of(*amplifier), AxisSelection.of(*following)
        if amplifier:
            self._ask("clearing alarms", lambda engine: engine.core_motion.axisControl.ClearAmpAlarm_AxisSel(of_drives))
        if following:
            self._ask(
                "clearing alarms", lambda engine: engine.core_motion.axisControl.ClearAxisAlarm_AxisSel(of_engine)
            )

    # --- motion ------------------------------------------------------------------------------------------------------

    def move(self, drives: list[DriveMove], steers: list[SteerMove]) -> str:
        """Commands the axes. Returns why it could not be done, an empty text if it was. Headings go first: wheels that
        turn with headings that do not are worse than wheels that stand.
        """
        if not self.ready:
            return f"not ready: {self._state.text}"
        headings, wheels = [_position(move) for move in steers], [_velocity(move) for move in drives]
        if headings and not self._ask(
            _STEERING, lambda engine: engine.core_motion.motion.StartPos(len(headings), headings)
        ):
            return self._refusals.get(_STEERING, self._connection)
        if wheels and not self._ask(_DRIVING, lambda engine: engine.core_motion.velocity.StartVel(len(wheels), wheels)):
            return self._refusals.get(_DRIVING, self._connection)
        return ""

    def look(self) -> StatusSnapshot | None:
        """The status at this moment; None if it cannot be trusted or the session is not ready."""
        if self._engine is None or not self.ready:
            return None
        code, snapshot = self._engine.read_status()
        return snapshot if not code and snapshot.communicating else None

    def emergency_stop(self) -> str:
        """Stops everything in the engine, at once and latched. Returns why it could not, an empty text if it could."""
        done = self._ask(_ESTOP, lambda engine: engine.core_motion.ExecEStop(EStopLevel.Level1))
        return "" if done else self._refusals.get(_ESTOP, "no engine to stop")

    def standing(self, snapshot: StatusSnapshot) -> bool:
        speeds = np.abs(snapshot.actual_velocity[list(DRIVE_AXES)])
        return bool((speeds <= self._settings.standstill_radps).all())

    def servos_off(self) -> None:
        """The holding brakes close. Only for wheels that stand."""
        axes = AxisSelection.of(*range(_N_AXES))
        self._ask("servo off", lambda engine: engine.core_motion.axisControl.SetServoOn_AxisSel(axes, 0))

    def close(self) -> None:
        """Gives the device back; the engine stops what still moves."""
        if self._engine is not None:
            engine, self._engine = self._engine, None
            engine.close()

    # --- details -----------------------------------------------------------------------------------------------------

    def _trip(self, cause: str) -> tuple[Stage, str]:
        self._tripped = cause
        self.emergency_stop()
        return Stage.TRIPPED, cause

    def _due(self, request: str, now_s: float, pause_s: float) -> bool:
        """True once, then not before ``pause_s`` have passed. Time that ran back makes everything due."""
        asked_s, due_s = self._pauses.get(request, (now_s, now_s))
        if asked_s <= now_s < due_s:
            return False
        self._pause(request, now_s, pause_s)
        return True

    def _pause(self, request: str, now_s: float, pause_s: float) -> None:
        self._pauses[request] = now_s, now_s + pause_s

    def _ask(self, what: str, request: Callable[[MotionEngine], int]) -> bool:
        """One request to the engine; False if there is none, or if it refused, for the reason in ``_refusals``."""
        return self._engine is not None and self._heed(what, request(self._engine))

    def _heed(self, what: str, code: int) -> bool:
        if not code:
            self._refusals.pop(what, None)
            return True
        self._refusals[what] = f"{what}: {error_name(code)} (error {code})"
        if code in _LOST:
            self._connection = "the motion engine has ended"
            self._refusals.clear()
            self.close()
        return False


def _position(move: SteerMove) -> Motion_PosCommand:
    acceleration = move.acceleration_radps2
    return Motion_PosCommand(
        move.axis, move.target_rad, Profile.SetupTrapezoidal(move.rate_radps, acceleration, acceleration)
    )


def _velocity(move: DriveMove) -> Velocity_VelCommand:
    acceleration = move.acceleration_radps2
    return Velocity_VelCommand(move.axis, Profile.SetupTrapezoidal(move.velocity_radps, acceleration, acceleration))


def _axes(wrong: BoolRow) -> list[int]:
    return [int(axis) for axis in np.flatnonzero(wrong[:_N_AXES])]


def _names(axes: list[int]) -> str:
    return ", ".join(JOINTS[axis] for axis in axes)


def _faults(snapshot: StatusSnapshot) -> str:
    alarms, following = _axes(snapshot.amp_alarm), _axes(snapshot.following_error_alarm)
    texts = [f"{JOINTS[axis]} alarm {int(snapshot.amp_alarm_code[axis])}" for axis in alarms]
    return ", ".join([*texts, *(f"{JOINTS[axis]} following error" for axis in following)])
