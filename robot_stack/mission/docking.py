"""Calls of the docking controller: one goal at a time, each with a number and a timeout.

Times are sums of the ticks' steps, as everywhere in the mission manager.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from robot_stack.contract.states import DOCKING
from robot_stack.core.mission import Kind
from robot_stack.mission import route
from robot_stack.mission.events import (
    CancelDocking,
    DockingAccepted,
    DockingEnded,
    DockingEvent,
    DockingFeedback,
    Effect,
    Inputs,
    StartDocking,
)
from robot_stack.mission.params import MissionParams
from robot_stack.mission.record import Record

_SERVER = "docking_controller"


@dataclass(frozen=True, slots=True)
class Task:
    """The docking controller's task at a waypoint.

    kind: DOCK or UNDOCK. dock_id: empty = undock wherever the robot is docked.
    carried: the dock is a wheelchair, so that /passenger_attached shows whether the task is fulfilled.
    """

    kind: Kind
    dock_id: str
    carried: bool

    @property
    def activity(self) -> str:
        if self.kind is Kind.DOCK:
            return f"docking to {self.dock_id}"
        return f"undocking from {self.dock_id}" if self.dock_id else "undocking"

    def fulfilled(self, attached: bool) -> bool:
        """True if the robot's state shows that this is done. Never for a station: it has no latch."""
        return self.carried and attached == (self.kind is Kind.DOCK)


def task_of(record: Record, docks: Mapping[str, str]) -> Task | None:
    """The task of the record's waypoint, None without one. ``docks``: kind of each dock by its id.

    An unknown dock counts as a wheelchair: its outcome must then be observed.
    """
    current = record.current
    if current is None or current.action.kind not in (Kind.DOCK, Kind.UNDOCK):
        return None
    if record.leaving:
        return Task(Kind.UNDOCK, "", carried=False)
    ids = [stop.action.dock_id for stop in record.stops[: record.waypoint + 1] if stop.action.kind is Kind.DOCK]
    dock_id = ids[-1] if ids else ""
    return Task(current.action.kind, dock_id, docks.get(dock_id, "wheelchair") == "wheelchair")


def at_station(record: Record, docks: Mapping[str, str]) -> bool:
    """True if the mission has docked to a station and has not undocked yet."""
    done = [stop.action for stop in record.stops[: record.waypoint] if stop.action.kind in (Kind.DOCK, Kind.UNDOCK)]
    return bool(done) and done[-1].kind is Kind.DOCK and docks.get(done[-1].dock_id) in ("station", "charger")


def undocks_in_place(record: Record, docks: Mapping[str, str]) -> bool:
    """True if the next waypoint is the undocking from a station: the robot does not drive before it."""
    current = record.current
    return current is not None and current.action.kind is Kind.UNDOCK and at_station(record, docks)


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a task ended: ``problem`` is empty if it is done."""

    problem: str = ""


class Phase(Enum):
    NONE = "no task"
    WAITING = "the goal has not been sent yet"
    SENT = "the goal has not been accepted yet"
    ACCEPTED = "the docking controller executes it"
    ENDED = "the result has arrived"


class DockingCalls:
    """The present task, and an abandoned goal that has not ended yet."""

    def __init__(self, params: MissionParams) -> None:
        self._params = params
        self._number = 0
        self._open: int | None = None  # the goal that was sent and has not ended
        self._since_cancel_s = 0.0
        self.begin()
        self._phase = Phase.NONE

    def begin(self) -> None:
        """Begins a task: a later tick sends its goal."""
        self._phase = Phase.WAITING
        self._waited_s = self._elapsed_s = self._silent_s = self._ended_s = 0.0
        self._end = DockingEnded(0, False)
        self._tries = 0
        self.state = ""
        self.text = ""

    def drop(self) -> tuple[Effect, ...]:
        """The mission lets go of its task."""
        self._phase, self.text, self.state = Phase.NONE, "", ""
        self._since_cancel_s = 0.0
        return (CancelDocking(),) if self._open is not None else ()

    def about_to_start(self, inputs: Inputs) -> bool:
        """True if only permission to send the task's goal is missing: then the robot will move."""
        return self._phase is Phase.WAITING and not self._awaited(inputs)

    def on_event(self, event: DockingEvent) -> None:
        """Handles an event. Of an earlier goal only its end counts."""
        if isinstance(event, DockingEnded) and event.call == self._open:
            self._open = None
        if event.call != self._number or self._phase not in (Phase.SENT, Phase.ACCEPTED):
            return
        self._silent_s = 0.0
        match event:
            case DockingAccepted():
                self._phase, self._waited_s = Phase.ACCEPTED, 0.0
            case DockingFeedback(_, state, tries):
                self.state, self._tries = state, tries
            case DockingEnded():
                self._phase, self._end = Phase.ENDED, event

    def idle(self, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        """A tick without a task: cancels an abandoned goal until it has ended."""
        if not inputs.docking_served:
            self._open = None  # it ended with its action server
        if self._open is None:
            return ()
        self._since_cancel_s += dt_s
        if self._since_cancel_s < self._params.goal_retry_s:
            return ()
        self._since_cancel_s = 0.0
        return (CancelDocking(),)

    def tick(
        self, task: Task, inputs: Inputs, attached: bool, held: str, dt_s: float
    ) -> tuple[tuple[Effect, ...], Outcome | None]:
        """The effects now, and the outcome of the task if it ended.

        attached: a wheelchair is latched. held: why the robot may not move now, empty if it may.
        """
        effects: tuple[Effect, ...] = ()
        problem: str | None = None
        match self._phase:
            case Phase.WAITING:
                effects, problem = self._wait(task, inputs, held, dt_s)
            case Phase.SENT | Phase.ACCEPTED:
                problem = self._watch(inputs, dt_s)
                progress = f"{self.state}, try {self._tries}" if self._tries > 1 else self.state
                self._say(task, progress or "waiting for an answer", held)
            case Phase.ENDED:
                problem = self._conclude(task, attached, dt_s)
        if problem is None:
            return effects, None
        return effects, Outcome(f"{task.activity} failed: {problem}" if problem else "")

    def _say(self, task: Task, *parts: str) -> None:
        self.text = f"{task.activity}: {'; '.join(filter(None, parts))}"

    def _wait(self, task: Task, inputs: Inputs, held: str, dt_s: float) -> tuple[tuple[Effect, ...], str | None]:
        effects = self.idle(inputs, dt_s)
        if held:  # as with a ride: time in which the robot may not move does not count
            self._say(task, held)
            return effects, None
        awaited = self._awaited(inputs)
        if not awaited:
            self._number += 1
            self._open, self._phase, self._waited_s = self._number, Phase.SENT, 0.0
            self._say(task, "waiting for an answer")
            return (*effects, StartDocking(self._number, task.kind, task.dock_id)), None
        self._say(task, f"waiting for {awaited}")
        self._waited_s += dt_s
        limit_s = self._params.docking_wait_s
        return effects, f"timed out after {limit_s:.0f} s waiting for {awaited}" if self._waited_s >= limit_s else None

    def _awaited(self, inputs: Inputs) -> str:
        if not inputs.docking_served or not inputs.docking_state:
            return _SERVER
        if self._open is not None or inputs.docking_state in DOCKING:  # also by another client's goal
            return f"{_SERVER} to end its present goal"
        return "" if route.standing(inputs.twist, self._params) else "standstill of the robot"

    def _watch(self, inputs: Inputs, dt_s: float) -> str | None:
        """The problem with an active goal."""
        self._elapsed_s += dt_s
        self._waited_s += dt_s
        self._silent_s = 0.0 if inputs.docking_state else self._silent_s + dt_s
        if not inputs.docking_state and not inputs.docking_served:
            return f"{_SERVER} is not available"
        if self._silent_s >= self._params.docking_silence_s:
            return f"no status of {_SERVER} for {self._params.docking_silence_s:.0f} s"
        if self._phase is Phase.SENT and self._waited_s >= self._params.docking_wait_s:
            return f"{_SERVER} has not answered for {self._params.docking_wait_s:.0f} s"
        if self._elapsed_s >= self._params.docking_timeout_s:
            return f"no result within {self._params.docking_timeout_s:.0f} s"
        return None

    def _conclude(self, task: Task, attached: bool, dt_s: float) -> str | None:
        """The problem with the result, empty if it is good, None while it is unknown."""
        if self._end.success and (not task.carried or task.fulfilled(attached)):
            return ""
        self._ended_s += dt_s
        late = self._ended_s >= self._params.docking_confirm_s
        if self._end.success:
            self._say(task, "waiting for /passenger_attached")
            return f"it succeeded, but /passenger_attached stayed {str(attached).lower()}" if late else None
        # An emergency stop may arrive after the result that it caused: then the mission is stopped, not failed.
        self._say(task, self._end.reason)
        return None if self._end.safety_stop and not late else self._end.reason or "no reason given"
