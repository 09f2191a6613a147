"""The loop of a motion engine's process with its machine: an engine cycle, then a cycle of the plant, paced."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from robot_stack.core.pacing import Sleeper, sharpen_sleep
from robot_stack.wmx.bus import ServoBus
from robot_stack.wmx.engine_server.server import EngineServer
from sim.plant.fault_table import FaultKind, FaultTable
from sim.run.pacing import Pacer
from sim.run.requests import RequestQueue

_FAREWELL_S = 1.0


class Plant(Protocol):
    """A machine on a bus. ``step`` is one engine cycle of it, with or without communication."""

    @property
    def bus(self) -> ServoBus: ...

    @property
    def time_s(self) -> float: ...

    @property
    def fault_kinds(self) -> Mapping[str, FaultKind]: ...

    def step(self) -> None: ...


@dataclass(frozen=True, slots=True)
class EveryCycles:
    """A call every ``cycles`` cycles."""

    cycles: int
    run: Callable[[], None]


class EngineLoop:
    """Belongs to one thread; only ``inject`` is for others."""

    def __init__(
        self, server: EngineServer, plant: Plant, catch_up_s: float, tasks: tuple[EveryCycles, ...] = ()
    ) -> None:
        self.server, self._plant, self._tasks = server, plant, tasks
        self._faults = FaultTable(plant, plant.fault_kinds)
        self._requests = RequestQueue()
        self._sleeper = Sleeper(server.engine.config.server.spin)
        self.pacer = Pacer(server.engine.config.cycle_time_s, 1.0, catch_up_s, time.monotonic())

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Runs until ``should_stop`` returns True."""
        sharpen_sleep()
        self.pacer.start(time.monotonic())
        while not should_stop():
            now_ns = time.monotonic_ns()
            wait_s = self.pacer.wait_s(1e-9 * now_ns)
            if wait_s > 0.0:
                self._sleeper.until(now_ns + round(1e9 * wait_s))
            self._turn()

    def shut_down(self) -> None:
        """Stops all axes at their quick-stop deceleration, then the engine. For an orderly end: clients that end at the
        same time can still switch their servos off.
        """
        engine = self.server.engine
        for axis in range(engine.arrays.n_axes):
            engine.motion.quick_stop_axis(axis)
        now_s = time.monotonic()
        farewell_s, stop_s = now_s + _FAREWELL_S, now_s + engine.config.server.shutdown_stop_s
        self.run(lambda: not len(engine.devices) or time.monotonic() > farewell_s)
        self.run(lambda: engine.at_rest or time.monotonic() > stop_s)
        engine.stop_engine()
        self.server.close()

    def inject(self, kind: str, target: str, value: float, duration_s: float, timeout_s: float = 2.0) -> str:
        """Raises or clears a fault between two cycles. Raises FaultRefused, NotServed."""
        return self._requests.ask(lambda: self._faults.inject(kind, target, value, duration_s), timeout_s)

    def _turn(self) -> None:
        self._requests.serve()
        condition = self.server.engine.condition
        condition.overruns = self.pacer.total_overruns
        self.server.cycle()
        self._plant.step()
        self._faults.update()
        for task in self._tasks:
            if condition.cycles % task.cycles == 0:
                task.run()
