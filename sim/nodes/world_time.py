"""The simulated time of a world: told in shared memory to the stack, as ``/clock`` to others, and held back for who is
late."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from builtin_interfaces.msg import Time

from robot_stack.core import node_record
from robot_stack.core.node_record import NodeRecords
from robot_stack.core.world_clock import WorldClock
from sim.nodes.sim_world import SimWorld
from sim.run.lockstep import Lockstep

_NANOSECONDS = 1_000_000_000
_LOOK_S = 0.001
_SEARCH_S = 1.0


class WorldTime:
    """waited_s: real time for which the world has waited for the stack so far.

    serve: called while it waits, for who waits for the world itself: its motion engine, its services.
    """

    def __init__(self, node: SimWorld, serve: Callable[[], None]) -> None:
        self._node, self._serve = node, serve
        self._clock = WorldClock.make()
        self._start_s = node.params.clock_start_s
        self._stack = _Stack()
        self._lockstep = Lockstep(node.params.wait_tolerance_s)
        self.waited_s = 0.0

    def stamp(self, time_s: float) -> Time:
        """On the nodes' clock, of a simulated time since the start."""
        nanoseconds = round((self._start_s + time_s) * _NANOSECONDS)
        return Time(sec=nanoseconds // _NANOSECONDS, nanosec=nanoseconds % _NANOSECONDS)

    def write(self, time_s: float, step_s: float) -> None:
        """What has been computed, and in which steps it goes on."""
        self._clock.write(self._start_s + time_s, step_s, self._node.params.speed)

    def write_pace(self, pace: float) -> None:
        self._clock.write_pace(pace)

    def follow(self, time_s: float) -> None:
        """Returns when everybody has followed up to the time that was told, or has been waited for long enough."""
        if self._node.params.wait_for_stack_s:
            self._wait(self._start_s + time_s)

    def publish(self, time_s: float) -> None:
        """On /clock."""
        self._node.publish_clock(self.stamp(time_s))

    def _wait(self, now_s: float) -> None:
        due_s = self._stack.due_s()
        behind = self._lockstep.behind(due_s, now_s)
        if not behind:
            return
        start_s = real_s = time.monotonic()
        while behind and real_s - start_s < self._node.params.wait_for_stack_s:
            time.sleep(_LOOK_S)
            self._serve()
            due_s, real_s = self._stack.due_s(), time.monotonic()
            behind = [name for name in self._lockstep.behind(due_s, now_s) if self._stack.alive(name)]
        self._lockstep.give_up(behind, due_s)
        self.waited_s += real_s - start_s


class _Stack:
    """The nodes of other processes that live on this clock."""

    def __init__(self) -> None:
        self._records = NodeRecords()
        self._names: list[str] = []
        self._searched_s = 0.0

    def due_s(self) -> dict[str, float]:
        """By node, when it has something to do next."""
        now_s = time.monotonic()
        if now_s - self._searched_s > _SEARCH_S:
            self._searched_s = now_s
            self._names = [name for name in node_record.names() if self.alive(name)]
        return {name: self._records.due_s(name) for name in self._names}

    def alive(self, name: str) -> bool:
        """In a process other than this, which has not ended."""
        state = self._records.read(name)
        return state is not None and state.pid != os.getpid() and Path(f"/proc/{state.pid}").exists()
