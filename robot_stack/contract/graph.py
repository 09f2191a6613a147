"""Nodes that the contract's rows require or forbid at an endpoint: pure, for tools, tests and the system monitor."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from robot_stack.contract.model import EVERY_NODE, Topic

# They subscribe to every row, and are therefore in the subscribers of none.
RECORDERS = ("recorder", "black_box")


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Node names that publish and subscribe to a topic in the live graph."""

    publishers: frozenset[str] = frozenset()
    subscribers: frozenset[str] = frozenset()


def expected(names: Collection[str], nodes: Collection[str], exempt: Collection[str] = ()) -> frozenset[str]:
    """The ``names`` of a row that run here; of a row of every node all. exempt: nodes that may lack the endpoint."""
    if EVERY_NODE in exempt:
        return frozenset()
    wanted = frozenset(nodes) if EVERY_NODE in names else frozenset(names) & frozenset(nodes)
    return wanted - frozenset(exempt)


def doubled(names: Iterable[str], exempt: Collection[str]) -> tuple[str, ...]:
    """Names that several nodes of the graph have, sorted. exempt: of tools, of which several may run."""
    counted = Counter(names)
    return tuple(sorted(name for name in counted if counted[name] > 1 and name not in exempt))


def lacking(row: Topic, seen: Endpoints, nodes: Collection[str]) -> tuple[str, ...]:
    """Endpoints that the row requires and the graph lacks, in words. nodes: the nodes that run here."""
    publishers = expected(row.publishers, nodes, row.sometimes) - seen.publishers
    # The only publisher of a row for every node need not subscribe to itself.
    itself = row.publishers if EVERY_NODE in row.subscribers and len(row.publishers) == 1 else ()
    subscribers = expected(row.subscribers, nodes, (*row.sometimes, *itself)) - seen.subscribers
    return (
        *(["not published by " + ", ".join(sorted(publishers))] if publishers else []),
        *(["not subscribed to by " + ", ".join(sorted(subscribers))] if subscribers else []),
    )


def strangers(row: Topic, seen: Endpoints, nodes: Collection[str]) -> tuple[str, ...]:
    """Nodes of the stack with an endpoint that the row does not list, in words. Tools may subscribe to everything."""
    publishers = seen.publishers - set(row.publishers)
    subscribers = (seen.subscribers - {*row.subscribers, *RECORDERS}) & set(nodes)
    return (
        *(f"published by {name}" for name in sorted(publishers) if EVERY_NODE not in row.publishers),
        *(f"subscribed to by {name}" for name in sorted(subscribers) if EVERY_NODE not in row.subscribers),
    )
