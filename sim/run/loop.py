"""The loop that owns a simulation in a process: paces it, serves requests, and runs due tasks.

It wakes for a block of steps: on a small machine waking up costs as much as a step. The world then is where it should
be at the end of the block, so what happens inside a block is stamped by how long before that end it is.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from robot_stack.core.pacing import Sleeper, sharpen_sleep
from sim.plant.faults import Faults
from sim.plant.imu import ImuSample
from sim.plant.simulation import Simulation
from sim.run.pacing import Pacer
from sim.run.requests import RequestQueue

# Longer waits are cut, so that a signal ends the loop soon even in slow motion.
_LONGEST_WAIT_NS = 100_000_000


@dataclass(frozen=True, slots=True)
class Task:
    """A call every ``period_steps`` steps."""

    period_steps: int
    run: Callable[[], None]


class Loop:
    """Steps ``sim`` at the pace of ``pacer``, whose period is ``block_steps`` of them.

    ``on_sample`` takes the inertial unit's samples; ``before_block`` is called before each block is computed.
    """

    def __init__(
        self,
        sim: Simulation,
        faults: Faults,
        pacer: Pacer,
        tasks: tuple[Task, ...],
        on_sample: Callable[[ImuSample], None],
        block_steps: int = 1,
        before_block: Callable[[], None] = lambda: None,
    ) -> None:
        self._sim, self._faults, self._pacer = sim, faults, pacer
        self._block_steps = block_steps
        self.block_end_s = 0.0
        """Simulated time at the end of the present block."""
        self._tasks = tasks
        self._on_sample = on_sample
        self._before_block = before_block
        self.requests = RequestQueue()

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Runs until ``should_stop`` returns True. Raises SimulationDiverged."""
        sharpen_sleep()
        pacer, sleeper = self._pacer, Sleeper()
        pacer.start(time.monotonic())
        while not should_stop():
            now_ns = time.monotonic_ns()
            due_ns = now_ns + round(1e9 * pacer.wait_s(1e-9 * now_ns))
            while now_ns < due_ns and not should_stop():
                now_ns = min(due_ns, now_ns + _LONGEST_WAIT_NS)
                sleeper.until(now_ns)
            self._block()

    def inject(self, kind: str, target: str, value: float, duration_s: float, timeout_s: float = 2.0) -> str:
        """Raises or clears a fault between two steps; for other threads. Raises FaultRefused, NotServed."""
        return self.requests.ask(lambda: self._faults.inject(kind, target, value, duration_s), timeout_s)

    def _block(self) -> None:
        sim = self._sim
        self._before_block()
        self.block_end_s = sim.time_s + self._block_steps * sim.world.dt_s
        self.requests.serve()
        sim.begin_block()
        for _ in range(self._block_steps):
            self._step()
        sim.end_block()

    def _step(self) -> None:
        sample = self._sim.step()
        self._faults.update()
        if sample is not None:
            self._on_sample(sample)
        steps = self._sim.world.steps
        for task in self._tasks:
            if steps % task.period_steps == 0:
                task.run()
