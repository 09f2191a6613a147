"""Several places that fit the same sweep, each tracked by wheels and gyro until later sweeps separate them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2
from robot_stack.localization.ndt.matcher import Match
from robot_stack.localization.ndt.params import HypothesisParams

_WEIGHT = 0.3  # of a new score in the running mean


@dataclass(frozen=True, slots=True)
class _Hypothesis:
    """match: of the newest sweep, None if it did not fit. score: running mean.

    pose: base_link in map when the dead-reckoned pose was ``at``.
    """

    match: Match | None
    pose: Pose2
    at: Pose2
    score: float

    def now(self, travelled: Pose2) -> Pose2:
        return self.pose.compose(travelled.relative_to(self.at))


class Hypotheses:
    """matches: of a search, apart from each other, at the dead-reckoned pose ``travelled``."""

    def __init__(self, matches: Sequence[Match], travelled: Pose2, params: HypothesisParams) -> None:
        self._params = params
        self._all = [_Hypothesis(match, match.planar, travelled, match.score) for match in matches]
        self._last = travelled
        self._way_m, self._sweeps = 0.0, 0

    def __len__(self) -> int:
        return len(self._all)

    def guesses(self, travelled: Pose2) -> tuple[Pose2, ...]:
        """The robot's pose by each of them."""
        return tuple(hypothesis.now(travelled) for hypothesis in self._all)

    def judge(self, matches: Sequence[Match], travelled: Pose2) -> None:
        """matches: of one sweep, from each guess in order. Drops those that fit worse than the best."""
        self._way_m += travelled.distance_to(self._last)
        self._last, self._sweeps = travelled, self._sweeps + 1
        self._all = [self._after(old, match, travelled) for old, match in zip(self._all, matches, strict=True)]
        self._all.sort(key=lambda hypothesis: -hypothesis.score)
        self._all = self._apart()
        if self._way_m < self._params.decide_way_m:
            return  # the places still fit alike: noise must not decide
        least = self._params.dropped_ratio * self._all[0].score
        self._all = [hypothesis for hypothesis in self._all if hypothesis.score >= least]

    def idle(self) -> bool:
        """True while the robot stands, so that motion cannot decide: a new search may give a clearer result."""
        return self._sweeps >= self._params.idle_sweeps and self._way_m < self._params.decide_way_m

    def best_score(self) -> float:
        return max((hypothesis.score for hypothesis in self._all), default=0.0)

    def alone(self) -> Match | None:
        """The newest sweep's match of the only place left; None while there are several, or it does not fit."""
        return self._all[0].match if len(self._all) == 1 else None

    def _after(self, old: _Hypothesis, match: Match, travelled: Pose2) -> _Hypothesis:
        guess, found = old.now(travelled), match.planar
        turn_rad = abs(math.remainder(found.yaw - guess.yaw, math.tau))
        jumped = found.distance_to(guess) > self._params.max_jump_m or turn_rad > self._params.max_jump_rad
        held = match.converged and not jumped
        score = old.score + _WEIGHT * ((match.score if held else 0.0) - old.score)
        # A place that no longer fits continues by dead reckoning: it must not slide to one that does.
        return _Hypothesis(match if held else None, found if held else guess, travelled, score)

    def _apart(self) -> list[_Hypothesis]:
        """Best first, without those that have converged to a better one."""
        found: list[_Hypothesis] = []
        for item in self._all:
            if not any(self._same(item.pose, other.pose) for other in found):
                found.append(item)
        return found

    def _same(self, one: Pose2, other: Pose2) -> bool:
        """The same place and heading: in the middle of a hall its mirror image differs by heading alone."""
        turn_rad = abs(math.remainder(one.yaw - other.yaw, math.tau))
        return one.distance_to(other) <= self._params.merge_m and turn_rad <= self._params.max_jump_rad
