"""The nodes that a simulated world waits for.

It waits for a node that is late with a timer, which each node writes to its record (``robot_stack.core.node_record``),
and for a node that has not taken a message that wakes it (``robot_stack.core.deliveries``). A node whose timer is due
takes first what was published to it, so that messages without a wake-up are waited for by the timer.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

from robot_stack.core.deliveries import WAKES, Delivery, debts, publishers_by_row, rows_taken, topic_name


def late(due_s: Mapping[str, float], time_s: float, tolerance_s: float) -> dict[str, str]:
    """Late nodes at a simulated time, and their delays. due_s: next due time by node.

    tolerance_s: simulated time by which a node may be late before the world waits.
    """
    return {name: f"{1e3 * (time_s - due):.0f} ms late" for name, due in due_s.items() if time_s - due > tolerance_s}


@dataclass(frozen=True, slots=True)
class _Subscriber:
    name: str
    page: Delivery
    rows: tuple[int, ...]


class Mail:
    """Nodes that have not taken a message that wakes them. pages: of all nodes, by name."""

    def __init__(self, pages: Mapping[str, Delivery], names: Sequence[str]) -> None:
        """names: the nodes that the world waits for."""
        self._publishers = publishers_by_row(pages.values())
        self._subscribers = [
            _Subscriber(name, pages[name], rows_taken(pages[name], WAKES)) for name in names if name in pages
        ]

    def owed(self, among: Container[str] | None = None) -> dict[str, str]:
        """By node, the topics of these messages. among: only these nodes; None means all."""
        found = {}
        for item in self._subscribers:
            if among is not None and item.name not in among:
                continue
            owed = debts(item.page, item.rows, self._publishers)
            if owed:
                found[item.name] = "message on " + ", ".join(topic_name(debt.row) for debt in owed)
        return found


def describe(waiting: Mapping[str, str]) -> str:
    """``name (reason)`` of the first three."""
    shown = [f"{name} ({reason})" for name, reason in list(waiting.items())[:3]]
    more = len(waiting) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")
