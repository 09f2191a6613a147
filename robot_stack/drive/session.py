"""The drive's session with the motion engine: from no connection to enabled servos, and back if the engine is lost.

``poll`` is called often and never blocks: it reads the engine's status and requests the next missing step. A fault
found while the drives were ready triggers the engine's emergency stop, until the release procedure of an emergency
stop is complete. A servo is switched on only with permission.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robot_stack.contract.frames import MODULES
from robot_stack.drive import axis_commands
from robot_stack.drive.hardware_params import DriveSessionParams
from robot_stack.drive.kinematics import ModuleSetPoints
from robot_stack.drive.wheel_axes import AxisSettings, DriveMove, SteerMove, drive_moves, steer_moves, stop_moves
from robot_stack.wmx.api import AxisCommandMode, EStopLevel
from robot_stack.wmx.axes import Real, StatusSnapshot
from robot_stack.wmx.config import EngineParameters
from robot_stack.wmx.device_opener import DeviceOpener, OpenEngine, PromptOpener
from robot_stack.wmx.session import Applied, EngineSession
from robot_stack.wmx.start_up import Machine, Missing, SessionState, Stage, StartUp

_SAME_ZERO_RAD = 1e-3
# Requests, as refusals name them.
_ESTOP, _RELEASE, _STEERING, _DRIVING = "emergency stop", "release", "steering", "driving"


@dataclass(frozen=True, slots=True)
class AxisMoves:
    """Moves that the engine executes."""

    drives: tuple[DriveMove, ...] = ()
    steers: tuple[SteerMove, ...] = ()


AppliedMoves = Applied[AxisMoves]


class DriveSession:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(
        self,
        open_engine: OpenEngine,
        params: DriveSessionParams,
        axes: AxisSettings,
        parameters: EngineParameters,
        parameter_file: str,
        *,
        opener: Callable[[OpenEngine], DeviceOpener] = PromptOpener,
    ) -> None:
        """open_engine, opener: see ``EngineSession``. axes: how set points become moves, including the time
        after which the engine stops a wheel without a new command. parameter_file: holds ``parameters``; imported into
        every new engine and read back.
        """
        self._engine = EngineSession(open_engine, params.patience(), opener=opener)
        drives, steers = axes.drive_axes, axes.steer_axes
        modules = tuple(zip(MODULES, drives, steers, strict=True))
        machine = Machine(
            {a: f"{name}_{part}" for name, *pair in modules for part, a in zip(("drive", "steer"), pair, strict=True)},
            dict.fromkeys(drives, AxisCommandMode.Velocity) | dict.fromkeys(steers, AxisCommandMode.Position),
            params.communication_retry_s,
            params.request_pause_s,
            parameter_file,
            parameters,
        )
        self._start = StartUp(
            self._engine,
            machine,
            fault=self._trip,
            standing=self.standing,
            withheld=lambda: "" if self._may_switch_on else "waiting for the safety monitor",
            connected=self._on_connection,
        )
        self._steps = (
            self._start.communication,
            self._parameters,
            self._stopping,
            self._start.alarms,
            self._start.servos,
            self._homed,
        )
        self._names = machine.names
        self._params, self._axes = params, axes
        self._drive_axes, self._steer_axes = list(drives), list(steers)
        self._stop = self._may_switch_on = False
        self._stopped = False
        self._tripped = ""
        self._zeros: list[float | None] | None = None  # of the steering, to which the controller's headings refer

    @property
    def state(self) -> SessionState:
        return self._start.state

    @property
    def ready(self) -> bool:
        return self._start.ready

    # --- the next step -----------------------------------------------------------------------------------------------

    def poll(self, now_s: float, *, stop: bool, may_switch_on: bool) -> SessionState:
        """Reads the status and requests the next missing step.

        stop: an emergency stop is in force. may_switch_on: servos may come on.
        """
        self._stop, self._may_switch_on = stop, may_switch_on
        self._stopped = self._stopped or stop
        return self._start.poll(now_s, self._steps)

    def _on_connection(self) -> None:
        self._tripped = ""
        self._zeros = None

    def _parameters(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        """Before an emergency stop is handled, because positions are invalid until then. Axes that still move, from a
        command of an earlier session, refuse an import; an emergency stop reaches them all the same.
        """
        missing = self._start.parameters(snapshot, now_s)
        if missing and self._stop and not snapshot.emergency_stop:
            self.emergency_stop()
        return missing

    def _stopping(self, snapshot: StatusSnapshot, now_s: float) -> Missing:
        if self._stop:
            self._zeros = self._zeros_of(snapshot)
            if not snapshot.emergency_stop:
                self.emergency_stop()
            self._start.clear_alarms(snapshot, now_s)  # the release waits for them
            return Stage.STOPPED, "emergency stop"
        if not snapshot.emergency_stop:
            if self._stopped:
                self._stopped = self._start.was_ready = False
                self._tripped = ""
            return None
        # Released by the safety monitor. A stop from before this session may belong to another client and is never
        # released.
        if self._stopped:
            if not self._may_switch_on:
                return Stage.STOPPED, "emergency stop, waiting for the safety monitor"
            self._engine.ask(_RELEASE, lambda engine: engine.core_motion.ReleaseEStop())
            return Stage.STOPPED, self._engine.refusal(_RELEASE, "emergency stop released")
        cause = self._tripped or "an emergency stop of another source"
        return Stage.TRIPPED, f"{cause}; needs an emergency stop and its release"

    def _homed(self, snapshot: StatusSnapshot, _: float) -> Missing:
        """The servos are on before, because homing needs them."""
        problem = self._homing_problem(snapshot)
        return (Stage.HOMING, problem) if problem else None

    def _homing_problem(self, snapshot: StatusSnapshot) -> str:
        """Why the steering must not move, else empty: its heading is unknown.

        Neither does steering that was homed since the last emergency stop: only there the controller replaces its set
        points by the measured headings, and the former ones refer to another zero.
        """
        zeros = self._zeros_of(snapshot)
        if self._zeros is None:
            self._zeros = zeros
        names = [self._names[axis] for axis in self._steer_axes]
        unknown = [name for name, zero in zip(names, zeros, strict=True) if zero is None]
        if unknown:
            return f"not homed: {', '.join(unknown)}; align the wheels and run robot-stack wmx home"
        homed = [n for n, zero, old in zip(names, zeros, self._zeros, strict=True) if not _same_zero(zero, old)]
        return f"homed: {', '.join(homed)}; needs an emergency stop and its release" if homed else ""

    def _zeros_of(self, snapshot: StatusSnapshot) -> list[float | None]:
        """Home offset of each steering axis, rad; None for one whose home is unknown."""
        offsets, done = snapshot.reals[Real.HOME_OFFSET], snapshot.home_done
        return [float(offsets[axis]) if done[axis] else None for axis in self._steer_axes]

    def _trip(self, _: StatusSnapshot, cause: str) -> tuple[Stage, str]:
        self._tripped = cause
        self.emergency_stop()
        return Stage.TRIPPED, cause

    # --- motion ------------------------------------------------------------------------------------------------------

    def follow(self, set_points: ModuleSetPoints) -> AppliedMoves:
        """Has wheels and headings at the set points when the next ones are due, or on their way there."""
        snapshot = self.look()
        if snapshot is None:
            return Applied(None, self._engine.problem if self.ready else self._not_ready)
        problem = self._homing_problem(snapshot)
        if problem:
            return Applied(None, problem)
        return self.move(
            drive_moves(set_points.speeds_mps, self.wheel_speeds_radps(snapshot), self._axes),
            steer_moves(set_points.angles_rad, snapshot.pos_cmd[self._steer_axes].tolist(), self._axes),
        )

    def stop_wheels(self, snapshot: StatusSnapshot) -> AppliedMoves:
        """Stops wheels without commands; headings stay."""
        velocities = self.wheel_speeds_radps(snapshot)
        if not self.ready or not any(velocities):
            return Applied(None)
        return self.move(stop_moves(velocities, self._axes), [])

    def move(self, drives: list[DriveMove], steers: list[SteerMove]) -> AppliedMoves:
        """Commands the axes. Headings go first: wheels that turn with headings that do not are worse than wheels that
        stand.
        """
        if not self.ready:
            return Applied(None, self._not_ready)
        engine, lifetime_s = self._engine, self._axes.command_lifetime_s
        if steers and not engine.ask(_STEERING, lambda device: axis_commands.steer(device.core_motion, steers)):
            return Applied(None, engine.refusal(_STEERING, engine.text))
        if drives and not engine.ask(
            _DRIVING, lambda device: axis_commands.drive(device.core_motion, drives, lifetime_s)
        ):
            return Applied(AxisMoves(steers=tuple(steers)), engine.refusal(_DRIVING, engine.text))
        return Applied(AxisMoves(tuple(drives), tuple(steers)))

    def look(self) -> StatusSnapshot | None:
        """The status at this moment; None if it is invalid or the session is not ready."""
        snapshot = self._engine.read() if self.ready else None
        return snapshot if snapshot is not None and snapshot.communicating else None

    def emergency_stop(self) -> str:
        """Stops everything in the engine, at once and latched. Returns the error, an empty text on success."""
        done = self._engine.ask(_ESTOP, lambda engine: engine.core_motion.ExecEStop(EStopLevel.Level1))
        return "" if done else self._engine.refusal(_ESTOP, "no engine to stop")

    def standing(self, snapshot: StatusSnapshot) -> bool:
        speeds = np.abs(snapshot.actual_velocity[self._drive_axes])
        return bool((speeds <= self._params.standstill_radps).all())

    def wheel_speeds_radps(self, snapshot: StatusSnapshot) -> list[float]:
        """Commanded speeds of the wheels, by module."""
        speeds: list[float] = snapshot.velocity_cmd[self._drive_axes].tolist()
        return speeds

    def servos_off(self) -> None:
        """Closes the holding brakes. Only for standing wheels."""
        self._start.switch_off()

    def close(self) -> None:
        """Closes the device; wheels that still turn stop at the end of their last command's time."""
        self._engine.close()

    @property
    def _not_ready(self) -> str:
        return f"not ready: {self.state.text}"


def _same_zero(zero: float | None, other: float | None) -> bool:
    return zero is not None and other is not None and abs(zero - other) <= _SAME_ZERO_RAD
