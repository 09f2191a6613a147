"""Data from /diagnostics: rate and age of every topic, pressed emergency stop sources. Times are steady
seconds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from robot_stack.contract.model import Topic
from robot_stack.core.health import InputState, parse_inputs
from robot_stack.core.stop_presence import Presence, parse_presence

# The data of a node that has been silent for this long is dropped.
NODE_SILENT_S = 5.0


class Diagnostics:
    """The newest word of every node."""

    def __init__(self) -> None:
        self._nodes: dict[str, tuple[float, int, str, dict[str, InputState]]] = {}
        self._stop_sources: dict[str, Presence] = {}

    def update(self, node: str, level: int, text: str, values: Mapping[str, str], now_s: float) -> None:
        if node == _MONITOR:
            self._stop_sources = parse_presence(values)
        self._nodes[node] = (now_s, level, text, {state.name: state for state in parse_inputs(values.items())})

    def stop_sources(self, now_s: float) -> dict[str, Any]:
        """The pressed emergency stop sources, from the safety monitor's entry while it is fresh."""
        reports = self._nodes.get(_MONITOR)
        known = reports is not None and 0.0 <= now_s - reports[0] <= NODE_SILENT_S
        sources = self._stop_sources if known else {}
        return {"list": [{"name": name, "presence": presence.value} for name, presence in sources.items()]}

    def section(self, topics: Iterable[Topic], now_s: float) -> dict[str, Any]:
        """Nodes, and a row per topic, from its subscriber with the newest message."""
        alive = {name: item for name, item in self._nodes.items() if 0.0 <= now_s - item[0] <= NODE_SILENT_S}
        return {
            "nodes": [
                {"name": name, "level": _LEVELS.get(level, "ERROR"), "text": text[:200]}
                for name, (_, level, text, _inputs) in sorted(alive.items())
            ],
            "topics": [_row(topic, alive) for topic in topics],
        }


_MONITOR = "safety_monitor"
_LEVELS = {0: "OK", 1: "WARN", 2: "ERROR", 3: "STALE"}


def _row(topic: Topic, nodes: Mapping[str, tuple[float, int, str, dict[str, InputState]]]) -> dict[str, Any]:
    reports = [(name, item[3][topic.name]) for name, item in nodes.items() if topic.name in item[3]]
    received = [(name, state) for name, state in reports if math.isfinite(state.age_s)]
    row = {"name": topic.name, "expected_hz": topic.rate_hz, "rate_hz": None, "age_s": None, "by": "", "state": "NONE"}
    if not received:
        return row | {"state": "SILENT" if reports and topic.rate_hz and not topic.on_demand else "NONE"}
    name, newest = min(received, key=lambda item: item[1].age_s)
    stale = not newest.fresh and not topic.on_demand
    rate_hz = None if math.isnan(newest.rate_hz) else newest.rate_hz
    return row | {"rate_hz": rate_hz, "age_s": newest.age_s, "by": name, "state": "STALE" if stale else "OK"}
