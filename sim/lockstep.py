"""Keeps a simulated world from running away from a stack that has no time to follow it on a busy machine.

Whoever has been heard takes part: once silent for longer than allowed, the world waits for it. A part that stays silent
for the whole wait has died or was told to be silent; the world goes on without it until it is heard again.
"""

from __future__ import annotations

from collections.abc import Mapping


class Lockstep:
    """limits_s: by name, the simulated time for which a part may be silent before the world waits."""

    def __init__(self, limits_s: Mapping[str, float]) -> None:
        self._limits_s = dict(limits_s)
        self._heard_s: dict[str, float] = {}

    def heard(self, name: str, time_s: float) -> None:
        """At a simulated time; may be called from another thread."""
        self._heard_s[name] = time_s

    def behind(self, time_s: float) -> list[str]:
        """Who is to be waited for at a simulated time."""
        return [name for name, heard_s in self._heard_s.copy().items() if time_s - heard_s > self._limits_s[name]]

    def give_up(self, names: list[str]) -> None:
        """They take part again once they are heard."""
        for name in names:
            self._heard_s.pop(name, None)
