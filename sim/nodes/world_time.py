"""The simulated time of a world: in shared memory for the stack, as ``/clock`` for others. It waits for late nodes."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

from builtin_interfaces.msg import Time

from robot_stack.core import node_record
from robot_stack.core.deliveries import Deliveries
from robot_stack.core.node_record import NodeRecords
from robot_stack.core.world_clock import WorldClock
from sim.nodes.sim_world import SimWorld
from sim.run.lockstep import Mail, describe, late
from sim.run.processes import Processes

_NANOSECONDS = 1_000_000_000
# Polling periods while the world waits: short at first, because most messages need no longer.
_FIRST_LOOK_S, _LAST_LOOK_S = 0.0001, 0.001
# Period of checks of all nodes and their processes while the world waits; in between it checks only the late ones.
_ALL_S = 0.02
_SEARCH_S = 1.0
_SHOWN_AFTER_S = 0.5


class WorldTime:
    """waited_s: real time for which the world has waited for the stack so far.

    serve: called while it waits, for clients of the world itself: of its motion engine and services.
    """

    def __init__(self, node: SimWorld, processes: Processes, serve: Callable[[], None]) -> None:
        self._node, self._serve = node, serve
        self._clock = WorldClock.make()
        self._start_s = node.params.clock_start_s
        self._stack = _Stack(processes, node.params.wait_tolerance_s)
        self._published = False
        self.waited_s = 0.0

    def stamp(self, time_s: float) -> Time:
        """Time on the nodes' clock of a simulated time since the start."""
        nanoseconds = round((self._start_s + time_s) * _NANOSECONDS)
        return Time(sec=nanoseconds // _NANOSECONDS, nanosec=nanoseconds % _NANOSECONDS)

    def write(self, time_s: float, step_s: float) -> None:
        """Publishes the computed time and the step in shared memory."""
        self._clock.write(self._start_s + time_s, step_s, self._node.params.speed)
        self._published = True

    def write_pace(self, pace: float) -> None:
        self._clock.write_pace(pace)
        self._node.report.values["messages_given_up"] = str(self._stack.given_up)

    def publish(self, time_s: float) -> None:
        """Publishes /clock."""
        self._node.publish_clock(self.stamp(time_s))

    def follow(self, time_s: float, should_stop: Callable[[], bool]) -> None:
        """Waits without a timeout until every node has reached the published time."""
        if not self._published:
            return
        now_s = self._start_s + time_s
        waiting = self._stack.waiting(now_s)
        if not waiting:
            return
        start_s = real_s = all_s = time.monotonic()
        look_s, shown = _FIRST_LOOK_S, ""
        while waiting and not should_stop():
            time.sleep(look_s)
            look_s = min(2.0 * look_s, _LAST_LOOK_S)
            self._serve()
            waiting, real_s = self._stack.overdue(waiting, now_s), time.monotonic()
            if not waiting or real_s - all_s > _ALL_S:
                waiting, all_s = self._stack.waiting(now_s), real_s
            if waiting and real_s - start_s > _SHOWN_AFTER_S:
                shown = self._show(describe(waiting), shown)
        if shown:
            self._show("", shown)
        self.waited_s += real_s - start_s

    def _show(self, text: str, before: str) -> str:
        """For status lines; in /diagnostics it stays, for who looks later. Returns the text."""
        if text != before:
            self._clock.write_waiting_for(text)
            self._node.show_waiting(text)
        return text


class _Stack:
    """The nodes of other processes that use this clock."""

    def __init__(self, processes: Processes, tolerance_s: float) -> None:
        self._processes, self._tolerance_s = processes, tolerance_s
        self._records = NodeRecords()
        self._deliveries = Deliveries()
        self._names: list[str] = []
        self._mail = Mail({}, ())
        self._searched_s = 0.0

    def waiting(self, now_s: float) -> dict[str, str]:
        """By node, what the world waits for. It does not wait for a process that has ended or that a fault stopped."""
        real_s = time.monotonic()
        if real_s - self._searched_s > _SEARCH_S:
            self._searched_s = real_s
            self._search()
        found = self.overdue(self._names, now_s)
        return {name: reason for name, reason in found.items() if self._processes.takes_part(name)}

    def overdue(self, names: Collection[str], now_s: float) -> dict[str, str]:
        """The nodes among ``names`` that are late or have not received a message that wakes them, and why."""
        due_s = {name: self._records.due_s(name) for name in names}
        return self._mail.owed(names) | late(due_s, now_s, self._tolerance_s)

    @property
    def given_up(self) -> int:
        """Messages no longer waited for: lost, or not meant for the subscriber."""
        return sum(page.lost[0] for page in self._deliveries.pages.values())

    def _search(self) -> None:
        self._names = [name for name in node_record.names() if self._processes.takes_part(name)]
        self._deliveries.search()
        self._mail = Mail(self._deliveries.pages, self._names)
