"""The middleware port on ROS: an rclpy node, driven by the lean executor, one process per node."""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import IO, Any, ParamSpec, TypeVar

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.task import Future
from rclpy.time_source import CLOCK_TOPIC, USE_SIM_TIME_NAME
from rosgraph_msgs.msg import Clock

from robot_stack.contract.model import Action, ContractViolation, Topic
from robot_stack.core.config import ConfigError
from robot_stack.core.node_record import NodeRecord
from robot_stack.core.pauses import PauseBudget
from robot_stack.core.runtime import hold_lock
from robot_stack.core.world_clock import WorldClock
from robot_stack.middleware.clocks import NodeClock, SharedWorldClock, SystemClock, TopicClock
from robot_stack.middleware.conversions import NANOSECONDS, time_from_s
from robot_stack.middleware.port import ActionClient, ActionGoal, ServiceClient
from robot_stack.middleware.timers import NodeTimer, Schedule
from robot_stack.middleware.wire import READERS, UnknownEncoding
from robot_stack.middleware.world_times import WorldTimes
from robot_stack.ros import transport
from robot_stack.ros.actions import RosActionClient, RosActionServer
from robot_stack.ros.bulk import BulkInputs, owner_of
from robot_stack.ros.deliveries import NodeDeliveries
from robot_stack.ros.interfaces import interface_class, listener_profile, qos_profile
from robot_stack.ros.serialization import deserialize_message
from robot_stack.ros.workers import ThreadWorker

P = ParamSpec("P")
T = TypeVar("T")
# Parameters that rclpy itself declares.
_RCLPY_OWN = ("use_sim_time", "start_type_description_service")
_WAIT_POLL_S = 0.01


class RosPort(Node):
    """See ``robot_stack.middleware.port.Port``. The executor calls it when it has work (``before_wait`` and so on).

    Raises AlreadyRunning if this domain has a node of this name.
    """

    def __init__(self, name: str) -> None:
        # Locked before the node exists: two nodes of one name in the graph would answer for each other.
        self._lock: IO[str] = hold_lock(name)
        self.node_record = NodeRecord(name)
        self.node_record.constructing("construction")
        self.taken_at_tick: list[Any] = []
        self._soon: deque[Callable[[], None]] = deque()
        self._world_clock = WorldClock.find()
        super().__init__(name)
        self._time: NodeClock = self._choose_clock()
        self._world_times = WorldTimes(time.time_ns, self.now_ns)
        self._bulk: BulkInputs | None = None
        self._deliveries = NodeDeliveries(name, isinstance(self._time, SharedWorldClock), self._bulk_idle)
        self._schedule = Schedule(self._time, self._deliveries.owed if self._deliveries.counting else None)
        # Heartbeats continue while simulated time stands still.
        self._own_schedule = Schedule(SystemClock()) if self._time.simulated else self._schedule
        self.schedules: list[Any] = [self._schedule, *([self._own_schedule] if self._time.simulated else [])]
        if self._deliveries.counting:
            self.schedules.append(self._deliveries)
        self._taken_s = time.monotonic()
        self._paused_s = 0.0
        self._pauses = 0
        self._pause_budget = PauseBudget(time.monotonic())
        self._pause_text: dict[str, str] = {}
        self._awaited: list[ThreadWorker] = []
        self._awaited_since_s = math.inf

    @property
    def name(self) -> str:
        return str(self.get_name())

    @property
    def logger(self) -> Any:
        return self.get_logger()

    @property
    def process_id(self) -> int:
        return os.getpid()

    # --- time --------------------------------------------------------------------------------------------------------

    @property
    def simulated_time(self) -> bool:
        return self._time.simulated

    def now_ns(self) -> int:
        return self._time.ros_ns()

    def steady_s(self) -> float:
        return self._time.timer_s() if self._time.simulated else time.monotonic() - self._paused_s

    def monotonic_s(self) -> float:
        return time.monotonic()

    def device_s(self) -> float:
        return self._time.timer_s()

    def system_s(self) -> float:
        return time.time()

    def age_s(self, real_s: float) -> float:
        return self._time.age_s(real_s)

    def add_timer(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        timer = self._schedule.add(period_s, callback)
        self._wake_executor()
        return timer

    def add_real_timer(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        return self._own_schedule.add(period_s, callback)

    def call_soon(self, callback: Callable[[], None], *, wakes: bool = True) -> None:
        self._soon.append(callback)
        if wakes:
            self._wake_executor()

    def follow_clock(self) -> None:
        """Sets rclpy's own clock, which stamps logs and goals, to the world's time in shared memory."""
        if self._time.simulated and self._world_clock is not None:
            stamp = time_from_s(self.now_ns() / NANOSECONDS)
            self._time_source.clock_callback(Clock(clock=stamp))

    def _choose_clock(self) -> NodeClock:
        simulated = bool(self.get_parameter(USE_SIM_TIME_NAME).value)
        self.add_on_set_parameters_callback(_keep_clock)
        if not simulated:
            return SystemClock()
        if self._world_clock is not None:
            return SharedWorldClock(self._world_clock)
        return TopicClock(lambda: float(self.get_clock().now().nanoseconds) / NANOSECONDS)

    def _received_s(self, info: Mapping[str, int], before_s: float) -> float:
        """The time of a reception, which the middleware gives in system time, on the steady clock.

        before_s: of the subscription's previous message; the times of one subscription never fall.

        A message that does not wake the node waits before it is read, but arrived after the previous read: so a step
        of the system clock shifts nothing by more than that.
        """
        now_s = self.steady_s()
        if self._time.simulated:
            return now_s
        waited_s = (time.time_ns() - info["received_timestamp"]) / NANOSECONDS
        return max(now_s - min(max(waited_s, 0.0), time.monotonic() - self._taken_s), before_s)

    # --- called by the executor --------------------------------------------------------------------------------------

    def before_wait(self) -> None:
        """The executor is about to sleep: publishes when the node has work next, for the simulated world to wait."""
        if self._time.simulated:
            self.node_record.due(min(self._schedule.next_due_s(), self._work_since_s()))

    def after_wait(self) -> None:
        """The executor is awake: the node has work until it sleeps again."""
        if self._time.simulated:
            self.node_record.due(self._time.timer_s())

    def on_taken(self) -> None:
        """The executor has read all arrived messages."""
        self._taken_s = time.monotonic()
        for _ in range(len(self._soon)):  # those that are added meanwhile follow at the next wake-up
            self._soon.popleft()()

    def on_pause(self, late_s: float) -> None:
        """The executor detected that this process did not run for ``late_s``."""
        self._pauses += 1
        self._paused_s += self._pause_budget.excuse(late_s, time.monotonic())
        self._pause_text = {"held up": f"{self._pauses} times, last {late_s:.2f} s"}

    def report_values(self) -> Mapping[str, str]:
        return self._pause_text

    def _work_since_s(self) -> float:
        """Time since which the loop waits for a worker's result; infinite if it waits for none."""
        busy = any(worker.busy for worker in self._awaited)
        self._awaited_since_s = min(self._awaited_since_s, self._time.timer_s()) if busy else math.inf
        return self._awaited_since_s

    # --- topics ------------------------------------------------------------------------------------------------------

    def advertise(self, row: Topic, name: str) -> Publisher:
        if row.bulk and not transport.carries_bulk():
            raise ContractViolation(f"{self.name} may not publish {row.name}: its process runs without bulk=True")
        try:
            publisher = self.create_publisher(
                interface_class(row.type),
                name,
                qos_profile(row.qos),
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            )
        except InvalidTopicNameException as error:
            raise ConfigError(f"{self.name}: {' '.join(str(error).split())}") from error
        return self._deliveries.counted(row, publisher)

    def subscribe(
        self, row: Topic, name: str, callback: Callable[[Any, float], None], depth: int, *, wakes: bool, raw: bool
    ) -> _Subscription:
        message_class, profile = interface_class(row.type), qos_profile(row.qos)
        profile.depth = depth
        read = None if raw else READERS.get(row.type)
        received_s = -math.inf

        def take(message: Any, info: Mapping[str, int]) -> None:
            nonlocal received_s
            if read is not None:
                try:
                    message = read(message)
                except UnknownEncoding:  # left to the middleware, which reports the error
                    message = deserialize_message(message, message_class)
            received_s = self._received_s(info, received_s)
            callback(message, received_s)

        on_message, as_bytes = self._deliveries.noted(row, take, wakes), raw or read is not None
        if row.bulk and not transport.carries_bulk():
            subscription = self._bulk_inputs.subscribe(message_class, name, on_message, profile, as_bytes, wakes=wakes)
            end: Callable[[], Any] = partial(self._bulk_inputs.unsubscribe, subscription)
        else:
            end = self._subscribe(message_class, name, on_message, profile, raw=as_bytes, wakes=wakes).end

        def end_and_forget() -> None:
            end()
            self._deliveries.forget(row)

        return _Subscription(end_and_forget)

    def listen(self, row: Topic, callback: Callable[[Any, int, int], None], *, raw: bool, wakes: bool) -> _Subscription:
        def on_message(message: Any, info: Mapping[str, int]) -> None:
            received_ns, sent_ns = info["received_timestamp"], info["source_timestamp"]
            if self._time.simulated:  # the middleware's times are system times
                received_ns, sent_ns = self._world_times.at(received_ns), sent_ns and self._world_times.at(sent_ns)
            callback(message, received_ns, sent_ns or received_ns)

        return self._subscribe(
            interface_class(row.type), row.name, on_message, listener_profile(row), raw=raw, wakes=wakes
        )

    def prepare_bulk(self) -> None:
        if not transport.carries_bulk():
            _ = self._bulk_inputs

    def create_subscription(self, msg_type: Any, topic: str, *args: Any, **kwargs: Any) -> Any:
        """Like rclpy's; every message wakes the node. Skips /clock if the world's time is in shared memory."""
        if topic == CLOCK_TOPIC and self._world_clock is not None:
            return None
        return super().create_subscription(msg_type, topic, *args, **kwargs)

    def destroy_subscription(self, subscription: Any) -> bool:
        self.taken_at_tick = [item for item in self.taken_at_tick if item is not subscription]
        return bool(super().destroy_subscription(subscription))

    def _subscribe(
        self, message_class: Any, name: str, on_message: Any, profile: Any, *, raw: bool, wakes: bool
    ) -> _Subscription:
        subscription = self.create_subscription(message_class, name, on_message, profile, raw=raw)
        if not wakes:
            self.taken_at_tick.append(subscription)
            self._wake_executor()
        return _Subscription(partial(self.destroy_subscription, subscription))

    def _bulk_idle(self) -> bool:
        return self._bulk is None or self._bulk.idle()

    @property
    def _bulk_inputs(self) -> BulkInputs:
        if self._bulk is None:
            self._bulk = BulkInputs(self)
        return self._bulk

    # --- services and actions ----------------------------------------------------------------------------------------

    def serve(self, type_name: str, name: str, callback: Callable[[Any, Any, Callable[[Any], None]], None]) -> None:
        async def on_request(request: Any, response: Any) -> Any:
            answer = Future()
            callback(request, response, answer.set_result)
            return await answer

        self.create_service(interface_class(type_name), name, on_request)

    def client(self, type_name: str, name: str) -> ServiceClient:
        return _Client(self.create_client(interface_class(type_name), name))

    def serve_action(self, row: Action, name: str, on_goal: Callable[[ActionGoal], None]) -> None:
        RosActionServer(self, interface_class(row.type), name, on_goal)

    def action_client(self, row: Action) -> ActionClient:
        return RosActionClient(self, interface_class(row.type), row.name)

    # --- graph -------------------------------------------------------------------------------------------------------

    def publisher_nodes(self, name: str) -> list[str]:
        return [owner_of(info.node_name) for info in self.get_publishers_info_by_topic(name)]

    def subscriber_nodes(self, name: str) -> list[str]:
        return [owner_of(info.node_name) for info in self.get_subscriptions_info_by_topic(name)]

    def node_names(self) -> list[str]:
        return [str(name) for name in self.get_node_names()]

    # --- beside the loop ---------------------------------------------------------------------------------------------

    def worker(self, name: str, *, world_waits: bool = False) -> ThreadWorker:
        worker = ThreadWorker(name, self.call_soon)
        if world_waits:
            self._awaited.append(worker)
        return worker

    def device(self, make: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        return make(*arguments, **options)

    # --- start and end -----------------------------------------------------------------------------------------------

    def parameter_overrides(self) -> Mapping[str, Any]:
        return {name: item.value for name, item in self._parameter_overrides.items() if not _is_rclpy_own(name)}

    def show_parameters(self, values: Mapping[str, Any]) -> None:
        descriptor = ParameterDescriptor(read_only=True, dynamic_typing=True)
        for name, value in values.items():
            self.declare_parameter(name, value, descriptor, ignore_override=True)

    def wait_until(self, condition: Callable[[], bool], timeout_s: float, *, loop: bool = False) -> None:
        end_s = time.monotonic() + timeout_s
        while not condition() and time.monotonic() < end_s:
            if loop:
                self.executor.spin_once(_WAIT_POLL_S)
            else:
                time.sleep(_WAIT_POLL_S)

    def wait_delivered(self, timeout_s: float) -> None:
        end_s = time.monotonic() + timeout_s
        for publisher in self.publishers:
            remaining_s = end_s - time.monotonic()
            if remaining_s <= 0.0:
                return
            publisher.wait_for_all_acked(_duration(remaining_s))

    def close(self) -> None:
        if self._bulk is not None:
            self._bulk.close()
        self._deliveries.close()
        self.destroy_node()
        self._lock.close()


class _Subscription:
    def __init__(self, end: Callable[[], Any]) -> None:
        self._end = end

    def end(self) -> None:
        self._end()


class _Client:
    def __init__(self, client: Any) -> None:
        self._client = client

    def service_is_ready(self) -> bool:
        return bool(self._client.service_is_ready())

    def call(self, request: Any, done: Callable[[Any], None]) -> None:
        def on_done(future: Any) -> None:
            if (response := future.result()) is not None:
                done(response)

        self._client.call_async(request).add_done_callback(on_done)


def _duration(seconds: float) -> Any:
    from rclpy.duration import Duration

    return Duration(seconds=seconds)


def _is_rclpy_own(name: str) -> bool:
    return name in _RCLPY_OWN or name.startswith("qos_overrides.")


def _keep_clock(parameters: list[Any]) -> SetParametersResult:
    """Rejects a change of the node's clock while it runs: every age and timer would jump."""
    changed = any(item.name == USE_SIM_TIME_NAME for item in parameters)
    reason = f"{USE_SIM_TIME_NAME} is chosen at the start of a node" if changed else ""
    return SetParametersResult(successful=not changed, reason=reason)
