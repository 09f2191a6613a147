"""The scheduler of a run, which owns time, the network, the processes and the random streams."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from robot_stack.core.config import load
from robot_stack.core.runtime import AlreadyRunning
from sim.scheduler.calls import Calls
from sim.scheduler.events import NANOSECONDS, EventQueue
from sim.scheduler.logs import LogLine
from sim.scheduler.network import Network, Watchers
from sim.scheduler.observers import LifeChange, Observer
from sim.scheduler.params import SchedulerParams
from sim.scheduler.port import SimPort
from sim.scheduler.process import Computer, Life, NodeFactory, Process
from sim.scheduler.streams import Streams

# 2026-01-01 00:00:00 UTC: a run must not depend on the day it is made.
_CLOCK_START_NS = 1_767_225_600 * NANOSECONDS
# A computer has been up for up to a day: the difference between two clocks shows that they were confused.
_LONGEST_UPTIME_NS = 86_400 * NANOSECONDS
_FIRST_PROCESS_ID = 1001
_RUNTIME_VARIABLE = "ROBOT_STACK_RUNTIME_DIR"

WORLD_ORDER = 0
"""The order of events that belong to no node: of those at one time they come first."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A process that ended by itself, or failed on its way out. text: the traceback, or the reason of a refusal."""

    time_ns: int
    process: str
    text: str


class Scheduler:
    """Runs nodes in one thread and in virtual time. The same seed makes the same run.

    A context manager: node records live in a runtime folder of its own, which goes at the end.
    """

    def __init__(
        self,
        seed: int,
        params: SchedulerParams | None = None,
        *,
        clock_start_ns: int = _CLOCK_START_NS,
        parallel: bool = False,
        sink: Callable[[LogLine], None] | None = None,
    ) -> None:
        """params: None for ``config/scheduler.yaml``. clock_start_ns: the ROS clock at virtual time 0.

        parallel: jobs of workers run in threads until their results are due; changes no result. sink: called with each
        line that a node logs, beside ``log``.
        """
        self.params = params or load(SchedulerParams, "scheduler")
        self.clock_start_ns = clock_start_ns
        self.events = EventQueue()
        self.streams = Streams(seed)
        self.watchers = Watchers()
        self.network = Network(
            self.events, self.streams, self.params.latency, self.params.discovery.leave, self.watchers
        )
        self.calls = Calls(self.network)
        self.devices: dict[Callable[..., Any], Callable[..., Any]] = {}
        self.processes: dict[str, Process] = {}
        self.failures: list[Failure] = []
        self.log: list[LogLine] = []
        self.lease_ns = round(self.params.discovery.lease_s * NANOSECONDS)
        self.pool = ThreadPoolExecutor(os.cpu_count(), "job") if parallel else None
        self._sink = sink
        self._computers: dict[str, Computer] = {}
        self._process_id = _FIRST_PROCESS_ID
        self._holders: dict[str, Life] = {}
        self._seen: list[tuple[SimPort, int, list[int]]] = []
        self._runtime: Path | None = None
        self._outer_runtime: str | None = None

    # --- the run -----------------------------------------------------------------------------------------------------

    def __enter__(self) -> Scheduler:
        shared = Path("/dev/shm")
        parent = shared if os.access(shared, os.W_OK) else None
        self._runtime = Path(tempfile.mkdtemp(prefix="robot_stack_scheduler-", dir=parent))
        self._outer_runtime = os.environ.get(_RUNTIME_VARIABLE)
        os.environ[_RUNTIME_VARIABLE] = str(self._runtime)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends threads and removes the runtime folder. Nodes are dropped without their safe outputs."""
        if self.pool is not None:
            self.pool.shutdown()
        if self._runtime is not None:
            shutil.rmtree(self._runtime, ignore_errors=True)
            self._runtime = None
            if self._outer_runtime is None:
                os.environ.pop(_RUNTIME_VARIABLE, None)
            else:
                os.environ[_RUNTIME_VARIABLE] = self._outer_runtime

    @property
    def runtime_folder(self) -> Path:
        """Raises RuntimeError outside of the context."""
        if self._runtime is None:
            raise RuntimeError("the scheduler has not been entered")
        return self._runtime

    @property
    def now_ns(self) -> int:
        """Virtual time, from 0."""
        return self.events.now_ns

    @property
    def now_s(self) -> float:
        return self.events.now_ns / NANOSECONDS

    def at(self, time_ns: int, callback: Callable[..., Any], *args: Any, order: int = WORLD_ORDER) -> None:
        """Calls ``callback(*args)`` at that virtual time. order: among the events of one time. Raises ValueError."""
        self.events.push(time_ns, order, callback, *args)

    def every(self, period_ns: int, callback: Callable[[], Any], *, start_ns: int | None = None) -> None:
        """Calls ``callback`` at exact periods, before the nodes at that time."""

        def call() -> None:
            self.events.push(self.events.now_ns + period_ns, WORLD_ORDER, call)
            callback()

        self.events.push(self.events.now_ns if start_ns is None else start_ns, WORLD_ORDER, call)

    def run(self, until_s: float, condition: Callable[[], bool] | None = None) -> bool:
        """Runs up to that virtual time, or until the condition holds or ``stop`` is called.

        condition: asked after each event. Returns True if it ended the run.
        """
        self.events.resume()
        return self.events.run(round(until_s * NANOSECONDS), condition)

    def run_for(self, duration_s: float, condition: Callable[[], bool] | None = None) -> bool:
        return self.run(self.now_s + duration_s, condition)

    def stop(self) -> None:
        """Ends ``run`` after the present event."""
        self.events.stop()

    def add_observer(self, observer: Observer) -> None:
        self.watchers.add(observer)

    # --- processes ---------------------------------------------------------------------------------------------------

    def spawn(
        self,
        name: str,
        *factories: NodeFactory,
        at_s: float | None = None,
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
        computer: str = "robot",
    ) -> Process:
        """A process with a node of each factory, ordered to start at ``at_s`` of virtual time, None: now.

        parameters: overrides by node name and dotted parameter. Raises ValueError for a name that is taken.
        """
        if self._runtime is None:
            raise RuntimeError("a scheduler runs inside its with statement: its nodes need its runtime folder")
        if name in self.processes:
            raise ValueError(f"there is a process {name!r} already; call its start() or restart()")
        order = WORLD_ORDER + 1 + 2 * len(self.processes)  # two each: arrivals, then wake-ups
        process = Process(self, name, order, factories, parameters or {}, self.computer(computer))
        self.processes[name] = process
        process.start(None if at_s is None else round(at_s * NANOSECONDS))
        return process

    def computer(self, name: str = "robot") -> Computer:
        """The computer of this name, created with a random uptime at the first request."""
        found = self._computers.get(name)
        if found is None:
            uptime_ns = int(self.streams.generator(f"computer/{name}").integers(NANOSECONDS, _LONGEST_UPTIME_NS))
            found = self._computers[name] = Computer(self.clock_start_ns, uptime_ns)
        return found

    def step_system_clock(self, step_s: float, computer: str = "robot") -> None:
        """A fault: the computer's system clock, and with it the ROS clock, jumps."""
        self.computer(computer).system_start_ns += round(step_s * NANOSECONDS)

    # --- asked by processes and ports --------------------------------------------------------------------------------

    def next_process_id(self) -> int:
        self._process_id += 1
        return self._process_id - 1

    def hold_name(self, name: str, life: Life) -> None:
        """Raises AlreadyRunning if a node of this name lives."""
        holder = self._holders.get(name)
        if holder is not None and holder.alive:
            raise AlreadyRunning(f"{name} is already running on this scheduler (process {holder.process_id})")
        self._holders[name] = life

    def release_name(self, name: str, life: Life, gone_ns: int) -> None:
        """gone_ns: end of the node's visibility to others."""
        if self._holders.get(name) is life:
            del self._holders[name]
        for port, _, gone in self._seen:
            if port.life is life and port.name == name:
                gone[:] = [gone_ns]

    def show_node(self, port: SimPort, visible_ns: int) -> None:
        """A node that others see from ``visible_ns`` on."""
        self._seen.append((port, visible_ns, []))

    def visible_nodes(self, viewer: SimPort) -> list[str]:
        now_ns = self.events.now_ns
        self._seen = [item for item in self._seen if not item[2] or now_ns < item[2][0]]
        return [port.name for port, visible_ns, _ in self._seen if port is viewer or visible_ns <= now_ns]

    def on_log(self, line: LogLine) -> None:
        self.log.append(line)
        if self._sink is not None:
            self._sink(line)

    def on_failure(self, process: str, text: str) -> None:
        self.failures.append(Failure(self.events.now_ns, process, text))
        for watch in self.watchers.exception:
            watch(self.events.now_ns, process, text)

    def on_life_change(self, process: str, change: LifeChange) -> None:
        for watch in self.watchers.life_change:
            watch(self.events.now_ns, process, change)
