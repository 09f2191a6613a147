"""Publishers and subscribers of the contract's topics in the live graph."""

from __future__ import annotations

from collections.abc import Sequence

from robot_stack.contract import topics
from robot_stack.contract.graph import Endpoints, doubled
from robot_stack.contract.model import Topic
from robot_stack.middleware.node import StackNode


class GraphReader:
    """Endpoint names cost a hundred times as much as their number, so they are read only if the number changes."""

    def __init__(self, node: StackNode, rows: Sequence[Topic]) -> None:
        self._port = node.port
        self._names = tuple(row.name for row in rows)
        self._counts: dict[str, tuple[int, int]] = {}
        self.endpoints: dict[str, Endpoints] = {}
        self.doubles: tuple[str, ...] = ()
        self.version = 0  # counts the changes

    def look(self) -> None:
        """Updates from the graph."""
        changed = [name for name in self._names if self._counts.get(name) != self._count(name)]
        for name in changed:
            self._counts[name] = self._count(name)
            self.endpoints[name] = Endpoints(
                frozenset(self._port.publisher_nodes(name)), frozenset(self._port.subscriber_nodes(name))
            )
        doubles = doubled(self._port.node_names(), topics.OUTSIDE)
        self.version += bool(changed) or doubles != self.doubles
        self.doubles = doubles

    def publishers(self, name: str) -> int:
        """Number of publishers of a topic at the last update."""
        return self._counts.get(name, (0, 0))[0]

    def _count(self, name: str) -> tuple[int, int]:
        return self._port.count_publishers(name), self._port.count_subscribers(name)
