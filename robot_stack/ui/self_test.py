"""The guided self test of the emergency stop: a person acts, the test checks the robot's reaction. Times are steady
seconds.

For each hardware button and for the stop of the screen: press, a reset that must be refused, release, reset. A person
confirms the remaining checks while the stop of the screen holds the robot. The test requests nothing that moves the
robot, and a test that ends early releases nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from robot_stack.ui.params import SelfTestParams

SCREEN = "screen"
# Answers are keys of the texts that pages show.
UNKNOWN_STATE, MOVING, RIDE_ACTIVE, PASSENGER_ABOARD, STOP_ACTIVE = (
    "answer.test_unknown",
    "answer.test_moving",
    "answer.test_ride",
    "answer.test_passenger",
    "answer.test_stopped",
)
# A source that only passes on a stop (the mission manager) ends its press once the stop is latched.
_WRONG_SOURCE_S = 1.0
# The stop must stand this long after the release of its source.
_LATCHED_S = 1.0
# Sources of the emergency stop that are kept; this stack has fewer.
_SOURCES_MAX = 64


class Kind(StrEnum):
    """A step's condition. PRESS: the source is pressed and the stop latched. REFUSED: a reset is refused meanwhile.
    RELEASE: the source is released, the stop stands, the robot stands. RESET: granted, the stop is gone.
    CHECK: a person confirms it.
    """

    PRESS = "press"
    REFUSED = "refused"
    RELEASE = "release"
    RESET = "reset"
    CHECK = "check"


class Verdict(StrEnum):
    PASSED = "passed"
    FAILED = "failed"
    ABORTED = "aborted"


class Reason(StrEnum):
    """Why a test ended early: as failed, or from LEFT on as aborted."""

    TIMEOUT = "TIMEOUT"
    WRONG_SOURCE = "WRONG_SOURCE"
    RESET_GRANTED = "RESET_GRANTED"
    RELEASED_EARLY = "RELEASED_EARLY"
    RESET_REFUSED = "RESET_REFUSED"
    NO_MONITOR = "NO_MONITOR"
    STOP_LOST = "STOP_LOST"
    MOVED = "MOVED"
    PERSON = "PERSON"
    LEFT = "LEFT"
    CANCELLED = "CANCELLED"
    RIDE = "RIDE"
    PASSENGER = "PASSENGER"
    CLOCK = "CLOCK"


_ABORTS = (Reason.LEFT, Reason.CANCELLED, Reason.RIDE, Reason.PASSENGER, Reason.CLOCK)
# The robot did what the test excludes while people are close to it: the screen presses its own stop.
_DANGERS = (Reason.RESET_GRANTED, Reason.STOP_LOST, Reason.MOVED)


class Effect(StrEnum):
    """What the node is to do. TRY_RESET: one request that must be refused. RELEASE: of the screen's own stop."""

    TRY_RESET = "try reset"
    RESET = "reset"
    RELEASE = "release"
    STOP = "stop"


class ResetAnswer(StrEnum):
    """The safety monitor's answer to a reset. NONE: it did not answer."""

    GRANTED = "granted"
    REFUSED = "refused"
    NONE = "none"


@dataclass(frozen=True, slots=True)
class Step:
    """target: a button, SCREEN or a check. source: whose press is tested, or holds the robot during a check."""

    kind: Kind
    target: str
    source: str
    timeout_s: float

    @property
    def name(self) -> str:
        return f"{self.kind} {self.target}"


@dataclass(frozen=True, slots=True)
class Seen:
    """The robot now. None: unknown.

    emergency: the stop of /safety/status; pressed_row: ESTOP_PRESSED is among its rows. sources: True for each pressed
    source that reports. speed: measured (m/s, rad/s). ride_active: a mission is under way or paused.
    """

    emergency: bool | None = None
    pressed_row: bool = False
    sources: Mapping[str, bool] = field(default_factory=dict)
    speed: tuple[float, float] | None = None
    ride_active: bool | None = None
    passenger: bool | None = None


@dataclass(frozen=True, slots=True)
class End:
    """How a test ended. step: name of the step at which it failed or was aborted; empty if it passed."""

    verdict: Verdict
    duration_s: float
    step: str = ""
    reason: Reason | None = None


def planned_steps(params: SelfTestParams, screen_source: str) -> tuple[Step, ...]:
    """All steps in order. screen_source: name of the screen's own stop on /emergency_stop/sources."""
    limits_s = {
        Kind.PRESS: params.press_s,
        Kind.REFUSED: params.refused_s,
        Kind.RELEASE: params.press_s,
        Kind.RESET: params.press_s,
        Kind.CHECK: params.check_s,
    }

    def step(kind: Kind, target: str, source: str) -> Step:
        return Step(kind, target, source, limits_s[kind])

    order = (Kind.PRESS, Kind.REFUSED, Kind.RELEASE, Kind.RESET)
    buttons = [step(kind, button, params.button_source) for button in params.buttons for kind in order]
    pressed = [step(kind, SCREEN, screen_source) for kind in order[:2]]
    checks = [step(Kind.CHECK, check, screen_source) for check in params.checks]
    released = [step(kind, SCREEN, screen_source) for kind in order[2:]]
    return (*buttons, *pressed, *checks, *released)


def refusal(seen: Seen, params: SelfTestParams) -> str:
    """The key of the reason why a test may not begin; empty if it may. Unknown values refuse it."""
    if None in (seen.emergency, seen.speed, seen.ride_active, seen.passenger):
        return UNKNOWN_STATE
    if not _stands(seen, params):
        return MOVING
    if seen.ride_active:
        return RIDE_ACTIVE
    if seen.passenger:
        return PASSENGER_ABOARD
    return STOP_ACTIVE if seen.emergency or any(seen.sources.values()) else ""


class SelfTest:
    """One run. end: None while it runs. at: number of the current step."""

    def __init__(self, params: SelfTestParams, steps: tuple[Step, ...], now_s: float) -> None:
        self._params, self.steps = params, steps
        self.at = 0
        self.end: End | None = None
        self._begun_s = self._step_s = self._now_s = now_s
        self._held_s: float | None = None  # since when the condition of a step holds
        self._asked = self._granted = False
        self._seen = Seen()

    @property
    def step(self) -> Step:
        return self.steps[self.at]

    @property
    def left_s(self) -> float:
        """Time until the step's timeout, at the newest observation."""
        return max(0.0, self._step_s + self.step.timeout_s - self._now_s)

    @property
    def takes_confirmation(self) -> bool:
        """True if the step waits for a person at the screen."""
        if self.end is not None or self._asked:
            return False
        return self.step.kind in (Kind.CHECK, Kind.RESET) or (
            self.step.kind is Kind.RELEASE and self.step.target == SCREEN
        )

    def observe(self, seen: Seen, now_s: float) -> Effect | None:
        """Call several times a second."""
        if not self._advance_time(now_s):
            return None
        self._seen = seen
        interrupted = self._interruption()
        if interrupted is not None:
            return self._stop_with(interrupted)
        before = self.at
        effect = self._check_step()
        late = self.end is None and self.at == before and self.left_s <= 0.0
        return self._stop_with(Reason.TIMEOUT) if late else effect

    def confirm(self, now_s: float) -> Effect | None:
        """A person confirms the step. Steps that do not wait for it ignore it."""
        if not self._advance_time(now_s) or not self.takes_confirmation:
            return None
        if self.step.kind is Kind.CHECK:
            return self._next()
        self._asked = True
        return Effect.RESET if self.step.kind is Kind.RESET else Effect.RELEASE

    def fail(self, now_s: float) -> None:
        """A person reports that the step's condition is not met."""
        if self._advance_time(now_s):
            self._stop_with(Reason.PERSON)

    def abort(self, reason: Reason, now_s: float) -> None:
        if self._advance_time(now_s):
            self._stop_with(reason)

    def answer(self, answer: ResetAnswer, now_s: float) -> Effect | None:
        """The answer to TRY_RESET or RESET. TRY_RESET that is granted after the end of the test stops the robot too."""
        tried = self._asked and self.step.kind is Kind.REFUSED
        if not self._advance_time(now_s):
            return Effect.STOP if tried and answer is ResetAnswer.GRANTED else None
        if not self._asked or self.step.kind not in (Kind.REFUSED, Kind.RESET):
            return None
        if answer is ResetAnswer.NONE:
            return self._stop_with(Reason.NO_MONITOR)
        granted = answer is ResetAnswer.GRANTED
        if self.step.kind is Kind.RESET:
            self._granted = granted
            return None if granted else self._stop_with(Reason.RESET_REFUSED)
        return self._stop_with(Reason.RESET_GRANTED) if granted else self._next()

    def _check_step(self) -> Effect | None:
        pressed = self._seen.sources.get(self.step.source)
        match self.step.kind:
            case Kind.PRESS:
                return self._check_press(pressed is True)
            case Kind.REFUSED:  # its answer ends it
                return self._stop_with(Reason.RELEASED_EARLY) if pressed is False else None
            case Kind.RESET if self._granted and self._seen.emergency is False and not self._seen.pressed_row:
                return self._next()
            case Kind.RESET if self._asked:
                return None
        if self._seen.emergency is False:
            return self._stop_with(Reason.STOP_LOST)
        if self.step.kind is Kind.RELEASE:
            released = pressed is False and self._latched() and _stands(self._seen, self._params)
            return self._next() if self._holds(released, _LATCHED_S) else None
        return None

    def _check_press(self, pressed: bool) -> Effect | None:
        if pressed and self._latched():
            return self._next()
        wrong = not pressed and any(self._seen.sources.values())
        return self._stop_with(Reason.WRONG_SOURCE) if self._holds(wrong, _WRONG_SOURCE_S) else None

    def _latched(self) -> bool:
        return self._seen.emergency is True and self._seen.pressed_row

    def _interruption(self) -> Reason | None:
        if _moves(self._seen, self._params):
            return Reason.MOVED
        if self._seen.ride_active:
            return Reason.RIDE
        return Reason.PASSENGER if self._seen.passenger else None

    def _holds(self, condition: bool, duration_s: float) -> bool:
        if not condition:
            self._held_s = None
            return False
        if self._held_s is None:
            self._held_s = self._now_s
        return self._now_s - self._held_s >= duration_s

    def _next(self) -> Effect | None:
        self._held_s, self._asked, self._granted = None, False, False
        self._step_s = self._now_s
        if self.at + 1 == len(self.steps):
            self.end = End(Verdict.PASSED, self._now_s - self._begun_s)
            return None
        self.at += 1
        if self.step.kind is not Kind.REFUSED:
            return None
        self._asked = True
        return Effect.TRY_RESET

    def _stop_with(self, reason: Reason) -> Effect | None:
        verdict = Verdict.ABORTED if reason in _ABORTS else Verdict.FAILED
        self.end = End(verdict, self._now_s - self._begun_s, self.step.name, reason)
        return Effect.STOP if reason in _DANGERS else None

    def _advance_time(self, now_s: float) -> bool:
        """False if the test has ended. A time that is not finite or runs backwards aborts it."""
        if self.end is not None:
            return False
        if not (math.isfinite(now_s) and now_s >= self._now_s):
            self._stop_with(Reason.CLOCK)
            return False
        self._now_s = now_s
        return True


class SourceReports:
    """The sources of the emergency stop, by their own reports. stale_s: an older report does not count."""

    def __init__(self, stale_s: float) -> None:
        self._stale_s = stale_s
        self._reports: dict[tuple[str, int], tuple[bool, float]] = {}

    def add(self, name: str, pid: int, pressed: bool, now_s: float) -> None:
        self._reports[name, pid] = (pressed, now_s)
        if len(self._reports) > _SOURCES_MAX:
            del self._reports[min(self._reports, key=lambda key: self._reports[key][1])]

    def pressed(self, now_s: float) -> dict[str, bool]:
        """True for each name of which any process is pressed."""
        found: dict[str, bool] = {}
        for (name, _), (pressed, at_s) in self._reports.items():
            if 0.0 <= now_s - at_s <= self._stale_s:
                found[name] = found.get(name, False) or pressed
        return found


def _stands(seen: Seen, params: SelfTestParams) -> bool:
    """False if the motion is unknown."""
    speed = seen.speed
    return speed is not None and abs(speed[0]) <= params.moving_mps and abs(speed[1]) <= params.moving_radps


def _moves(seen: Seen, params: SelfTestParams) -> bool:
    """False if the motion is unknown."""
    speed = seen.speed
    return speed is not None and (abs(speed[0]) > params.moving_mps or abs(speed[1]) > params.moving_radps)
