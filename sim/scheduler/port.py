"""The middleware port on the scheduler. See ``robot_stack.middleware.port.Port``."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

from robot_stack.contract.model import Action, Topic
from robot_stack.core.node_record import NodeRecord
from robot_stack.core.pauses import PauseBudget
from robot_stack.middleware.port import ActionClient, ActionGoal, ServiceClient
from robot_stack.middleware.timers import NodeTimer, Schedule
from sim.scheduler import calls
from sim.scheduler.actions import SimActionClient, SimActionServer
from sim.scheduler.events import NANOSECONDS, NEVER
from sim.scheduler.logs import SimLogger
from sim.scheduler.network import Packet, SimPublisher, SimSubscription
from sim.scheduler.parts import Life
from sim.scheduler.worker import SimWorker

P = ParamSpec("P")
T = TypeVar("T")

# As robot_stack.ros.interfaces.listener_profile.
_LISTENER_DEPTH_S = 1.0
_LEAST_LISTENER_DEPTH = 10


class MissingDevice(LookupError):
    """A node asked for a device for which the scheduler has no replacement."""


class VirtualClock:
    """See ``robot_stack.middleware.clocks.NodeClock``: the clocks of a robot, driven by virtual time."""

    simulated = False

    def __init__(self, life: Life) -> None:
        self._events, self._computer = life.events, life.process.computer

    def ros_s(self) -> float:
        return self.ros_ns() / NANOSECONDS

    def ros_ns(self) -> int:
        return self.ros_at_ns(self._events.now_ns)

    def ros_at_ns(self, virtual_ns: int) -> int:
        return self._computer.system_start_ns + virtual_ns

    def timer_s(self) -> float:
        return (self._events.now_ns + self._computer.monotonic_start_ns) / NANOSECONDS

    def timer_ns(self) -> int:
        return self._events.now_ns + self._computer.monotonic_start_ns

    def age_s(self, real_s: float) -> float:
        return real_s

    def real_wait_s(self, due_s: float) -> float:
        return due_s - self.timer_s()

    def virtual_ns(self, due_s: float) -> int:
        """The first virtual time at which ``timer_s`` is not less than ``due_s``."""
        if due_s == math.inf:
            return NEVER
        start_ns = self._computer.monotonic_start_ns
        at_ns = math.ceil(due_s * NANOSECONDS) - 1
        while at_ns / NANOSECONDS < due_s:
            at_ns += 1
        return at_ns - start_ns


class SimPort:
    """One node on the scheduler.

    ready: arrived items that wake the node, in order of arrival. waiting: subscriptions with messages that do not.
    open: the node exists and its port is not closed.
    """

    def __init__(self, life: Life, name: str) -> None:
        self.life = life
        self.order = life.process.order
        self._name = name
        self._scheduler = life.process.scheduler
        self.open = True
        self.ready: list[SimSubscription | _Call] = []
        self.waiting: list[SimSubscription] = []
        self._soon: deque[Callable[[], None]] = deque()
        self._woken = False
        self._subscriptions = 0
        self._clock = VirtualClock(life)
        self.schedule = Schedule(self._clock)
        self.compute = self._scheduler.streams.delays(f"compute/{name}", self._scheduler.params.compute.of(name))
        self._logger = SimLogger(name, lambda: life.events.now_ns, self._scheduler.on_log)
        self.node_record = NodeRecord(name, life.process_id, self._clock.timer_ns)
        self.node_record.constructing("construction")
        self.shown_parameters: dict[str, Any] = {}
        self.workers: list[SimWorker] = []
        self._paused_s = 0.0
        self._pauses = 0
        self._pause_budget = PauseBudget(self._clock.timer_s())
        self._pause_text: dict[str, str] = {}

    @property
    def name(self) -> str:
        return self._name

    @property
    def logger(self) -> SimLogger:
        return self._logger

    @property
    def process_id(self) -> int:
        return self.life.process_id

    # --- time --------------------------------------------------------------------------------------------------------

    @property
    def simulated_time(self) -> bool:
        return False

    def now_ns(self) -> int:
        return self._clock.ros_ns()

    def steady_s(self) -> float:
        return self._clock.timer_s() - self._paused_s

    def monotonic_s(self) -> float:
        return self._clock.timer_s()

    def device_s(self) -> float:
        return self._clock.timer_s()

    def system_s(self) -> float:
        return self._clock.ros_s()

    def age_s(self, real_s: float) -> float:
        return real_s

    def add_timer(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        timer = self.schedule.add(period_s, callback)
        self.life.request_wake(self._clock.virtual_ns(timer.due_s))
        return timer

    def add_real_timer(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        return self.add_timer(period_s, callback)

    def call_soon(self, callback: Callable[[], None], *, wakes: bool = True) -> None:
        if not self.open:
            return
        self._soon.append(callback)
        if wakes:
            self._woken = True
            self.life.request_wake(self.life.events.now_ns)

    def follow_clock(self) -> None:
        pass

    # --- asked by the process ----------------------------------------------------------------------------------------

    def next_index(self) -> int:
        self._subscriptions += 1
        return self._subscriptions

    def wake_for(self, function: Callable[[], None]) -> None:
        """Wakes the node for a call that has arrived."""
        if self.open:
            self.ready.append(_Call(function))
            self.life.request_wake(self.life.events.now_ns)

    def has_work(self) -> bool:
        """True if an item that wakes the node has arrived or is due."""
        if not self.open:
            return False
        return bool(self.ready) or self._woken or self.schedule.next_due_s() <= self._clock.timer_s()

    def take_ready(self) -> None:
        while self.ready:
            ready, self.ready = self.ready, []
            for item in ready:
                item.take()

    def take_waiting(self) -> None:
        if self.waiting:
            waiting, self.waiting = self.waiting, []
            waiting.sort(key=_index)
            for item in waiting:
                item.take()

    def run_soon(self) -> None:
        self._woken = False
        soon = self._soon
        while soon:
            soon.popleft()()

    def run_due(self) -> None:
        for callback in self.schedule.due():
            if self.open:
                callback()

    def next_due_ns(self) -> int:
        """Virtual time at which the next timer is due."""
        return self._clock.virtual_ns(self.schedule.next_due_s()) if self.open else NEVER

    def on_pause(self, late_ns: int) -> None:
        """Handles a stall: the time for which the process did not run beyond its own sleep."""
        late_s = late_ns / NANOSECONDS
        self._pauses += 1
        self._paused_s += self._pause_budget.excuse(late_s, self.monotonic_s())
        self._pause_text = {"held up": f"{self._pauses} times, last {late_s:.2f} s"}

    def end(self) -> None:
        """No callback is called any more."""
        self.open = False
        self.ready.clear()
        self.waiting.clear()
        self._soon.clear()
        for worker in self.workers:
            worker.join()

    # --- endpoints ---------------------------------------------------------------------------------------------------

    def advertise(self, row: Topic, name: str) -> SimPublisher:
        return self._scheduler.network.advertise(self, row, name)

    def subscribe(
        self, row: Topic, name: str, callback: Callable[[Any, float], None], depth: int, *, wakes: bool, raw: bool
    ) -> SimSubscription:
        events = self.life.events

        def on_message(message: Any, _: Packet, arrived_ns: int) -> None:
            callback(message, self.steady_s() - (events.now_ns - arrived_ns) / NANOSECONDS)

        return self._scheduler.network.subscribe(self, row, name, on_message, depth, wakes=wakes, raw=raw)

    def listen(
        self, row: Topic, callback: Callable[[Any, int, int], None], *, raw: bool, wakes: bool
    ) -> SimSubscription:
        ros_at_ns = self._clock.ros_at_ns

        def on_message(message: Any, packet: Packet, arrived_ns: int) -> None:
            callback(message, ros_at_ns(arrived_ns), ros_at_ns(packet.sent_ns))

        depth = max(row.qos.depth, _LEAST_LISTENER_DEPTH, math.ceil((row.rate_hz or 0.0) * _LISTENER_DEPTH_S))
        return self._scheduler.network.subscribe(self, row, row.name, on_message, depth, wakes=wakes, raw=raw)

    def prepare_bulk(self) -> None:
        pass

    def serve(self, type_name: str, name: str, callback: Callable[[Any, Any, Callable[[Any], None]], None]) -> None:
        calls.serve(self._scheduler.calls, self, type_name, name, callback)

    def client(self, type_name: str, name: str) -> ServiceClient:
        return calls.SimClient(self._scheduler.calls, self, type_name, name)

    def serve_action(self, row: Action, name: str, on_goal: Callable[[ActionGoal], None]) -> None:
        SimActionServer(self._scheduler.calls, self, row.type, name, on_goal)

    def action_client(self, row: Action) -> ActionClient:
        return SimActionClient(self._scheduler.calls, self, row)

    # --- graph: a node sees its own endpoints at once, others when they are discovered -------------------------------

    def count_publishers(self, name: str) -> int:
        return len(self.publisher_nodes(name))

    def count_subscribers(self, name: str) -> int:
        return len(self.subscriber_nodes(name))

    def publisher_nodes(self, name: str) -> list[str]:
        return [item.port.name for item in self._scheduler.network.publishers(name) if self._sees(item)]

    def subscriber_nodes(self, name: str) -> list[str]:
        return [item.port.name for item in self._scheduler.network.subscriptions(name) if self._sees(item)]

    def node_names(self) -> list[str]:
        return self._scheduler.visible_nodes(self)

    def _sees(self, endpoint: SimPublisher | SimSubscription) -> bool:
        if endpoint.port is self:
            return not (isinstance(endpoint, SimSubscription) and endpoint.ended)
        return endpoint.visible_ns <= self.life.events.now_ns < endpoint.gone_ns

    # --- beside the loop ---------------------------------------------------------------------------------------------

    def worker(self, name: str, *, world_waits: bool = False) -> SimWorker:
        spread = self._scheduler.params.workers.of(name)
        delays = self._scheduler.streams.delays(f"worker/{self._name}/{name}", spread)
        parallel = world_waits if spread.parallel is None else spread.parallel
        worker = SimWorker(self, delays, self._scheduler.pool if parallel else None)
        self.workers.append(worker)
        return worker

    def device(self, make: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Raises MissingDevice."""
        replacement = self._scheduler.devices.get(make)
        if replacement is None:
            name = f"{getattr(make, '__module__', '')}.{getattr(make, '__qualname__', repr(make))}"
            raise MissingDevice(
                f"{self._name} asks for the device {name}: the scheduler has no replacement; "
                "register one in Scheduler.devices under this callable"
            )
        device: T = replacement(self, *arguments, **options)
        return device

    # --- start and end -----------------------------------------------------------------------------------------------

    def parameter_overrides(self) -> Mapping[str, Any]:
        return self.life.process.parameters.get(self._name, {})

    def show_parameters(self, values: Mapping[str, Any]) -> None:
        self.shown_parameters.update(values)

    def report_values(self) -> Mapping[str, str]:
        return self._pause_text

    def wait_until(self, condition: Callable[[], bool], timeout_s: float, *, loop: bool = False) -> None:
        self.life.wait_until(condition, round(timeout_s * NANOSECONDS), loop=loop)

    def wait_delivered(self, timeout_s: float) -> None:
        """Returns at once: sent messages arrive even after the end of the process."""

    def close(self) -> None:
        self.life.on_port_closed(self)


class _Call:
    """A request, a response, feedback."""

    __slots__ = ("take",)

    def __init__(self, take: Callable[[], None]) -> None:
        self.take = take


def _index(subscription: SimSubscription) -> int:
    return subscription.index
