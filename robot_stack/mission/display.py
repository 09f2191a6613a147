"""Selects the state of the external display (EHMIState.state_num) from the mission manager's state.

The mission manager also shows docking, with a mission or without one, so that the display has one source.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from robot_stack.contract.display import LANGUAGES, Display
from robot_stack.contract.states import ALIGNING, DOCKING, DockingState
from robot_stack.core.mission import Kind
from robot_stack.mission.docking import Task
from robot_stack.mission.events import Inputs
from robot_stack.mission.guards import stopping_faults
from robot_stack.mission.record import Record
from robot_stack.mission.states import AT_DOCK, UNDER_WAY, State


def usable_language(requested: str, current: str) -> str:
    """``requested``, or ``current`` if the display does not have it."""
    return requested if requested in LANGUAGES else current


@dataclass(frozen=True, slots=True)
class Docking:
    """The docking inputs of the display.

    task: of the current waypoint, None if it has none. state: from the feedback of the present goal, empty before any.
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
        """Replaces the announcements still to be shown."""
        self._queue, self._shown_s = deque(displays if self._each_s > 0.0 else ()), 0.0

    def elapse(self, dt_s: float) -> None:
        self._shown_s += dt_s
        if self._queue and self._shown_s >= self._each_s:
            self._queue.popleft()
            self._shown_s = 0.0

    @property
    def current(self) -> Display | None:
        return self._queue[0] if self._queue else None


def announced_at_end_of(task: Task, docking_state: str) -> tuple[Display, ...]:
    """Announcements for a task that succeeded. docking_state: of the last feedback."""
    if task.kind is Kind.DOCK:
        # "Docking complete" is already shown since the docking controller reported DOCKED.
        complete = () if docking_state == DockingState.DOCKED and task.carried else (Display.DOCKING_COMPLETE,)
        return (*complete, Display.PASSENGER_ONBOARD) if task.carried else complete
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
    setting_out: bool = False,
    waiting: bool = False,
    moving: bool = False,
    awake: bool = True,
    announced: Display | None = None,
) -> Display:
    """The state that the display shows now.

    setting_out: people are being warned of a start: the display shows the coming motion.
    waiting: the robot has stood for a while, for any reason. moving: its wheels turn.
    awake: pose and safety have been received once. announced: see Announcements.
    """
    if emergency:
        return Display.EMERGENCY_STOP
    if inputs.manual:
        return Display.MANUAL
    if record.state in UNDER_WAY:
        if setting_out:
            return _under_way(record, docking)
        # Docking pauses between its steps; these are not obstacle stops.
        stands = waiting if record.state in AT_DOCK else not moving
        hindrance = _hindrance(record, inputs, stands) or _standing(record, inputs, announced)
        if hindrance is None and waiting and not docking.state and record.state is not State.WAITING:
            hindrance = Display.OBSTACLE
        return hindrance or _under_way(record, docking)
    if record.state in (State.PAUSED, State.STOPPED):
        return Display.PAUSED
    by_hand = _by_hand(record, inputs, setting_out=setting_out, waiting=waiting, moving=moving) if awake else None
    if by_hand is not None:
        return by_hand
    if record.state is State.FAILED:
        failed_dock = record.docking_begun and docking.task is not None and docking.task.kind is Kind.DOCK
        return Display.DOCKING_FAILED if failed_dock else Display.ERROR
    if announced is not None and record.state is State.COMPLETED:
        return announced
    return _at_rest(record, inputs, battery_low) if awake else Display.OFF


def _hindrance(record: Record, inputs: Inputs, stands: bool) -> Display | None:
    stopping = set(stopping_faults(inputs)) - {"LOCALIZATION_LOST"}
    lost = inputs.pose is None or "LOCALIZATION_LOST" in inputs.faults
    # At a dock the robot navigates by the dock's markers.
    if lost and record.state not in AT_DOCK:
        return Display.LOCALIZATION_LOST
    # A fault that only slows the robot down does not show waiting.
    if "COLLISION_IMMINENT" in inputs.faults or ("OBSTACLE_NEAR" in inputs.faults and stands):
        return Display.OBSTACLE
    return Display.ERROR if stopping or not inputs.safety_known else None


def _standing(record: Record, inputs: Inputs, announced: Display | None) -> Display | None:
    """The display of a standing robot: the driving light is for motion, present or imminent."""
    if announced is not None or record.state is not State.WAITING:
        return announced
    if inputs.charging:
        return Display.CHARGING
    return Display.PASSENGER_ONBOARD if record.passenger_attached else Display.PAUSED


def _under_way(record: Record, docking: Docking) -> Display:
    task = docking.task
    to_a_chair = task is not None and task.carried and task.kind is Kind.DOCK
    if record.state is State.DOCKING:
        if docking.state == DockingState.DOCKED:
            return Display.DOCKING_COMPLETE
        if docking.state in ALIGNING:
            return Display.DOCKING
    if record.state is State.UNDOCKING and task is not None and task.carried:
        return Display.PASSENGER_DISEMBARK
    if record.passenger_attached:
        return Display.TRANSPORT
    return Display.APPROACHING_CHAIR if to_a_chair else Display.NAVIGATING


def _by_hand(record: Record, inputs: Inputs, *, setting_out: bool, waiting: bool, moving: bool) -> Display | None:
    """Without a mission the robot may still move autonomously: by an operator's docking request or goal."""
    aboard = record.passenger_attached
    if inputs.docking_state in DOCKING:
        if aboard:  # it backs off from the wheelchair
            return Display.PASSENGER_DISEMBARK
        approaching = setting_out or inputs.docking_state == DockingState.APPROACH
        return Display.APPROACHING_CHAIR if approaching else Display.DOCKING
    driving = Display.TRANSPORT if aboard else Display.NAVIGATING
    if setting_out:
        return driving
    if not inputs.planned:
        return None
    return _hindrance(record, inputs, not moving) or (Display.OBSTACLE if waiting else driving)


def _at_rest(record: Record, inputs: Inputs, battery_low: bool) -> Display:
    if record.passenger_attached:
        return Display.DESTINATION_REACHED if record.state is State.COMPLETED else Display.PASSENGER_ONBOARD
    if inputs.charging:
        return Display.CHARGING
    if inputs.docking_state == DockingState.DOCKED:
        return Display.DOCKING_COMPLETE
    if inputs.docking_state == DockingState.FAILED:
        return Display.DOCKING_FAILED
    return Display.LOW_BATTERY if battery_low else Display.IDLE
