"""The loop that owns a simulation in a process: paces it, serves requests, and calls what is due."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from sim.faults import Faults
from sim.imu import ImuSample
from sim.pacing import Pacer
from sim.requests import RequestQueue
from sim.simulation import Simulation

# Longer waits are cut, so that a signal ends the loop soon even in slow motion.
_LONGEST_WAIT_S = 0.1


@dataclass(frozen=True, slots=True)
class Task:
    """Something to do every ``period_steps`` steps."""

    period_steps: int
    run: Callable[[], None]


class Loop:
    """Steps ``sim`` at the pace of ``pacer``. ``on_sample`` takes the inertial unit's samples."""

    def __init__(
        self,
        sim: Simulation,
        faults: Faults,
        pacer: Pacer,
        tasks: tuple[Task, ...],
        on_sample: Callable[[ImuSample], None],
    ) -> None:
        self._sim, self._faults, self._pacer = sim, faults, pacer
        self._tasks = tasks
        self._on_sample = on_sample
        self.requests = RequestQueue()

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Until ``should_stop`` says so. Raises SimulationDiverged."""
        pacer = self._pacer
        pacer.start(time.monotonic())
        while not should_stop():
            wait_s = pacer.wait_s(time.monotonic())
            while wait_s > 0.0 and not should_stop():
                time.sleep(min(wait_s, _LONGEST_WAIT_S))
                wait_s -= _LONGEST_WAIT_S
            self._step()

    def inject(self, kind: str, target: str, value: float, duration_s: float, timeout_s: float = 2.0) -> str:
        """Raises or clears a fault between two steps; for other threads. Raises FaultRefused, NotServed."""
        return self.requests.ask(lambda: self._faults.inject(kind, target, value, duration_s), timeout_s)

    def _step(self) -> None:
        self.requests.serve()
        sample = self._sim.step()
        self._faults.update()
        if sample is not None:
            self._on_sample(sample)
        steps = self._sim.world.steps
        for task in self._tasks:
            if steps % task.period_steps == 0:
                task.run()
