"""The safety monitor: inputs in, verdict out. Time is an argument; ROS, files and clocks are not used here."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.contract import faults, topics
from robot_stack.core.limits import SpeedLimit
from robot_stack.core.robot import Motion, Robot
from robot_stack.core.stop_presence import Presence
from robot_stack.safety.arbiter import Verdict, arbitrate
from robot_stack.safety.conditions import CONDITIONS, stale_s, stale_sight_limit, unseen_limit
from robot_stack.safety.observation import Observation
from robot_stack.safety.params import SafetyParams
from robot_stack.safety.rows import ActiveRow, Row
from robot_stack.safety.stop_sources import Press

ESTOP_PRESSED = "ESTOP_PRESSED"


@dataclass(frozen=True, slots=True)
class Memory:
    """State that must survive a restart of the monitor: codes of the latched rows, whether a passenger is aboard, and
    which sources of the emergency stop are pressed.
    """

    latched: tuple[str, ...] = ()
    passenger: bool = False
    presses: tuple[Press, ...] = ()


@dataclass(frozen=True, slots=True)
class ResetAnswer:
    """Answer to the second key. message: the released rows, or the missing conditions."""

    success: bool
    message: str


class SafetyMonitor:
    """Feed ``observation`` every message, then ``step``. All times are steady seconds.

    nearest_obstacle_m: from the footprint at the last step; infinite without an obstacle, NaN while unknown.
    """

    def __init__(self, params: SafetyParams, robot: Robot, memory: Memory, now_s: float) -> None:
        self._params = params
        self._own, self._with_passenger = _speed_limit(robot.empty), _speed_limit(robot.with_passenger)
        # A latch of a row that is not configured is held by the row that every configuration has.
        latched = {code if code in params.rows else ESTOP_PRESSED for code in memory.latched}
        self._rows = [Row(fault, fault.code in latched) for fault in faults.FAULTS if fault.code in params.rows]
        self.observation = Observation(params, robot, now_s, memory.passenger, memory.presses)
        self.nearest_obstacle_m = math.nan

    @property
    def rows(self) -> tuple[str, ...]:
        """Codes of the rows that are evaluated, in the order of the contract."""
        return tuple(row.code for row in self._rows)

    @property
    def passenger(self) -> bool:
        """A wheelchair is attached, or ``/passenger_attached`` says so; once true, silence keeps it true."""
        return self.observation.chair.carried

    @property
    def emergency(self) -> bool:
        """True while an emergency stop is latched."""
        return any(row.latched for row in self._rows)

    @property
    def button_pressed(self) -> bool:
        """The hardware stop is pressed; a contact that became unreadable counts as pressed."""
        return self.observation.button.pressed is True

    @property
    def memory(self) -> Memory:
        """The state that must survive a restart."""
        latched = tuple(row.code for row in self._rows if row.latched)
        return Memory(latched, self.passenger, self.observation.sources.presses)

    @property
    def details(self) -> dict[str, str]:
        """Why each row in force was raised, by its code."""
        return {row.code: row.detail for row in self._active()}

    def step(self, now_s: float) -> Verdict:
        """Judges every row on the present inputs."""
        snapshot = self.observation.snapshot(self.emergency, now_s)
        self.nearest_obstacle_m = math.nan if snapshot.prediction is None else snapshot.prediction.nearest_m
        for row in self._rows:
            row.update(CONDITIONS[row.code](snapshot, self._params, row.action), now_s)
        passenger = self._with_passenger if self.passenger else None
        unseen = unseen_limit(snapshot, self._params)
        stale_sight = stale_sight_limit(snapshot, self._params)
        verdict = arbitrate(
            self._active(), self._own, passenger, unseen, snapshot.undocking, snapshot.docking, stale_sight
        )
        self.observation.limited(verdict.limit, now_s)
        return verdict

    def pressed_by(self, now_s: float) -> dict[str, Presence]:
        """The sources with a standing press, and whether each is present to release it."""
        return self.observation.sources.presence(now_s)

    def clear(self, source: str, now_s: float) -> ResetAnswer:
        """Clears the press of a source that cannot release itself, for an operator. This is no reset."""
        problem = self.observation.sources.clear(source, now_s)
        return ResetAnswer(False, f"refused: {problem}") if problem else ResetAnswer(True, f"cleared: {source}")

    def reset(self, now_s: float) -> ResetAnswer:
        """The second key: leaves the emergency stop, or returns why not. Call ``step`` afterwards."""
        self.step(now_s)
        if not self.emergency:
            return ResetAnswer(True, "no emergency stop is latched")
        missing = [*self._missing_release(now_s), *self._missing_standstill(now_s), *filter(None, self._blocking())]
        if missing:
            return ResetAnswer(False, "refused: " + "; ".join(missing))
        released = [row for row in self._rows if row.latched]
        for row in released:
            row.release()
        self.observation.drive.released(now_s)
        return ResetAnswer(True, f"released: {', '.join(row.code for row in released)}")

    def _active(self) -> list[ActiveRow]:
        return [active for row in self._rows if (active := row.active()) is not None]

    def _blocking(self) -> list[str]:
        return [row.blocks_release() for row in self._rows]

    def _missing_release(self, now_s: float) -> list[str]:
        """The first key. A source with a held button repeats true within the settling time after any false."""
        if self.observation.estop.pressed is None:
            needed = ESTOP_PRESSED in self.memory.latched
            return ["/emergency_stop has not been released: no false since the monitor's start"] if needed else []
        released_for_s = self.observation.estop.released_for_s(now_s)
        if released_for_s is None:
            return []  # still pressed: its row reports this
        if not released_for_s >= self._params.release_settle_s:
            return [f"/emergency_stop has been false for less than {self._params.release_settle_s:g} s"]
        return []

    def _missing_standstill(self, now_s: float) -> list[str]:
        still_for_s = self.observation.wheels.still_for_s(now_s, stale_s(topics.JOINT_STATES))
        if still_for_s is not None and still_for_s >= self._params.standstill_hold_s:
            return []
        wanted = f"every wheel below {self._params.standstill_mps:g} m/s for {self._params.standstill_hold_s:g} s"
        return [f"the robot is not at standstill ({wanted}, by fresh /joint_states)"]


def _speed_limit(motion: Motion) -> SpeedLimit:
    return SpeedLimit(motion.max_speed_mps, motion.max_yaw_rate_radps)
