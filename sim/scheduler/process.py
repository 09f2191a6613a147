"""Simulated processes: one loop each, as ``robot_stack.ros.executor`` runs it, in virtual time."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from robot_stack.contract.model import ContractViolation
from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import AlreadyRunning
from robot_stack.middleware.port import ports_from
from sim.scheduler.events import NEVER
from sim.scheduler.observers import LifeChange
from sim.scheduler.parts import Scheduler
from sim.scheduler.port import SimPort

Send = Callable[[Any], None]

# As robot_stack.ros.executor: a wait that ends this much too late indicates that the process stalled.
_PAUSE_NS = 30_000_000
# As robot_stack.ros.process, and of a process that a signal ended.
EXIT_STOPPED, EXIT_CRASHED, EXIT_REFUSED, EXIT_KILLED = 0, 1, 2, -9


class EndingNode(Protocol):
    """A node whose outputs can be left safe, such as a StackNode."""

    def safe_output(self) -> None: ...
    def destroy_node(self) -> Any: ...


NodeFactory = Callable[[], EndingNode]


@dataclass(slots=True)
class Computer:
    """The clocks of a computer at virtual time 0, in ns. A step of its system clock changes the first."""

    system_start_ns: int
    monotonic_start_ns: int


class Life:
    """One life of a process: from its construction to its end.

    While the process computes, virtual time stands still for its callbacks; then it is busy until ``busy_until_ns``,
    when its messages leave. hung_ns: for how long it hung in all.
    """

    def __init__(self, process: Process, process_id: int) -> None:
        self.process = process
        self.process_id = process_id
        self.events = process.scheduler.events
        self.alive = True
        self.killed = False
        self.ready = False
        self.ports: list[SimPort] = []
        self.nodes: list[EndingNode] = []
        self.hung_ns = 0
        self._computing = False
        self._busy_until_ns = 0
        self._hung_until_ns = 0
        self._hang_due_ns = 0
        self._wake_ns = NEVER
        self._outbox: list[tuple[Send, Any]] = []

    # --- time of a process -------------------------------------------------------------------------------------------

    @property
    def computing(self) -> bool:
        """A callback runs now."""
        return self._computing

    @property
    def free_ns(self) -> int:
        """The first time at which the loop can run; a past one if it can run now."""
        return max(self._busy_until_ns, self._hung_until_ns)

    @property
    def hung(self) -> bool:
        return self._hung_until_ns > self.events.now_ns

    def leaves_ns(self) -> int:
        """Time at which present outputs take effect outside: at the end of the wake-up, or at once beside the loop."""
        return self.free_ns if self._computing else max(self.events.now_ns, self._hung_until_ns)

    def appears_ns(self) -> int:
        """Time at which an endpoint created now is known to all others."""
        return self.leaves_ns() + self.process.appear.draw()

    def send(self, send: Send, item: Any) -> None:
        """Calls ``send(item)`` when it leaves the process."""
        if not self.alive:
            return
        if self._computing:
            self._outbox.append((send, item))
        elif self._hung_until_ns > self.events.now_ns:
            self._outbox.append((send, item))
            self.events.push(self._hung_until_ns, self.process.order, self._flush)
        else:
            send(item)

    def request_wake(self, at_ns: int) -> None:
        """Wakes the loop at that time, or as soon as it is free. There is one pending wake-up at most."""
        at_ns = max(at_ns, self._busy_until_ns, self._hung_until_ns)
        if at_ns < self._wake_ns and self.alive and not self._computing:
            self._wake_ns = at_ns
            # After arrivals at the same time, so that the wake-up processes them.
            self.events.push(at_ns, self.process.order + 1, self._wake, at_ns)

    def hang(self, duration_ns: int) -> None:
        now_ns = self.events.now_ns
        until_ns = max(now_ns, self._hung_until_ns) + duration_ns
        self.hung_ns += duration_ns
        self._hung_until_ns = until_ns
        due_ns = min(self._next_due_ns(), until_ns)
        if self._busy_until_ns > now_ns:
            self._busy_until_ns += duration_ns
            due_ns = until_ns  # the loop did not wait, and cannot detect the stall
        self._hang_due_ns = due_ns
        self.events.push(until_ns, self.process.order, self._resume, due_ns, until_ns)

    def resume(self) -> None:
        """Ends ``hang`` now."""
        now_ns = self.events.now_ns
        left_ns = self._hung_until_ns - now_ns
        if left_ns <= 0 or not self.alive:
            return
        self.hung_ns -= left_ns
        self._hung_until_ns = now_ns
        if self._busy_until_ns > now_ns:
            self._busy_until_ns = max(now_ns, self._busy_until_ns - left_ns)
        self.events.push(now_ns, self.process.order, self._resume, min(self._hang_due_ns, now_ns), now_ns)
        if self._outbox and not self._computing:
            self.events.push(self.free_ns, self.process.order, self._flush)

    def _resume(self, due_ns: int, until_ns: int) -> None:
        if until_ns != self._hung_until_ns:
            return  # the hang was extended or ended before
        """due_ns: when the loop would have woken for a timer."""
        if not self.alive or self.hung:
            return
        self.process.change(LifeChange.RESUMED)
        late_ns = self.events.now_ns - due_ns
        if late_ns > _PAUSE_NS:
            for port in self.ports:
                port.on_pause(late_ns)
        self.request_wake(self.events.now_ns)

    # --- the loop ----------------------------------------------------------------------------------------------------

    def begin(self, cost_ns: int) -> None:
        self._computing = True
        self._busy_until_ns = max(self.events.now_ns, self._hung_until_ns) + cost_ns

    def finish(self) -> None:
        self._computing = False
        if self._outbox:
            self.events.push(self._busy_until_ns, self.process.order, self._flush)
        if self.alive:
            self._plan()

    def _plan(self) -> None:
        """Plans the next wake-up: for arrivals meanwhile, or for the next timer."""
        if not self.ready:
            return
        for port in self.ports:
            if port.has_work():
                self.request_wake(self.events.now_ns)
                return
        due_ns = self._next_due_ns()
        if due_ns != NEVER:
            self.request_wake(max(due_ns, self.events.now_ns))

    def _next_due_ns(self) -> int:
        return min((port.next_due_ns() for port in self.ports), default=NEVER)

    def _wake(self, at_ns: int) -> None:
        if at_ns != self._wake_ns or not self.alive or not self.ready or self._computing:
            return  # an earlier wake-up took its place
        self._wake_ns = NEVER
        if self.free_ns > at_ns:  # it hangs since
            self.request_wake(at_ns)
            return
        if self._outbox:
            self._flush()
        cost_ns = sum(port.compute.draw() for port in self.ports if port.has_work())
        if cost_ns == 0:  # a timer that was cancelled
            self._plan()
            return
        self.begin(cost_ns)
        try:
            self._run_callbacks()
        except Exception:
            self._computing = False
            self.process.crash(traceback.format_exc())
            return
        self.finish()

    def _run_callbacks(self) -> None:
        """The order of ``LeanExecutor``: messages before timers, so that a tick uses the newest ones."""
        ports = self.ports
        for phase in (SimPort.take_ready, SimPort.take_waiting, SimPort.run_soon, SimPort.run_due):
            for port in ports:
                if port.open:
                    phase(port)

    def _flush(self) -> None:
        """Sends the outputs of a wake-up. A process that was killed before sends nothing."""
        if self.events.now_ns < self.free_ns:
            self.events.push(self.free_ns, self.process.order, self._flush)
            return
        outbox, self._outbox = self._outbox, []
        for send, item in outbox:
            send(item)

    def wait_until(self, condition: Callable[[], bool], timeout_ns: int, *, loop: bool) -> None:
        """Within a callback: lets the world continue. loop: the callbacks of this process run meanwhile, in wake-ups of
        their own; otherwise arrivals wait.
        """
        computing, end_ns = self._computing, self.events.now_ns + timeout_ns
        if computing:
            self.finish()
        self._computing = computing and not loop
        self.events.run(end_ns, lambda: condition() or not self.alive)
        if computing:
            self.begin(sum(port.compute.draw() for port in self.ports))

    # --- start and end -----------------------------------------------------------------------------------------------

    def construct(self, factories: Sequence[NodeFactory]) -> None:
        """Constructs the nodes. Raises their exceptions."""
        self.begin(self.process.construction_ns())
        try:
            with ports_from(self._open_port):
                for factory in factories:
                    self.nodes.append(factory())
        except BaseException:
            self._computing = False
            raise
        self.ready = True
        self.finish()

    def _open_port(self, name: str) -> SimPort:
        self.process.scheduler.hold_name(name, self)
        port = SimPort(self, name)
        self.ports.append(port)
        self.process.scheduler.show_node(port, self.appears_ns())
        return port

    def leave_safe(self) -> list[str]:
        """The orderly end: safe outputs, then the ends of the nodes. Returns the tracebacks of failures."""
        failures = []
        self.begin(sum(port.compute.draw() for port in self.ports))
        for end in (_safe_output, _destroy):
            for node in self.nodes:
                try:
                    end(node)
                except Exception:
                    failures.append(traceback.format_exc())
        for port in self.ports:  # of a node that was not constructed to its end
            self.on_port_closed(port)
        self.alive = False
        self.finish()
        return failures

    def on_port_closed(self, port: SimPort) -> None:
        if port.open:
            port.end()
            scheduler = self.process.scheduler
            gone_ns = self.leaves_ns() + self.process.leave.draw()
            scheduler.network.leave(port, gone_ns)
            scheduler.calls.leave(port, gone_ns)
            scheduler.release_name(port.name, self, gone_ns)

    def kill(self) -> None:
        """Ends at once. Messages already sent still arrive."""
        self.alive, self.killed = False, True
        self._outbox.clear()
        scheduler = self.process.scheduler
        for port in self.ports:
            if port.open:
                port.end()
                gone_ns = self.events.now_ns + scheduler.lease_ns
                scheduler.network.leave(port, gone_ns)
                scheduler.calls.leave(port, gone_ns)
                scheduler.release_name(port.name, self, gone_ns)


class Process:
    """A process of the run, over all its lives.

    order: among events of one time. parameters: overrides by node name. exit_code: of the last life that ended, as the
    operating system gives it; None before.
    """

    def __init__(
        self,
        scheduler: Scheduler,
        name: str,
        order: int,
        factories: Sequence[NodeFactory],
        parameters: Mapping[str, Mapping[str, Any]],
        computer: Computer,
    ) -> None:
        self.scheduler, self.name, self.order, self.computer = scheduler, name, order, computer
        self.factories = tuple(factories)
        self.parameters = dict(parameters)
        self.life: Life | None = None
        self.lives = 0
        self.exit_code: int | None = None
        params, streams = scheduler.params, scheduler.streams
        self.appear = streams.delays(f"appear/{name}", params.discovery.appear)
        self.leave = streams.delays(f"leave/{name}", params.discovery.leave)
        self._start = streams.delays(f"start/{name}", params.start.of(name))
        self._construction = streams.delays(f"construction/{name}", params.construction.of(name))
        self._start_pending = False
        self._stopping = False

    @property
    def alive(self) -> bool:
        return self.life is not None and self.life.alive

    @property
    def running(self) -> bool:
        """Alive, constructed, and not hung."""
        life = self.life
        return life is not None and life.alive and life.ready and not life.hung

    @property
    def nodes(self) -> list[EndingNode]:
        """The nodes of the present life; empty without one."""
        return self.life.nodes if self.life is not None and self.life.alive else []

    def construction_ns(self) -> int:
        return sum(self._construction.draw() for _ in self.factories)

    def start(self, at_ns: int | None = None) -> None:
        """Orders a new life at ``at_ns``, None: now. Raises RuntimeError while there is one."""
        if self.alive or self._start_pending:
            raise RuntimeError(f"{self.name} runs already")
        self._start_pending = True
        events = self.scheduler.events
        order_ns = events.now_ns if at_ns is None else at_ns
        events.push(order_ns + self._start.draw(), self.order, self._construct)

    def kill(self) -> None:
        """As SIGKILL: no safe output. A pending start is dropped."""
        self._start_pending = False
        if self.life is not None and self.life.alive:
            self.life.kill()
            self._end(EXIT_KILLED, LifeChange.KILLED)

    def stop(self) -> None:
        """As SIGTERM: an orderly end as soon as the loop is free; it ends later."""
        self._start_pending = False
        if self.life is not None and self.life.alive and not self._stopping:
            self._stopping = True
            self._push_stop(self.life)

    def hang(self, duration_s: float) -> None:
        """As SIGSTOP, and SIGCONT after the duration. Raises ValueError for a duration that is not positive."""
        if not duration_s > 0.0:
            raise ValueError(f"{self.name} cannot hang for {duration_s} s")
        if self.life is not None and self.life.alive:
            self.life.hang(round(duration_s * 1e9))
            self.change(LifeChange.HUNG)

    def resume(self) -> None:
        """As SIGCONT before the duration of ``hang`` is over."""
        if self.life is not None and self.life.alive and self.life.hung:
            self.life.resume()

    def restart(self) -> None:
        """Kills the present life and starts a new one."""
        self.kill()
        self.start()

    def crash(self, text: str) -> None:
        """An exception ended the loop: as on ROS the outputs are left safe on the way out. text: its traceback."""
        self.scheduler.on_failure(self.name, text)
        if self.alive:  # else it was killed in the same callback
            self._leave_safe(EXIT_CRASHED, LifeChange.CRASHED)

    def change(self, change: LifeChange) -> None:
        self.scheduler.on_life_change(self.name, change)

    def _construct(self) -> None:
        if not self._start_pending:
            return
        self._start_pending = self._stopping = False
        self.lives += 1
        life = self.life = Life(self, self.scheduler.next_process_id())
        self.change(LifeChange.STARTED)
        try:
            life.construct(self.factories)
        except (ConfigError, AlreadyRunning, ContractViolation) as error:
            self.scheduler.on_failure(self.name, f"{type(error).__name__}: {error}")
            self._leave_safe(EXIT_REFUSED, LifeChange.REFUSED)
        except Exception:
            self.crash(traceback.format_exc())
        else:
            self.scheduler.events.push(life.free_ns, self.order, self._report_ready, life)

    def _report_ready(self, life: Life) -> None:
        if life.alive:
            self.change(LifeChange.READY)

    def _push_stop(self, life: Life) -> None:
        at_ns = max(life.free_ns, self.scheduler.events.now_ns)
        self.scheduler.events.push(at_ns, self.order, self._stop, life)

    def _stop(self, life: Life) -> None:
        if not life.alive:
            return
        if life.computing or life.free_ns > self.scheduler.events.now_ns:
            self._push_stop(life)
            return
        self._leave_safe(EXIT_STOPPED, LifeChange.STOPPED)

    def _leave_safe(self, exit_code: int, change: LifeChange) -> None:
        if self.life is not None and self.life.alive:
            for text in self.life.leave_safe():
                self.scheduler.on_failure(self.name, text)
            if self.life.killed:  # while its safe output waited for something
                return
        self._end(exit_code, change)

    def _end(self, exit_code: int, change: LifeChange) -> None:
        self.exit_code = exit_code
        self._stopping = False
        self.change(change)


def _safe_output(node: EndingNode) -> None:
    node.safe_output()


def _destroy(node: EndingNode) -> None:
    node.destroy_node()
