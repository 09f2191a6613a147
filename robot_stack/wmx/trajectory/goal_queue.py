"""One goal at a time: a newer goal stops the present one when its own start is due, and starts from rest.

A newer goal that cannot be planned does not affect the present one. It is planned twice: on arrival, from the expected
position of the joints at its start, and then from their position at rest.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from robot_stack.wmx.trajectory.arm import Arm, ArmState, Blind
from robot_stack.wmx.trajectory.execution import Execution
from robot_stack.wmx.trajectory.goal import CheckedGoal
from robot_stack.wmx.trajectory.plan import plan_spline
from robot_stack.wmx.trajectory.results import Fault, GoalCode, GoalRefused, Result, aborted, canceled
from robot_stack.wmx.trajectory.settings import ExecutionSettings

KeyT = TypeVar("KeyT")
_PREEMPTED = aborted(Fault(GoalCode.INVALID_GOAL, "preempted by a newer goal"))


class GoalQueue(Generic[KeyT]):
    """The active goal, and the newest goal that waits for the arm to stand. Times are steady seconds.

    end: called once with the key and the result of every submitted goal.
    """

    def __init__(self, arm: Arm, settings: ExecutionSettings, end: Callable[[KeyT, Result], None]) -> None:
        self._arm, self._settings, self._end = arm, settings, end
        self._active: tuple[KeyT, Execution] | None = None
        self._next: tuple[KeyT, CheckedGoal, float] | None = None

    @property
    def active(self) -> tuple[KeyT, Execution] | None:
        return self._active

    def submit(self, key: KeyT, goal: CheckedGoal, now_s: float, status: ArmState | Blind) -> None:
        """Starts the goal, or stops the present one for it once it is due."""
        refusal = self._refusal(goal, now_s, status)
        if refusal is not None:
            self._end(key, aborted(refusal))
            return
        if self._next is not None:
            self._end(self._next[0], _PREEMPTED)
        self._next = (key, goal, now_s)
        self.tick(now_s, status)

    def cancel(self, key: KeyT, now_s: float) -> None:
        """Ends the goal with this key: at once if it has not begun, else when the axes stand."""
        if self._next is not None and self._next[0] == key:
            self._next = None
            self._end(key, canceled("canceled before its start"))
        elif self._active is not None and self._active[0] == key:
            self._active[1].stop(now_s, canceled("canceled"))

    def stop_all(self, fault: Fault, now_s: float) -> None:
        """Ends all goals for ``fault``, as fast as the axes can."""
        if self._next is not None:
            key, self._next = self._next[0], None
            self._end(key, aborted(fault))
        if self._active is not None:
            self._active[1].stop(now_s, aborted(fault), quick=True)

    def tick(self, now_s: float, status: ArmState | Blind) -> None:
        """Reads the arm's state and executes the next action."""
        if self._active is not None and self._next is not None and now_s >= self._due_s(*self._next[1:]):
            self._active[1].stop(now_s, _PREEMPTED)
        while True:
            if self._active is None and self._next is not None:
                key, goal, asked_s = self._next
                self._next = None
                self._active = (key, Execution(goal, self._arm, self._settings, asked_s))
            if self._active is None:
                return
            key, execution = self._active
            result = execution.tick(now_s, status)
            if result is None:
                return
            self._active = None
            self._end(key, result)

    @staticmethod
    def _due_s(goal: CheckedGoal, asked_s: float) -> float:
        return asked_s + goal.start_in_s

    def _refusal(self, goal: CheckedGoal, now_s: float, status: ArmState | Blind) -> Fault | None:
        """The reason if a goal that arrives during another one is rejected."""
        if self._active is None or isinstance(status, Blind) or not len(goal.points):
            return None
        start = self._active[1].place_at(self._due_s(goal, now_s), status)
        try:
            plan_spline(goal.points, goal.late_s, start, self._settings.joints, self._settings.plan)
        except GoalRefused as refusal:
            return refusal.fault
        return None
