"""Input health: is each input there, fresh, and coming at its rate?

Time is an argument (steady seconds), so the same code is tested tick by tick. Ages are taken from the time of
reception on the steady clock, so a step of the wall clock neither hides nor causes a fault.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

# Rates are evaluated over at least this many seconds: shorter windows flag the ordinary jitter of a busy machine.
RATE_WINDOW_S = 2.0


@dataclass(frozen=True, slots=True)
class InputState:
    """One input at one moment. age_s is infinite before the first message; rate_hz is NaN until a window has passed."""

    name: str
    age_s: float
    rate_hz: float
    fresh: bool
    received: int


# Prefix of the keys under which a node's entry in /diagnostics lists its inputs.
INPUT_PREFIX = "input "


def describe_input(item: InputState) -> str:
    """An input's state as fields for /diagnostics; ``parse_input`` reads them, by name and in any order."""
    return f"received={item.received} rate_hz={item.rate_hz:.1f} age_s={item.age_s:.2f} fresh={item.fresh}"


def parse_input(name: str, text: str) -> InputState | None:
    """Inverse of ``describe_input``, to the digits of the text; None without one of the fields."""
    try:
        fields = dict(field.split("=") for field in text.split())
        age_s, rate_hz, received = float(fields["age_s"]), float(fields["rate_hz"]), int(fields["received"])
        return InputState(name, age_s, rate_hz, fields["fresh"] == str(True), received)
    except (ValueError, KeyError):
        return None


def parse_inputs(values: Iterable[tuple[str, str]]) -> Iterator[InputState]:
    """The input states among the keys and values of a node's entry in /diagnostics."""
    for key, value in values:
        if key.startswith(INPUT_PREFIX):
            state = parse_input(key.removeprefix(INPUT_PREFIX), value)
            if state is not None:
                yield state


class InputHealth:
    """Ages and rates of a node's inputs."""

    def __init__(self) -> None:
        self._inputs: dict[str, _Input] = {}

    def add(self, name: str, stale_s: float | None) -> None:
        """Watches an input; with ``stale_s`` None its age is not checked."""
        self._inputs[name] = _Input(stale_s)

    def remove(self, name: str) -> None:
        """Stops watching this input."""
        self._inputs.pop(name, None)

    def received(self, name: str, now_s: float) -> None:
        self._inputs[name].received(now_s)

    def age_s(self, name: str, now_s: float) -> float:
        return self._inputs[name].age_s(now_s)

    def fresh(self, name: str, now_s: float) -> bool:
        """True if the input has been received and is not older than its limit."""
        return self._inputs[name].fresh(now_s)

    def check(self, now_s: float) -> dict[str, InputState]:
        return {
            name: InputState(name, item.age_s(now_s), item.rate_hz(now_s), item.fresh(now_s), item.count)
            for name, item in self._inputs.items()
        }


class _Input:
    __slots__ = ("_last_s", "_rate_hz", "_stale_s", "_window_count", "_window_start_s", "count")

    def __init__(self, stale_s: float | None) -> None:
        self._stale_s = stale_s
        self._last_s = -math.inf
        self._window_start_s = math.nan
        self._window_count = 0
        self._rate_hz = math.nan
        self.count = 0

    def received(self, now_s: float) -> None:
        self.count += 1
        if not self._window_start_s <= now_s:  # first message, or time went backwards
            self._window_start_s, self._window_count = now_s, 0
        else:
            self._window_count += 1
            self._close_window(now_s)
        self._last_s = now_s

    def _close_window(self, now_s: float) -> None:
        span_s = now_s - self._window_start_s
        if span_s >= RATE_WINDOW_S:
            self._rate_hz = self._window_count / span_s
            self._window_start_s, self._window_count = now_s, 0

    def age_s(self, now_s: float) -> float:
        return now_s - self._last_s

    def fresh(self, now_s: float) -> bool:
        # Time that ran backwards (a restarted simulation) makes the age negative: such an input is not fresh either.
        age_s = self.age_s(now_s)
        return age_s >= 0.0 and (age_s < math.inf if self._stale_s is None else age_s <= self._stale_s)

    def rate_hz(self, now_s: float) -> float:
        silent = self._stale_s is not None and self.age_s(now_s) > self._stale_s
        return 0.0 if silent and self.count else self._rate_hz
