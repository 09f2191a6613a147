"""Delivery records in shared memory: a simulated world waits until subscribers have received all published messages.

Every node of a stack on a shared world clock has a page with two numbers for each row of the contract: the time of its
last publication, and the source timestamp of the last message it received. Both are the system clock of this machine:
the publisher records the time before it publishes, as soon as the message is with the middleware, and the middleware
stamps the message in between. So a message is outstanding while the subscriber's number is below a publisher's.
Messages that history depth 1 overwrote count as received with the newer one, and a row may have several publishers: the
sockets of a process keep the order in which they were sent.

A subscriber that has received no message of a row yet has none outstanding: it may not be matched.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robot_stack.contract.model import Topic
from robot_stack.contract.topics import TOPICS
from robot_stack.core.runtime import runtime_dir
from robot_stack.core.shared_page import SharedPage

NUMBERS = {row: number for number, row in enumerate(TOPICS)}
_ROWS = len(TOPICS)
# How a node uses a row.
PUBLISHES, TAKES, WAKES = 1, 2, 4
_COLUMNS = 3
_SETTLED_NS = 1_000_000_000
_LOST = _COLUMNS * _ROWS


def _folder() -> Path:
    return runtime_dir() / "deliveries"


@dataclass(slots=True)
class Delivery:
    """The numbers of one node, by row [ns of the system clock]; 0: no message yet. uses: how the node uses the row.

    lost: how many messages it no longer waits for.
    """

    published: memoryview | list[int] = field(default_factory=lambda: [0] * _ROWS)
    taken: memoryview | list[int] = field(default_factory=lambda: [0] * _ROWS)
    uses: memoryview | list[int] = field(default_factory=lambda: [0] * _ROWS)
    lost: memoryview | list[int] = field(default_factory=lambda: [0])


def open_delivery(name: str, *, create: bool) -> Delivery:
    """The page of a node; ``create``: makes an empty one. Raises FileNotFoundError if an existing page is missing."""
    if create:
        _folder().mkdir(exist_ok=True)
    singles = SharedPage(_folder() / name, 0, _LOST + 1, create=create).singles
    if create:
        for index in range(len(singles)):
            singles[index] = 0
    published, taken, uses = (singles[column * _ROWS : (column + 1) * _ROWS] for column in range(_COLUMNS))
    return Delivery(published, taken, uses, singles[_LOST:])


class Deliveries:
    """The pages of this domain's nodes, for readers. Pages of nodes that have ended stay until their successor."""

    def __init__(self) -> None:
        self._seen_ns = 0
        self.pages: dict[str, Delivery] = {}

    def search(self) -> None:
        """Adds the pages of nodes that have started since the last call."""
        try:
            changed_ns = os.stat(_folder()).st_mtime_ns
        except FileNotFoundError:
            return
        if changed_ns == self._seen_ns:
            return
        for path in _folder().iterdir():
            if path.name not in self.pages:
                with contextlib.suppress(FileNotFoundError):  # being made: the next search finds it
                    self.pages[path.name] = open_delivery(path.name, create=False)
        # The clock of a file system is coarse: a file may still appear without a visible change.
        self._seen_ns = changed_ns if time.time_ns() - changed_ns > _SETTLED_NS else 0


@dataclass(frozen=True, slots=True)
class Debt:
    """A message that a node has not received. sent_ns: ``published`` of its publisher at the time."""

    row: int
    sent_ns: int


def debts(own: Delivery, rows: Iterable[int], publishers: Mapping[int, Sequence[Delivery]]) -> list[Debt]:
    """The messages of ``rows`` outstanding for ``own``."""
    found = []
    for row in rows:
        taken_ns = own.taken[row]
        if not taken_ns:
            continue
        sent_ns = max((item.published[row] for item in publishers.get(row, ())), default=0)
        if sent_ns > taken_ns:
            found.append(Debt(row, sent_ns))
    return found


def open_debts(own: Delivery, known: Iterable[Debt]) -> list[Debt]:
    """Those of ``known`` that are still outstanding."""
    return [debt for debt in known if own.taken[debt.row] < debt.sent_ns]


def write_off(own: Delivery, known: Sequence[Debt]) -> None:
    """Marks these messages as lost: the world no longer waits for them."""
    for debt in known:
        own.taken[debt.row] = debt.sent_ns
    own.lost[0] += len(known)


def publishers_by_row(pages: Iterable[Delivery]) -> dict[int, list[Delivery]]:
    found: dict[int, list[Delivery]] = {}
    for page in pages:
        for row in range(_ROWS):
            if page.uses[row] & PUBLISHES:
                found.setdefault(row, []).append(page)
    return found


def rows_taken(page: Delivery, use: int = TAKES) -> tuple[int, ...]:
    """The rows that a node subscribes to; with WAKES: the rows that wake it."""
    return tuple(row for row in range(_ROWS) if page.uses[row] & use)


def topic_name(row: int) -> str:
    return TOPICS[row].name


def number_of(row: Topic) -> int | None:
    """None for a row that is not the contract's, as of a test."""
    return NUMBERS.get(row)
