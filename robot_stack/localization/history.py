"""The last second of the filter, so that a late measurement is applied at the time of its stamp."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

from robot_stack.core.geometry import Pose2
from robot_stack.localization.filter import Array, FilterState, PoseFilter, Step
from robot_stack.localization.odometry import Variances

NO_DOUBT: Variances = (0.0, 0.0, 0.0)


class Correction(Enum):
    """The outcome of a correction."""

    APPLIED = "applied"
    OUTLIER = "outside the gate"
    TOO_OLD = "older than the history or the last correction"
    TOO_NEW = "newer than the newest odometry"
    NOT_FINITE = "not finite"


@dataclass(frozen=True, slots=True)
class _Entry:
    stamp_s: float
    state: FilterState
    step: Step | None  # the step that led here from the entry before; None at a fresh start


class DelayedFilter:
    """A pose filter with a history of ``history_s``: corrections roll it back, apply, and predict forward again."""

    def __init__(self, pose_filter: PoseFilter, history_s: float) -> None:
        self._filter = pose_filter
        self._history_s = history_s
        self._entries: deque[_Entry] = deque()

    @property
    def stamp_s(self) -> float:
        """Time of the newest data, NaN before any."""
        return self._entries[-1].stamp_s if self._entries else math.nan

    def state(self) -> FilterState:
        return self._filter.state()

    def start(self, stamp_s: float) -> None:
        """Clears the history and continues from the present state at ``stamp_s``."""
        self._entries.clear()
        self._entries.append(_Entry(stamp_s, self._filter.state(), None))

    def predict(self, step: Step) -> bool:
        """See :meth:`PoseFilter.predict`. A step that would make the state not finite is dropped."""
        before = self._filter.state()
        slipped = self._filter.predict(step)
        if not self._filter.state().is_finite():
            self._filter.restore(before)
            return False
        self._entries.append(_Entry(step.stamp_s, self._filter.state(), step))
        while step.stamp_s - self._entries[0].stamp_s > self._history_s:
            self._entries.popleft()
        return slipped

    def correct(
        self, pose: Pose2, covariance: Array, stamp_s: float, gate_sigmas: float, doubt: Variances = NO_DOUBT
    ) -> Correction:
        """Corrects by a pose in map, (3, 3) covariance, at ``stamp_s``.

        doubt: (x, y, yaw), m2, m2, rad2, added to the covariance of the prediction at that time.
        """
        if not self._entries or stamp_s < self._entries[0].stamp_s:
            return Correction.TOO_OLD
        if stamp_s > self.stamp_s:
            return Correction.TOO_NEW
        present = self._filter.state()
        later = self._rewind(stamp_s)
        self._filter.grow(doubt)
        if not self._filter.correct(pose, covariance, gate_sigmas) or not self._filter.state().is_finite():
            self._restore(present, later)
            return Correction.OUTLIER
        # The history before a correction is dropped: an older correction would undo this one.
        self._entries.clear()
        self._entries.append(_Entry(stamp_s, self._filter.state(), None))
        for step in later[1]:
            self.predict(step)
        return Correction.APPLIED

    def pose_at(self, stamp_s: float) -> Pose2 | None:
        """The pose at a time inside the history, by linear interpolation of its step; None outside."""
        if not self._entries or not self._entries[0].stamp_s <= stamp_s <= self.stamp_s:
            return None
        entries = list(self._entries)
        index = max(i for i, entry in enumerate(entries) if entry.stamp_s <= stamp_s)
        if index + 1 == len(entries):
            return entries[index].state.pose
        before, after = entries[index], entries[index + 1]
        share = (stamp_s - before.stamp_s) / max(after.stamp_s - before.stamp_s, 1e-9)
        motion = after.state.pose.relative_to(before.state.pose)
        return before.state.pose.compose(Pose2(share * motion.x, share * motion.y, share * motion.yaw))

    def _rewind(self, stamp_s: float) -> tuple[list[_Entry], list[Step]]:
        """Rolls the filter back to ``stamp_s``. Returns the removed entries, newest first, and the steps to repeat."""
        taken: list[_Entry] = []
        while self._entries[-1].stamp_s > stamp_s:
            taken.append(self._entries.pop())
        steps = [entry.step for entry in reversed(taken) if entry.step is not None]
        last = self._entries[-1]
        self._filter.restore(last.state)
        if steps and stamp_s > last.stamp_s:
            share = (stamp_s - last.stamp_s) / steps[0].dt_s
            self._filter.predict(steps[0].part(share))
            steps[0] = steps[0].rest(share)
        return taken, steps

    def _restore(self, present: FilterState, later: tuple[list[_Entry], list[Step]]) -> None:
        self._entries.extend(reversed(later[0]))
        self._filter.restore(present)
