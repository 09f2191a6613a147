"""Counters of a device's data errors: lost, doubled, corrupt, rejected."""

from __future__ import annotations

from collections import Counter


class Counters:
    """Counts by name, in the order of their first occurrence. Names are for people: "lost sweeps"."""

    def __init__(self, *names: str) -> None:
        self._counts: Counter[str] = Counter(dict.fromkeys(names, 0))

    def add(self, name: str, count: int = 1) -> None:
        self._counts[name] += count

    def __getitem__(self, name: str) -> int:
        return self._counts[name]

    def values(self) -> dict[str, str]:
        """For /diagnostics."""
        return {name: str(count) for name, count in self._counts.items()}
