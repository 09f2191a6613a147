"""Counts what a node publishes and takes, and holds its timers back until it has taken what was published to it.

On a shared world clock only: on a robot, and on the system clock, nothing is counted and nothing waits.

A timer of a node on simulated time sees every message that was published before it was due, however long the message
lies in a socket or in a thread that gets no processor: the node is late meanwhile, and the world waits for a late node
(``sim.nodes.world_time``). Messages that wake a node are waited for by the world itself, at every block.

A message that is lost, or was never for this node, is given up once nothing is on its way any more
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
# So many looks in a row find everything asleep: a thread that waits for Python's lock sleeps too, but not for long.
_LOOKS = 5
_SEARCH_S = 1.0


class NodeDeliveries:
    """counting: the node lives on a shared world clock. bulk_idle: no cloud or image waits to be taken."""

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
        """The publisher; what it publishes is counted from now on."""
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
        """The callback of a subscription; what it is called with is taken. From then on the node's record says busy."""
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
        """A subscription has ended: nothing of the row is owed any more."""
        number = number_of(row)
        if self.counting and number is not None:
            self._own.uses[number] &= PUBLISHES
            self._own.taken[number] = 0
            self._tick.follow_rows()
            self._urgent.follow_rows()

    def close(self) -> None:
        """Nobody waits for this node any more."""
        if self.counting:
            for number in range(len(self._own.uses)):
                self._own.uses[number] = self._own.taken[number] = 0

    # --- what the node's timers ask ----------------------------------------------------------------------------------

    def owed(self) -> bool:
        """A timer is due: must it wait for messages? What is published meanwhile is not waited for."""
        return self.counting and self._tick.pending(self._found_publishers())

    # --- a schedule of the executor: looks again while an urgent message is on its way -------------------------------

    def wait_s(self) -> float:
        return _LOOK_S if self._urgent.begun(self._publishers) else math.inf

    def due(self) -> Iterator[Callable[[], Any]]:
        self._urgent.pending(self._found_publishers())
        return iter(())

    def _found_publishers(self) -> dict[int, list[Delivery]]:
        now_s = time.monotonic()
        if now_s - self._searched_s > _SEARCH_S:
            self._searched_s = now_s
            self._others.search()
            # Anew each time: a node that is there may have got another publisher.
            self._publishers = book.publishers_by_row(self._others.pages.values())
        return self._publishers


class _Wait:
    """For what is owed at one moment, until it is taken or lost."""

    def __init__(self, own: Delivery, use: int, idle: Callable[[], bool]) -> None:
        self._own, self._use, self._idle = own, use, idle
        self._rows: tuple[int, ...] = ()
        self._debts: list[Debt] = []
        self._quiet = 0
        self._looked_s = 0.0

    def follow_rows(self) -> None:
        self._rows = book.rows_taken(self._own, self._use)

    def begun(self, publishers: dict[int, list[Delivery]]) -> bool:
        """There is something to wait for."""
        if not self._debts:
            self._debts, self._quiet = book.debts(self._own, self._rows, publishers), 0
        return bool(self._debts)

    def pending(self, publishers: dict[int, list[Delivery]]) -> bool:
        """False once everything that was owed when it was asked first is taken or lost."""
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
