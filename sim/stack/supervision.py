"""The supervisor's policy on the scheduler: processes that end or hang are restarted by the same kernel."""

from __future__ import annotations

from collections.abc import Sequence

from robot_stack.contract.model import Process as Row
from robot_stack.core.node_record import NodeRecords
from robot_stack.supervisor.lifecycle import Lifecycle, Order, State, judged
from robot_stack.supervisor.params import load_params
from sim.scheduler.observers import LifeChange, Observer
from sim.scheduler.process import Process
from sim.scheduler.scheduler import Scheduler

_PERIOD_NS = 50_000_000
ENDED = (LifeChange.STOPPED, LifeChange.KILLED, LifeChange.CRASHED, LifeChange.REFUSED)
"""The ways in which a life ends."""


class Supervision(Observer):
    """Watches the processes of ``rows``. A process is its nodes' records and its exit code, as for the supervisor."""

    def __init__(self, scheduler: Scheduler, rows: tuple[Row, ...]) -> None:
        self._scheduler = scheduler
        self._rows = {row.name: row for row in rows}
        self._lives: dict[str, Lifecycle] = {}
        self._records = NodeRecords()
        self._beats: dict[str, tuple[int, int]] = {}
        self._params = load_params()
        self._begin(rows)
        scheduler.add_observer(self)
        scheduler.every(_PERIOD_NS, self._look)

    def state(self, name: str) -> State:
        return self._lives[name].state

    def all_ready(self) -> bool:
        return all(life.state is State.READY for life in self._lives.values())

    def waiting(self) -> dict[str, str]:
        """Reasons by process that is not ready."""
        return {name: life.reason for name, life in self._lives.items() if life.state is not State.READY}

    def restarts(self) -> dict[str, int]:
        return {name: life.restarts for name, life in self._lives.items() if life.restarts}

    def stop_watching(self, names: Sequence[str] | None = None) -> None:
        """From now on the end of these processes is intended. names: None for all."""
        for name in self._lives if names is None else names:
            self._lives[name].stopped()

    def begin_again(self, names: Sequence[str]) -> None:
        """After a loss of power: a new supervisor, which starts these processes."""
        self._records = NodeRecords()
        self._begin([self._rows[name] for name in names])
        for name in names:
            self._beats.pop(name, None)
            if not self._process(name).alive:
                self._lives[name].started(self._scheduler.now_s)
                self._process(name).start()

    def _begin(self, rows: Sequence[Row]) -> None:
        for row in rows:
            life = self._lives[row.name] = Lifecycle(row, self._params)
            life.wanted(self._scheduler.now_s)

    def on_life_change(self, time_ns: int, process: str, change: LifeChange) -> None:
        life = self._lives.get(process)
        if life is None or life.state is State.STOPPED:
            return
        if change is LifeChange.STARTED:
            life.started(1e-9 * time_ns)
        elif change in ENDED:
            life.exited(1e-9 * time_ns, self._process(process).exit_code or 0)

    def _look(self) -> None:
        now_s = self._scheduler.now_s
        for name, life in self._lives.items():
            self._read(name, life, now_s)
        alive = judged({name: life.silent(now_s) for name, life in self._lives.items()})
        for name, life in self._lives.items():
            match life.order(now_s, judge=name in alive):
                case Order.START if self._process(name).lives:
                    life.started(now_s)
                    self._process(name).start()
                case Order.TERMINATE:
                    self._process(name).stop()
                case Order.KILL:
                    self._process(name).kill()

    def _read(self, name: str, life: Lifecycle, now_s: float) -> None:
        """One heartbeat for the process: it has the lowest readiness of its nodes."""
        states = [self._records.read(node) for node in self._rows[name].nodes]
        if any(state is None or not state.beats for state in states) or not self._process(name).running:
            return
        known = [state for state in states if state is not None]
        beat = known[0].pid, min(state.beats for state in known)
        if self._beats.get(name) != beat:
            self._beats[name] = beat
            life.heartbeat(now_s, all(state.ready for state in known), "; ".join(s.text for s in known if s.text))

    def _process(self, name: str) -> Process:
        return self._scheduler.processes[name]
