"""Progress of the manipulator's start: the steps in their order, with retries and back-off.

A step sends a request and then waits for its effect. Pure: outcomes and times in, progress and log lines
out. A failing step is never given up: after its attempts it is retried with growing pauses, and
the later steps (the servos, above all) wait.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto


class Step(Enum):
    """The steps in the order of the start."""

    DEVICE = "device"
    SCAN = "network scan"
    COMMUNICATION = "communication"
    PARAMETERS = "parameters"
    AXIS_REPORT = "axis parameters"
    CLEAR_ALARMS = "amplifier alarms"
    SERVO_ON = "servo on"
    READY = "ready"


_ORDER = tuple(Step)
_PLACE = {step: place for place, step in enumerate(_ORDER)}
NEXT = dict(zip(_ORDER, (*_ORDER[1:], Step.READY), strict=True))


def is_past(step: Step, other: Step) -> bool:
    """True if ``step`` comes after ``other``."""
    return _PLACE[step] > _PLACE[other]


class Result(Enum):
    DONE = auto()
    ASKED = auto()  # accepted; its effect must be checked
    REFUSED = auto()
    HELD = auto()  # not permitted now, not a failure of this step


class Level(Enum):
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a request or a check. ``level``: log level of a finished step."""

    result: Result
    text: str = ""
    level: Level = Level.INFO


@dataclass(frozen=True, slots=True)
class Rule:
    """attempts: number of failures before an error is logged. pause_s: between two, doubled with each further one up to
    longest_pause_s. limit_s: timeout of the request's effect.
    """

    attempts: int
    pause_s: float
    longest_pause_s: float
    limit_s: float

    def pause_after(self, failures: int) -> float:
        """Seconds to the next attempt after ``failures``."""
        doublings = min(max(0, failures - self.attempts), 30)
        return min(self.pause_s * 2.0**doublings, max(self.pause_s, self.longest_pause_s))


@dataclass(frozen=True, slots=True)
class Line:
    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class Progress:
    """asked_s: time of the request, NaN before. text: the present obstacle."""

    step: Step
    failures: int = 0
    asked_s: float = math.nan
    due_s: float = -math.inf
    text: str = ""

    @property
    def waiting(self) -> bool:
        """True if the step was requested and its effect must be checked."""
        return not math.isnan(self.asked_s)

    def due(self, now_s: float) -> bool:
        """True if the step is to be requested now."""
        return self.step is not Step.READY and not self.waiting and now_s >= self.due_s


START = Progress(Step.DEVICE)
HOLD_S = 0.1
"""Period of checks of a step that is not permitted."""


def back_to(step: Step, text: str) -> Progress:
    """Continues from ``step`` at once after the loss of an earlier result."""
    return Progress(step, text=text)


def advance(
    progress: Progress, outcome: Outcome, now_s: float, rules: Mapping[Step, Rule]
) -> tuple[Progress, Line | None]:
    """The progress after ``outcome`` at ``now_s``, and the log line about it."""
    match outcome.result:
        case Result.DONE:
            line = Line(outcome.level, f"{progress.step.value}: {outcome.text}") if outcome.text else None
            return Progress(NEXT[progress.step]), line
        case Result.HELD:
            return _hold(progress, outcome.text, now_s)
        case Result.REFUSED:
            return _fail(progress, outcome.text, now_s, rules[progress.step])
        case Result.ASKED:
            return _wait(progress, outcome.text, now_s, rules[progress.step])


def _wait(progress: Progress, text: str, now_s: float, rule: Rule) -> tuple[Progress, Line | None]:
    if not progress.waiting:
        return replace(progress, asked_s=now_s, text=text or progress.text), None
    if now_s - progress.asked_s < rule.limit_s:
        return replace(progress, text=text or progress.text), None
    return _fail(progress, f"{text or 'not done'} after {rule.limit_s:g} s", now_s, rule)


def _hold(progress: Progress, text: str, now_s: float) -> tuple[Progress, Line | None]:
    line = None if text == progress.text else Line(Level.INFO, f"{progress.step.value}: {text}")
    return replace(progress, asked_s=math.nan, due_s=now_s + HOLD_S, text=text), line


def _fail(progress: Progress, text: str, now_s: float, rule: Rule) -> tuple[Progress, Line | None]:
    failures = progress.failures + 1
    pause_s = rule.pause_after(failures)
    name = progress.step.value
    line: Line | None = None
    if failures < rule.attempts:
        line = Line(
            Level.WARNING, f"{name}: attempt {failures} of {rule.attempts} failed, next in {pause_s:g} s: {text}"
        )
    elif failures == rule.attempts:
        line = Line(Level.ERROR, f"{name}: {failures} attempts failed, still trying: {text}")
    elif text != progress.text:
        line = Line(Level.WARNING, f"{name}: {text}")
    return Progress(progress.step, failures, due_s=now_s + pause_s, text=text), line
