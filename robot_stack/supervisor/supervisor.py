"""The supervisor's loop: reads heartbeats, applies timeouts, starts and ends processes, answers requests."""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import sys
import time
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import Any

from robot_stack.contract import topics
from robot_stack.core.node_record import NodeRecords
from robot_stack.core.runtime import ros_domain_id
from robot_stack.core.world_clock import WorldClock
from robot_stack.supervisor import orphans, segments
from robot_stack.supervisor.control import ControlServer, Reply
from robot_stack.supervisor.fleet import Fleet
from robot_stack.supervisor.keys import VERBS, Keys
from robot_stack.supervisor.lifecycle import RUNNING, Lifecycle, Order, StartQueue, State, judged
from robot_stack.supervisor.node_thread import NodeThread
from robot_stack.supervisor.params import SupervisorParams
from robot_stack.supervisor.profile import Plan
from robot_stack.supervisor.starvation import Starvation

_TICK_S = 0.05
# A loop that is this late was not running: the computer was suspended, or the process stopped.
_ABSENT_S = 1.0


class Supervisor:
    """Runs the plan until stopped."""

    def __init__(self, plan: Plan, params: SupervisorParams, run_dir: Path) -> None:
        self._plan = plan
        self._params = params
        self._run_dir = run_dir
        if plan.use_sim_time:
            WorldClock.make()  # before any node looks for it
        else:
            WorldClock.remove()
        # The forkserver first: it and the node's thread import at the same time, on two cores.
        self._fleet = Fleet(plan, run_dir, params)
        self._node_thread = NodeThread()
        self._keys = Keys(self._node_thread)
        self._records = NodeRecords()
        self._starvation = Starvation()
        self._last_records: dict[
            str, tuple[int, int, str]
        ] = {}  # by process: its id, heartbeats and text, as taken last
        self._rows = {process.name: process for process in plan.processes}
        self._lives = {name: Lifecycle(row, params) for name, row in self._rows.items()}
        clock_sources = [p.name for p in plan.processes if set(p.nodes) & set(topics.CLOCK.publishers)]
        self._queue = StartQueue(params.start_at_once, frozenset(clock_sources if plan.use_sim_time else ()))
        self._selector = selectors.DefaultSelector()
        self._control = ControlServer(self._selector, self._on_request)
        self._begun_s = time.monotonic()
        self._ready_after_s: float | None = None
        self._nodeless_logged = False
        self._stopping = False
        self._farewells: list[Reply] = []
        self._install_signals()

    # --- the loop ----------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Returns when everything has stopped."""
        now_s = time.monotonic()
        for life in self._lives.values():
            life.wanted(now_s)
        last_s = now_s
        while not self._stopping:
            now_s = time.monotonic()
            if now_s - last_s > _ABSENT_S:
                _log(f"absent for {now_s - last_s:.1f} s: missing heartbeats in that time are ignored")
                for life in self._lives.values():
                    life.forgive(now_s - last_s)
            last_s = now_s
            self._read_records()
            self._collect()
            self._judge(now_s)
            self._keys.tick(now_s)
            self._wait(_TICK_S)
        self._stop_all()

    def _wait(self, timeout_s: float) -> None:
        """Sleeps until an event: a request, the end of a process, a signal."""
        sentinels = self._fleet.sentinels()
        for descriptor in sentinels:
            self._selector.register(descriptor, selectors.EVENT_READ, None)
        try:
            events = self._selector.select(timeout_s)
        finally:
            for descriptor in sentinels:
                self._selector.unregister(descriptor)
        for key, _ in events:
            if key.data is not None:
                key.data()

    def _read_records(self) -> None:
        for name, pid in self._fleet.pids().items():
            record = self._records.read(name)
            # An ending process may still report after its successor has started.
            if record is None or record.pid != pid or self._last_records.get(name) == (pid, record.beats, record.text):
                continue
            self._last_records[name] = pid, record.beats, record.text
            life = self._lives[name]
            if not record.beats:
                life.constructing(record.text)
                continue
            before = life.state
            life.heartbeat(record.beat_s, record.ready, record.text)
            if life.state is State.READY and before in (State.STARTING, State.WAITING):
                _log(f"{name}: ready")
        if self._ready_after_s is None and all(life.state is State.READY for life in self._lives.values()):
            self._ready_after_s = time.monotonic() - self._begun_s
            _log(f"all {len(self._lives)} processes are ready after {self._ready_after_s:.1f} s")
        if self._node_thread.error and not self._nodeless_logged:
            self._nodeless_logged = True
            _log(self._node_thread.error)

    def _collect(self) -> None:
        for name in list(self._fleet.pids()):
            code = self._fleet.collect(name)
            if code is not None:
                life = self._lives[name]
                life.exited(time.monotonic(), code)
                _log(f"{name}: {life.reason}")
                segments.remove_dead()

    def _judge(self, now_s: float) -> None:
        for name, pid in self._fleet.pids().items():
            life = self._lives[name]
            life.starved(self._starvation.of_silence(name, pid, life.heartbeat_age_s(now_s), now_s))
        counts = judged({name: life.silent(now_s) for name, life in self._lives.items() if life.state in RUNNING})
        starting = sum(life.state is State.STARTING for life in self._lives.values())
        # A new forkserver imports for seconds; requests are answered meanwhile.
        forks = any(life.state is State.BACKOFF for life in self._lives.values()) and self._fleet.ready()
        for name, life in self._lives.items():
            if self._queue.holds(name, life, starting) or (life.state is State.BACKOFF and not forks):
                continue
            match life.order(now_s, name in counts):
                case Order.START:
                    self._start(name)
                    starting += 1
                case Order.TERMINATE:
                    _log(f"{name}: {life.reason}; SIGTERM")
                    self._fleet.signal([name], signal.SIGTERM)
                case Order.KILL:
                    _log(f"{name}: did not end on SIGTERM; SIGKILL")
                    self._fleet.signal([name], signal.SIGKILL)

    def _start(self, name: str) -> None:
        pid = self._fleet.start(self._rows[name])
        if pid is None:
            _log(f"{name}: the forkserver has ended; another one is started")
            return
        self._lives[name].started(time.monotonic())
        _log(f"{name}: started, process {pid}")

    # --- stop --------------------------------------------------------------------------------------------------------

    def _install_signals(self) -> None:
        # Signals wake the selector through this pair, whatever thread they arrive in.
        receiver, sender = os.pipe()
        os.set_blocking(receiver, False)
        os.set_blocking(sender, False)
        signal.set_wakeup_fd(sender, warn_on_full_buffer=False)
        self._selector.register(receiver, selectors.EVENT_READ, lambda: os.read(receiver, 256))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        _log(f"{signal.Signals(number).name}: stopping")
        self._stopping = True

    def _stop_all(self) -> None:
        begun_s = time.monotonic()
        stopped = sorted(self._fleet.pids())
        steps = [
            (0.0, signal.SIGINT),
            (self._params.interrupt_s, signal.SIGTERM),
            (self._params.terminate_s, signal.SIGKILL),
        ]
        killed: list[str] = []
        while self._fleet.pids():
            left = sorted(self._fleet.pids())
            if steps and time.monotonic() - begun_s >= steps[0][0]:
                _, number = steps.pop(0)
                _log(f"{number.name} to {', '.join(left)}")
                self._fleet.signal(left, number)
                killed = left if number is signal.SIGKILL else killed
            self._wait(_TICK_S)
            for name in list(self._fleet.pids()):
                if self._fleet.collect(name) is not None:
                    self._lives[name].stopped()
        self._node_thread.close()
        orphans.forget()
        self._control.close()
        segments.remove_dead()
        WorldClock.remove()
        removed = orphans.remove_stale_sockets()
        for path in removed:
            _log(f"removed the stale socket {path}")
        _log(f"stopped {len(stopped)} processes in {time.monotonic() - begun_s:.1f} s")
        for reply in self._farewells:
            reply({"ok": True, "stopped": stopped, "killed": killed})

    # --- requests ----------------------------------------------------------------------------------------------------

    def _on_request(self, request: dict[str, Any], reply: Reply) -> None:
        match request.get("verb"):
            case "status":
                reply(self.status())
            case "restart":
                reply(self._restart(str(request.get("process"))))
            case "down":
                _log("asked to stop")
                self._stopping = True
                self._farewells.append(reply)
            case verb if verb in VERBS:
                if verb != "safety":
                    _log(f"{verb} requested")
                self._keys.on_request(verb, reply, time.monotonic())
            case verb:
                reply({"ok": False, "error": f"unknown verb {verb!r}"})

    def _restart(self, name: str) -> dict[str, Any]:
        life = self._lives.get(name)
        if life is None:
            return {"ok": False, "error": f"{name!r} does not run here; processes: {', '.join(self._lives)}"}
        if self._stopping:
            return {"ok": False, "error": "the stack is stopping"}
        _log(f"{name}: restart requested")
        life.wanted(time.monotonic())
        if name in self._fleet.pids():
            self._fleet.signal([name], signal.SIGINT)
        return {"ok": True}

    def status(self) -> dict[str, Any]:
        """The response to ``status``: the complete state for an operator, ready for JSON."""
        now_s = time.monotonic()
        pids = self._fleet.pids()
        node = self._node_thread.node
        safety = node.safety() if node else None
        clock = WorldClock.find() if self._plan.use_sim_time else None
        return {
            "ok": True,
            "profile": self._plan.name,
            "profile_path": str(self._plan.path.resolve()),
            "machine": self._plan.machine.value,
            "use_sim_time": self._plan.use_sim_time,
            "sim_pace": clock.pace if clock is not None else None,
            "sim_speed": clock.speed if clock is not None else None,
            "sim_waits_for": clock.waiting_for if clock is not None else "",
            "domain": ros_domain_id(),
            "pid": os.getpid(),
            "log_dir": str(self._run_dir),
            "stopping": self._stopping,
            "ready": all(life.state is State.READY for life in self._lives.values()),
            "ready_after_s": self._ready_after_s,
            "without_node": self._node_thread.error,
            "safety": asdict(safety) if safety else None,
            "missing": list(self._plan.missing),
            "processes": [
                {
                    "name": name,
                    "pid": pids.get(name),
                    "state": life.state.value,
                    "reason": life.reason,
                    "criticality": self._rows[name].criticality.value,
                    "restarts": life.restarts,
                    "last_exit": life.last_exit,
                    "heartbeat_age_s": life.heartbeat_age_s(now_s),
                }
                for name, life in self._lives.items()
            ],
        }


def _log(text: str) -> None:
    now = datetime.now().isoformat(sep=" ", timespec="milliseconds")
    with contextlib.suppress(OSError):  # of a full disk, or a terminal that has gone
        print(f"{now} {text}", file=sys.stderr, flush=True)
