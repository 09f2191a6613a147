"""The start of a machine on a session with the engine: the steps that machines share, in an order of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from robot_stack.wmx.api import AxisCommandMode, AxisSelection
from robot_stack.wmx.axes import BoolRow, StatusSnapshot
from robot_stack.wmx.config import EngineParameters
from robot_stack.wmx.read_back import differences
from robot_stack.wmx.session import EngineSession

# Requests, as refusals name them.
_PARAMETERS, _CLEARING, _MODE, _SERVO_ON = "parameter file", "clearing alarms", "command mode", "servo on"
_REPORTED = 3
_NO_BUS_YET, _BUS_LOST = "the engine does not communicate yet", "communication with the drives is lost"


class Stage(Enum):
    """Progress of a session."""

    CONNECTING = "connecting"
    COMMUNICATION = "starting communication"
    PARAMETERS = "setting parameters"
    STOPPED = "emergency stop"
    TRIPPED = "tripped"
    FAULT = "fault"
    SWITCHING_ON = "switching on"
    HOMING = "not homed"
    STOPPING = "stopping"
    READY = "ready"


Missing = tuple[Stage, str] | None
"""The stage of an unfulfilled step and the reason; None for a fulfilled one."""
Step = Callable[[StatusSnapshot, float], Missing]
"""(status, now), after requesting the missing step."""


@dataclass(frozen=True, slots=True)
class SessionState:
    """snapshot: the engine's present status, None without a valid one."""

    stage: Stage
    text: str
    snapshot: StatusSnapshot | None = None

    @property
    def ready(self) -> bool:
        return self.stage is Stage.READY

    @property
    def stopped(self) -> bool:
        """An emergency stop is in force, which is no failure of the session."""
        return self.stage is Stage.STOPPED


@dataclass(frozen=True, slots=True)
class Machine:
    """Axes that start together. names, used in reports, and command modes: by the numbers of the axes.

    parameter_file: the engine's parameter XML, empty for none. parameters: its values, which are read back after the
    import; None: they are not read back. communication_retry_s, request_pause_s: between
    repetitions of an unfulfilled request. restarts: after the loss of the bus the servos are switched on again;
    otherwise they have dropped out, which is a fault.
    """

    names: Mapping[int, str]
    modes: Mapping[int, AxisCommandMode]
    communication_retry_s: float
    request_pause_s: float
    parameter_file: str = ""
    parameters: EngineParameters | None = None
    restarts: bool = False


class StartUp:
    """Checks a list of steps at every poll: the first unfulfilled one gives the stage, and is requested.

    A step that is lost again is requested again, except that an alarm or a dropped servo of a machine that was ready is
    a fault. ``was_ready``: since the connection or, if its owner clears it, since a stop. ``switched_on``: the axes
    whose servos were requested on since the connection.
    """

    def __init__(
        self,
        session: EngineSession,
        machine: Machine,
        *,
        fault: Callable[[StatusSnapshot, str], tuple[Stage, str]],
        standing: Callable[[StatusSnapshot], bool],
        withheld: Callable[[], str] = str,
        connected: Callable[[], None] = lambda: None,
    ) -> None:
        """fault: stops a machine that was ready. standing: alarms are cleared only then. withheld: why no servo may
        come on now, else empty. connected: called for every new device.
        """
        self._session, self._machine, self._connected = session, machine, connected
        self._fault, self._standing, self._withheld = fault, standing, withheld
        self._connection = 0
        self._parameters_set = False
        self._wrong_parameters = ""
        self._bus = _NO_BUS_YET
        self.was_ready = False
        self.switched_on: set[int] = set()
        self.state = SessionState(Stage.CONNECTING, session.text)

    @property
    def ready(self) -> bool:
        return self.state.stage is Stage.READY

    def poll(self, now_s: float, steps: Sequence[Step]) -> SessionState:
        """Reads the status and requests the next missing step."""
        self.state = self._polled(now_s, steps)
        self.was_ready = self.was_ready or self.ready
        return self.state

    def _polled(self, now_s: float, steps: Sequence[Step]) -> SessionState:
        session, axes = self._session, tuple(self._machine.names)
        session.poll(now_s)
        if session.connections != self._connection:
            self._connection = session.connections
            self.was_ready = self._parameters_set = False
            self._wrong_parameters = ""
            self._bus = _NO_BUS_YET
            self.switched_on.clear()
            self._connected()
        snapshot = session.read()
        if snapshot is None:
            return SessionState(Stage.CONNECTING, session.problem)
        if snapshot.n_axes <= max(axes):
            return SessionState(Stage.CONNECTING, f"axes {axes} of an engine with {snapshot.n_axes}")
        missing = (step(snapshot, now_s) for step in steps)
        stage, text = next(filter(None, missing), (Stage.READY, "ready"))
        if session.engine is None:  # lost during a step
            return SessionState(Stage.CONNECTING, session.problem)
        valid = snapshot.communicating and stage is not Stage.PARAMETERS  # without its parameters, positions are counts
        return SessionState(stage, text, snapshot if valid else None)

    # --- steps -------------------------------------------------------------------------------------------------------

    def communication(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        if snapshot.communicating:
            return None
        if self.was_ready:
            self._bus = _BUS_LOST
            self.was_ready = not self._machine.restarts
        pause_s = self._machine.communication_retry_s
        return Stage.COMMUNICATION, self._session.start_communication(now_s, pause_s, self._bus)

    def parameters(self, _: StatusSnapshot, now_s: float) -> Missing:
        """Before the servos: without its parameters an axis has the wrong gear. An engine whose parameters are not the
        file's is a start error; the import is repeated.
        """
        path = self._machine.parameter_file
        if self._parameters_set or not path:
            return None
        what = f"{_PARAMETERS} {path}"
        if self._session.due(what, now_s, self._machine.communication_retry_s):
            imported = self._session.ask(what, lambda engine: engine.core_motion.config.ImportAndSetAll(path))
            self._wrong_parameters = self._read_back() if imported else ""
            self._parameters_set = imported and not self._wrong_parameters
        if self._parameters_set:
            return None
        return Stage.PARAMETERS, self._wrong_parameters or self._session.refusal(what, what)

    def _read_back(self) -> str:
        """The first differences between the engine's parameters and the machine's; empty for none."""
        expected, engine = self._machine.parameters, self._session.engine
        if expected is None or engine is None:
            return ""
        wrong = list(differences(engine, expected, self._machine.names))
        more = f"; and {len(wrong) - _REPORTED} more" if len(wrong) > _REPORTED else ""
        return "; ".join(wrong[:_REPORTED]) + more

    def alarms(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        faults = ", ".join(
            [
                *(f"{name} alarm {int(snapshot.amp_alarm_code[axis])}" for axis, name in self._of(snapshot.amp_alarm)),
                *(f"{name} following error" for _, name in self._of(snapshot.following_error_alarm)),
            ]
        )
        if not faults:
            return None
        if self.was_ready:
            return self._fault(snapshot, faults)
        self.clear_alarms(snapshot, now_s)
        return Stage.SWITCHING_ON, self._session.refusal(_CLEARING, faults)

    def modes(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        wrong = self.wrong_modes(snapshot)
        if not wrong:
            return None
        if self._session.due(_MODE, now_s, self._machine.request_pause_s):
            self._set_modes(snapshot)
        text = f"wrong command mode: {', '.join(self._machine.names[axis] for axis in wrong)}"
        return Stage.SWITCHING_ON, self._session.refusal(_MODE, text)

    def servos(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        """Modes are set before the servos come on."""
        off = self._of(~snapshot.servo_on)
        if not off:
            return None
        text = f"servo off: {', '.join(name for _, name in off)}"
        if self.was_ready:
            return self._fault(snapshot, text)
        withheld = self._withheld()
        if withheld:
            return Stage.SWITCHING_ON, f"{text}; {withheld}"
        if self._session.due(_SERVO_ON, now_s, self._machine.request_pause_s) and self._set_modes(snapshot):
            self.switched_on.update(axis for axis, _ in off)
            self._switch(_SERVO_ON, [axis for axis, _ in off], 1)
        return Stage.SWITCHING_ON, self._session.refusal(_SERVO_ON, self._session.refusal(_MODE, text))

    # --- requests ----------------------------------------------------------------------------------------------------

    def clear_alarms(self, snapshot: StatusSnapshot, now_s: float) -> None:
        """Clears the alarms of drives and engine. Only for standing axes; it moves nothing: the servos are off."""
        amplifier, following = self._of(snapshot.amp_alarm), self._of(snapshot.following_error_alarm)
        if not (amplifier or following) or not self._standing(snapshot):
            return
        if not self._session.due(_CLEARING, now_s, self._machine.request_pause_s):
            return
        of_drives = AxisSelection.of(*(axis for axis, _ in amplifier))
        of_engine = AxisSelection.of(*(axis for axis, _ in following))
        ask = self._session.ask
        if amplifier:
            ask(_CLEARING, lambda engine: engine.core_motion.axisControl.ClearAmpAlarm_AxisSel(of_drives))
        if following:
            ask(_CLEARING, lambda engine: engine.core_motion.axisControl.ClearAxisAlarm_AxisSel(of_engine))

    def switch_off(self, axes: Iterable[int] | None = None) -> None:
        """Switches servos off, all without ``axes``; holding brakes close. Only for axes at rest."""
        self._switch("servo off", self._machine.names if axes is None else axes, 0)

    def wrong_modes(self, snapshot: StatusSnapshot) -> list[int]:
        """The axes that are not in their command mode."""
        return [axis for axis, mode in self._machine.modes.items() if snapshot.command_mode[axis] != mode]

    def _set_modes(self, snapshot: StatusSnapshot) -> bool:
        modes = self._machine.modes

        def set_mode(axis: int) -> bool:
            return self._session.ask(
                _MODE, lambda engine: engine.core_motion.axisControl.SetAxisCommandMode(axis, modes[axis])
            )

        return all(set_mode(axis) for axis in self.wrong_modes(snapshot))

    def _switch(self, what: str, axes: Iterable[int], on: int) -> None:
        selection = AxisSelection.of(*axes)
        self._session.ask(what, lambda engine: engine.core_motion.axisControl.SetServoOn_AxisSel(selection, on))

    def _of(self, wrong: BoolRow) -> list[tuple[int, str]]:
        """The axes marked in ``wrong``, with their names."""
        return [(axis, name) for axis, name in self._machine.names.items() if wrong[axis]]
