"""Rate and age of every topic, from its subscribers' entries in /diagnostics, without another subscription.

A subscriber that reads only the newest message misses others, so the highest count is used.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from robot_stack.contract.model import EVERY_NODE, Topic
from robot_stack.core.health import InputState, parse_inputs


@dataclass(frozen=True, slots=True)
class TopicFigures:
    """rate_hz: NaN until a subscriber has counted for long enough. age_s: infinite before the first message."""

    rate_hz: float
    age_s: float


class TopicHealth:
    """stale_after_s: older reports are ignored."""

    def __init__(self, stale_after_s: float) -> None:
        self._stale_after_s = stale_after_s
        self._reports: dict[str, dict[str, tuple[float, InputState]]] = {}

    def update(self, node: str, values: Iterable[tuple[str, str]], now_s: float) -> None:
        """One node's entry of /diagnostics: keys and values."""
        for state in parse_inputs(values):
            self._reports.setdefault(state.name, {})[node] = now_s, state

    def figures(self, topic: str, now_s: float) -> TopicFigures | None:
        """None while no subscriber reports the topic."""
        reports = self._reports.get(topic, {})
        states = [state for at_s, state in reports.values() if 0.0 <= now_s - at_s <= self._stale_after_s]
        if not states:
            return None
        rates = [state.rate_hz for state in states if not math.isnan(state.rate_hz)]
        return TopicFigures(max(rates, default=math.nan), min(state.age_s for state in states))


def judge_topic(row: Topic, figures: TopicFigures | None, nodes: Collection[str], tolerance: float) -> str:
    """The fault of a row's traffic, empty if there is none or it cannot be determined.

    nodes: the running nodes. tolerance: permitted relative error of a rate.
    """
    publishers = set(row.publishers) & set(nodes)
    if row.rate_hz is None or row.stale_s is None or row.on_demand or EVERY_NODE in row.publishers:
        return ""
    if figures is None or not publishers:
        return ""
    if figures.age_s > row.stale_s:
        return "never received" if math.isinf(figures.age_s) else f"silent for {figures.age_s:.1f} s"
    expected_hz = row.rate_hz * len(publishers)
    if abs(figures.rate_hz - expected_hz) > tolerance * expected_hz:  # False for NaN
        return f"{figures.rate_hz:.1f} Hz instead of {expected_hz:g}"
    return ""


def describe_topic(row: Topic, figures: TopicFigures | None) -> str:
    """One line for users."""
    if figures is None:
        return "no subscriber reports it"
    if math.isinf(figures.age_s):
        return "nothing received"
    rate = "rate unknown" if math.isnan(figures.rate_hz) else f"{figures.rate_hz:.1f} Hz"
    judged = row.rate_hz is not None and not row.on_demand and EVERY_NODE not in row.publishers
    wanted = f" of {row.rate_hz:g}" if judged else ""
    return f"{rate}{wanted}, age {figures.age_s:.2f} s"


def topics_of(rows: Sequence[Topic], nodes: Collection[str]) -> tuple[Topic, ...]:
    """The rows with a publisher among the nodes."""
    return tuple(row for row in rows if EVERY_NODE in row.publishers or set(row.publishers) & set(nodes))
