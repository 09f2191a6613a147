"""Counts the messages a node publishes and receives, and holds its timers until it has received all sent to it.

On a shared world clock only: on a robot, and on the system clock, nothing is counted and nothing waits.

A timer of a node on simulated time sees every message that was published before it was due, however long the message
lies in a socket or in a thread without processor time: the node is late meanwhile, and the world waits for a late node
(``sim.nodes.world_time``). The world itself waits at every block for messages that wake a node.

A message that is lost, or was never for this node, is given up once no work is pending in the process
(``robot_stack.core.quiescence``): a criterion without a time limit, which holds at any load.

Not counted: services and actions, ``listen`` (the recorder) and nodes outside the stack.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

from robot_stack.contract.model import Topic
from robot_stack.core import deliveries as book
from robot_stack.core.deliveries import PUBLISHES, TAKES, WAKES, Debt, Delivery, number_of
from robot_stack.core.quiescence import others_asleep

_LOOK_S = 0.002
# So many looks in a row must find everything asleep: a thread that waits for the GIL sleeps too, but briefly.
_LOOKS = 5
_SEARCH_S = 1.0


class NodeDeliveries:
    """counting: the node runs on a shared world clock. bulk_idle: True if no cloud or image waits to be read."""

    def __init__(self, name: str, counting: bool, bulk_idle: Callable[[], bool]) -> None:
        self.counting = counting
        if not counting:
            return
        self._own = book.open_delivery(name, create=True)
        self._others = book.Deliveries()
        self._publishers: dict[int, list[Delivery]] = {}
        self._searched_s = -math.inf
        idle = lambda: bulk_idle() and others_asleep()  # noqa: E731 - one expression for both waits
        self._tick, self._urgent = _Wait(self._own, TAKES, idle), _Wait(self._own, WAKES, idle)

    # --- what the node's endpoints call ------------------------------------------------------------------------------

    def counted(self, row: Topic, publisher: Any) -> Any:
        """The publisher; its messages are counted from now on."""
        number = number_of(row)
        if not self.counting or number is None:
            return publisher
        self._own.uses[number] |= PUBLISHES
        published, publish, now_ns = self._own.published, publisher.publish, time.time_ns

        def publish_and_count(message: Any) -> None:
            before_ns = now_ns()
            publish(message)
            published[number] = before_ns

        publisher.publish = publish_and_count
        return publisher

    def noted(self, row: Topic, callback: Callable[[Any, Any], None], wakes: bool) -> Callable[[Any, Any], None]:
        """Wraps a subscription's callback: counts its messages as received and marks the node as busy."""
        number = number_of(row)
        if not self.counting or number is None:
            return callback
        self._own.uses[number] |= TAKES | (WAKES if wakes else 0)
        self._tick.follow_rows()
        self._urgent.follow_rows()
        taken = self._own.taken

        def note_and_call(message: Any, info: Any) -> None:
            taken[number] = info["source_timestamp"]
            callback(message, info)

        return note_and_call

    def forget(self, row: Topic) -> None:
        """A subscription has ended: no message of the row is outstanding any longer."""
        number = number_of(row)
        if self.counting and number is not None:
            self._own.uses[number] &= PUBLISHES
            self._own.taken[number] = 0
            self._tick.follow_rows()
            self._urgent.follow_rows()

    def close(self) -> None:
        """Clears the record, so that the world no longer waits for this node."""
        if self.counting:
            for number in range(len(self._own.uses)):
                self._own.uses[number] = self._own.taken[number] = 0

    # --- used by the node's timers -----------------------------------------------------------------------------------

    def owed(self) -> bool:
        """True if a due timer must wait for messages. Messages published meanwhile are not waited for."""
        return self.counting and self._tick.pending(self._found_publishers())

    # --- a schedule of the executor: looks again while an urgent message is on its way -------------------------------

    def wait_s(self) -> float:
        return _LOOK_S if self.ready() else math.inf

    def ready(self) -> bool:
        """True while an urgent message is outstanding."""
        return self._urgent.begun(self._publishers)

    def due(self) -> Iterator[Callable[[], Any]]:
        self._urgent.pending(self._found_publishers())
        return iter(())

    def _found_publishers(self) -> dict[int, list[Delivery]]:
        now_s = time.monotonic()
        if now_s - self._searched_s > _SEARCH_S:
            self._searched_s = now_s
            self._others.search()
            # Made again each time: a known node may have a new publisher.
            self._publishers = book.publishers_by_row(self._others.pages.values())
        return self._publishers


class _Wait:
    """Waits for the messages outstanding at one moment, until they are received or lost."""

    def __init__(self, own: Delivery, use: int, idle: Callable[[], bool]) -> None:
        self._own, self._use, self._idle = own, use, idle
        self._rows: tuple[int, ...] = ()
        self._debts: list[Debt] = []
        self._quiet = 0
        self._looked_s = 0.0

    def follow_rows(self) -> None:
        self._rows = book.rows_taken(self._own, self._use)

    def begun(self, publishers: dict[int, list[Delivery]]) -> bool:
        """True if there is something to wait for."""
        if not self._debts:
            self._debts, self._quiet = book.debts(self._own, self._rows, publishers), 0
        return bool(self._debts)

    def pending(self, publishers: dict[int, list[Delivery]]) -> bool:
        """False once every message that was outstanding at the first call is received or lost."""
        if not self._debts:
            return self.begun(publishers)
        self._debts = book.open_debts(self._own, self._debts)
        if self._debts and self._lost():
            book.write_off(self._own, self._debts)
            self._debts = []
        return bool(self._debts)

    def _lost(self) -> bool:
        now_s = time.monotonic()
        if now_s - self._looked_s >= _LOOK_S:
            self._looked_s = now_s
            self._quiet = self._quiet + 1 if self._idle() else 0
        return self._quiet >= _LOOKS
