"""Keeps a simulated world from running away from a stack that has no time to follow it on a busy machine.

Every node of the stack notes on its record when its loop has something to do next (``robot_stack.core.node_record``). A
node whose time has passed is late: the world waits for it. One that stays late for the whole wait hangs or was stopped;
the world goes on without it until it is seen to move again.
"""

from __future__ import annotations

from collections.abc import Mapping


class Lockstep:
    """tolerance_s: simulated time by which a node may be late before the world waits."""

    def __init__(self, tolerance_s: float) -> None:
        self._tolerance_s = tolerance_s
        self._given_up: dict[str, float] = {}

    def behind(self, due_s: Mapping[str, float], time_s: float) -> list[str]:
        """Who is to be waited for at a simulated time. due_s: by node, when it has something to do next."""
        late = {name: due for name, due in due_s.items() if time_s - due > self._tolerance_s}
        # Who moved on, or was forgotten by its record, takes part again.
        self._given_up = {name: due for name, due in self._given_up.items() if due_s.get(name) == due}
        return [name for name in late if name not in self._given_up]

    def give_up(self, names: list[str], due_s: Mapping[str, float]) -> None:
        """They take part again once they have moved on."""
        self._given_up |= {name: due_s[name] for name in names if name in due_s}
