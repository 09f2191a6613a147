"""Which state of the external display (EHMIState.state_num) goes with what the mission manager does.

The mission manager speaks for docking too, with a mission or without one, so that the display hears one voice.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import IntEnum

from robot_stack.mission.docking import Task
from robot_stack.mission.events import Inputs
from robot_stack.mission.model import Kind
from robot_stack.mission.record import Record
from robot_stack.mission.states import AT_DOCK, UNDER_WAY, State


class Display(IntEnum):
    """The states of the display that the mission manager can ask for."""

    IDLE = 1
    NAVIGATING = 2
    PAUSED = 3
    ERROR = 5
    EMERGENCY_STOP = 6
    LOCALIZATION_LOST = 8
    LOW_BATTERY = 9
    OBSTACLE = 10
    APPROACHING_CHAIR = 21
    DOCKING = 22
    DOCKING_COMPLETE = 23
    PASSENGER_ONBOARD = 24
    TRANSPORT = 25
    DESTINATION_REACHED = 26
    PASSENGER_DISEMBARK = 27
    DOCKING_FAILED = 28


_OBSTACLE_FAULTS = frozenset({"COLLISION_IMMINENT", "OBSTACLE_NEAR"})
# States of /docking/status, and of the action's feedback, in which the robot aims at a board.
_ALIGNING = frozenset({"SEARCH", "SERVOING", "FINE_ALIGN"})


@dataclass(frozen=True, slots=True)
class Docking:
    """What the display needs to know about docking.

    task: of the current waypoint, None if it has none. state: of the present call's feedback, empty before any.
    """

    task: Task | None = None
    state: str = ""


class Announcements:
    """Steps that last no time, shown one after the other for a while."""

    def __init__(self, each_s: float) -> None:
        self._each_s = each_s
        self._queue: deque[Display] = deque()
        self._shown_s = 0.0

    def say(self, *displays: Display) -> None:
        """Replaces what is still to be shown."""
        self._queue, self._shown_s = deque(displays if self._each_s > 0.0 else ()), 0.0

    def elapse(self, dt_s: float) -> None:
        self._shown_s += dt_s
        if self._queue and self._shown_s >= self._each_s:
            self._queue.popleft()
            self._shown_s = 0.0

    @property
    def current(self) -> Display | None:
        return self._queue[0] if self._queue else None


def announced_at_end_of(task: Task) -> tuple[Display, ...]:
    """What a task that succeeded is worth telling."""
    if task.kind is Kind.DOCK:
        return (Display.DOCKING_COMPLETE, Display.PASSENGER_ONBOARD) if task.carried else (Display.DOCKING_COMPLETE,)
    return (Display.PASSENGER_DISEMBARK,) if task.carried else ()


def announced_at_begin_of(task: Task) -> tuple[Display, ...]:
    return (Display.DESTINATION_REACHED,) if task.kind is Kind.UNDOCK and task.carried else ()


def display_of(
    record: Record,
    inputs: Inputs,
    *,
    emergency: bool,
    battery_low: bool,
    docking: Docking = Docking(),
    announced: Display | None = None,
) -> Display:
    if emergency:
        return Display.EMERGENCY_STOP
    if record.state in UNDER_WAY:
        hindrance = _hindrance(record, inputs)
        return hindrance or announced or _under_way(record, docking)
    if record.state in (State.PAUSED, State.STOPPED):
        return Display.PAUSED
    if record.state is State.FAILED:
        failed_dock = record.docking_begun and docking.task is not None and docking.task.kind is Kind.DOCK
        return Display.DOCKING_FAILED if failed_dock else Display.ERROR
    if announced is not None and record.state is State.COMPLETED:
        return announced
    return _at_rest(record, inputs, battery_low)


def _hindrance(record: Record, inputs: Inputs) -> Display | None:
    # At a dock the robot goes by the dock's markers.
    lost = inputs.pose is None or "LOCALIZATION_LOST" in inputs.faults
    if lost and record.state not in AT_DOCK:
        return Display.LOCALIZATION_LOST
    return Display.OBSTACLE if _OBSTACLE_FAULTS.intersection(inputs.faults) else None


def _under_way(record: Record, docking: Docking) -> Display:
    task = docking.task
    to_a_chair = task is not None and task.carried and task.kind is Kind.DOCK
    if record.state is State.DOCKING:
        if docking.state == "DOCKED":
            return Display.DOCKING_COMPLETE
        if docking.state in _ALIGNING:
            return Display.DOCKING
    if record.state is State.UNDOCKING and task is not None and task.carried:
        return Display.PASSENGER_DISEMBARK
    if record.passenger_attached:
        return Display.TRANSPORT
    return Display.APPROACHING_CHAIR if to_a_chair else Display.NAVIGATING


def _at_rest(record: Record, inputs: Inputs, battery_low: bool) -> Display:
    """Without a mission somebody may still dock: an operator."""
    if inputs.docking_state == "APPROACH":
        return Display.APPROACHING_CHAIR
    if inputs.docking_state in _ALIGNING:
        return Display.DOCKING
    if record.passenger_attached:
        return Display.DESTINATION_REACHED if record.state is State.COMPLETED else Display.PASSENGER_ONBOARD
    if inputs.docking_state == "DOCKED":
        return Display.DOCKING_COMPLETE
    if inputs.docking_state == "FAILED":
        return Display.DOCKING_FAILED
    return Display.LOW_BATTERY if battery_low else Display.IDLE
