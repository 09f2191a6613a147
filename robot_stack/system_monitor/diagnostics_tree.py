"""/diagnostics as a tree, by the conventions of diagnostic_aggregator (github.com/ros/diagnostics).

Every entry becomes ``<base>/<group>/<name>`` with the slashes of its name as blanks; every group and the base get an
entry that names their children. A group has the worst level of its children; it is stale only if all of them are, and
with one stale child among others it has an error. An expected node without an entry is shown as "Missing".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

OTHER = "Other"
MISSING = "Missing"


class Level(IntEnum):
    """As in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


_TEXT = {Level.OK: "OK", Level.WARN: "Warning", Level.ERROR: "Error", Level.STALE: "Stale"}


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry of the tree.

    children: name and message of each, of a group. payload: argument of ``update``, of a leaf with an entry.
    missing: an expected node that has sent no entry.
    """

    path: str
    level: Level
    message: str
    children: tuple[tuple[str, str], ...] = ()
    payload: Any = None
    missing: bool = False


@dataclass(frozen=True, slots=True)
class _Received:
    at_s: float
    level: Level
    message: str
    payload: Any


class DiagnosticsTree:
    """groups: name -> its nodes, in display order. expected: nodes that must report.

    stale_after_s: an older entry is stale. All times are seconds of one steady clock.
    """

    def __init__(
        self, base_path: str, groups: Mapping[str, Sequence[str]], expected: Sequence[str], stale_after_s: float
    ) -> None:
        self._base_path, self._stale_after_s = base_path, stale_after_s
        self._groups = tuple(groups)
        self._group_of = {node: group for group, nodes in groups.items() for node in nodes}
        self._expected = tuple(expected)
        self._entries: dict[str, _Received] = {}

    def update(self, name: str, level: int, message: str, payload: Any, now_s: float) -> None:
        """Adds an entry of /diagnostics. ``name``: a node, or "node: item"."""
        known = Level(level) if level in tuple(Level) else Level.ERROR
        self._entries[name] = _Received(now_s, known, message, payload)

    def entries(self, now_s: float) -> list[Entry]:
        """The whole tree: the base first, each group before its children."""
        leaves: dict[str, list[tuple[str, Entry]]] = {}
        for name, entry in self._leaves(now_s):
            leaves.setdefault(self._group(name), []).append((name, entry))
        groups = [
            (group, _parent(f"{self._base_path}/{group}", leaves[group]), leaves[group])
            for group in (*self._groups, OTHER)
            if group in leaves
        ]
        base = _parent(self._base_path, [(name, parent) for name, parent, _ in groups])
        return [base, *(item for _, parent, members in groups for item in (parent, *(leaf for _, leaf in members)))]

    def _leaves(self, now_s: float) -> list[tuple[str, Entry]]:
        found = {name: self._leaf(name, received, now_s) for name, received in self._entries.items()}
        for node in self._expected:
            if node not in found:
                found[node] = Entry(self._path(node), Level.STALE, MISSING, missing=True)
        return sorted(found.items())

    def _leaf(self, name: str, received: _Received, now_s: float) -> Entry:
        stale = not 0.0 <= now_s - received.at_s <= self._stale_after_s
        return Entry(
            self._path(name), Level.STALE if stale else received.level, received.message, payload=received.payload
        )

    def _path(self, name: str) -> str:
        return f"{self._base_path}/{self._group(name)}/{name.replace('/', ' ')}"

    def _group(self, name: str) -> str:
        return self._group_of.get(name.partition(":")[0], OTHER)


def _parent(path: str, children: Sequence[tuple[str, Entry]]) -> Entry:
    levels = [entry.level for _, entry in children]
    worst = max(levels, default=Level.OK)
    if worst is Level.STALE and any(level is not Level.STALE for level in levels):
        worst = Level.ERROR
    return Entry(path, worst, _TEXT[worst], tuple((name, _text_of(entry)) for name, entry in children))


def _text_of(entry: Entry) -> str:
    return _TEXT[Level.STALE] if entry.level is Level.STALE and not entry.missing else entry.message
