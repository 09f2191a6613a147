"""The base of every node: endpoints by contract row, validated parameters, input health, heartbeat, a safe way out."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from functools import cached_property, partial
from typing import IO, Any

from builtin_interfaces.msg import Time
from pydantic import BaseModel
from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.time_source import CLOCK_TOPIC, USE_SIM_TIME_NAME
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import topics
from robot_stack.contract.graph import RECORDER
from robot_stack.contract.model import EVERY_NODE, Action, ContractViolation, SafetyState, Service, System, Topic
from robot_stack.contract.processes import BY_NAME
from robot_stack.core.health import InputHealth, InputState
from robot_stack.core.node_record import NodeRecord
from robot_stack.core.pauses import PauseBudget
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.runtime import hold_lock
from robot_stack.core.stop_latch import StopLatch
from robot_stack.core.world_clock import WorldClock
from robot_stack.ros import transport
from robot_stack.ros.bulk import BulkInputs
from robot_stack.ros.clocks import NodeClock, SharedWorldClock, SystemClock, TopicClock
from robot_stack.ros.conversions import NANOSECONDS
from robot_stack.ros.deliveries import NodeDeliveries
from robot_stack.ros.emergency_stop import StopSource
from robot_stack.ros.inputs import Input
from robot_stack.ros.interfaces import interface_class, listener_profile, qos_profile
from robot_stack.ros.parameters import load_parameters, refuse_overrides
from robot_stack.ros.report import Loop, Report
from robot_stack.ros.timers import NodeTimer, Schedule

_LOG_PERIOD_S = 1.0


class StackNode(Node):
    """A node of the stack.

    name: a node name of the contract.
    parameters: the model of ``config/<name>.yaml``; None for a node without parameters.

    Raises AlreadyRunning if this domain has a node of this name, ConfigError if the parameters are wrong,
    ContractViolation if an endpoint is asked for that the contract does not give this node.
    """

    def __init__(self, name: str, parameters: type[BaseModel] | None = None) -> None:
        # Taken before the node exists: two nodes of one name in the graph would answer for each other.
        self._lock: IO[str] = hold_lock(name)
        self.node_record = NodeRecord(name)
        self.node_record.constructing("construction")
        self.taken_at_tick: list[Any] = []
        self._soon: deque[Callable[[], None]] = deque()
        self._world_clock = WorldClock.find()
        super().__init__(name)
        self._time: NodeClock = self._choose_clock()
        self._bulk: BulkInputs | None = None
        self._deliveries = NodeDeliveries(name, isinstance(self._time, SharedWorldClock), self._bulk_idle)
        self._schedule = Schedule(self._time, self._deliveries.owed if self._deliveries.counting else None)
        # What tells that a node lives goes on where simulated time stands still.
        self._own_schedule = Schedule(SystemClock()) if self._time.simulated else self._schedule
        self.schedules: list[Any] = [self._schedule, *([self._own_schedule] if self._time.simulated else [])]
        if self._deliveries.counting:
            self.schedules.append(self._deliveries)
        self._taken_s = time.monotonic()
        if parameters is None:
            refuse_overrides(self)
        self.params: Any = load_parameters(self, parameters) if parameters else None
        self._health = InputHealth()
        self._paused_s = 0.0
        self._pauses = 0
        self._pause_budget = PauseBudget(time.monotonic())
        # The machines of the motion-engine layer have no safety monitor of their own.
        self._stop_latch = StopLatch(monitored=name not in BY_NAME or BY_NAME[name].system is not System.WMX)
        self._stop_source: StopSource | None = None
        self.report = Report(self)
        self._subscribe_safety()

    # --- endpoints ---------------------------------------------------------------------------------------------------

    def advertise(self, row: Topic, name: str = "") -> Publisher:
        """The publisher of a contract row, under ``name`` where the contract calls the name configurable.

        Raises ContractViolation if the row does not name this node, or is bulk and the process was not started for it.
        """
        self._check(row.name, "publish", row.publishers)
        if row.bulk and not transport.carries_bulk():
            raise ContractViolation(f"{self.get_name()} may not publish {row.name}: its process runs without bulk=True")
        publisher = self.create_publisher(
            interface_class(row.type),
            name or row.name,
            qos_profile(row.qos),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        return self._deliveries.counted(row, publisher)

    def subscribe(self, row: Topic, callback: Callable[[Any], None] | None = None, name: str = "") -> Input:
        """Subscribes to a contract row, under ``name`` where the contract calls the name configurable.

        Clouds and images come as views on the received bytes, with the message's fields (``robot_stack.ros.wire``).
        Raises ContractViolation if the row does not name this node.
        """
        self._check(row.name, "subscribe to", row.subscribers)
        wakes = row.wakes_node(self.get_name())
        entry = Input(row, callback, self._health, self._received_s, self.steady_s)
        on_message = self._deliveries.noted(row, entry.on_message, wakes)
        profile = qos_profile(row.qos)
        if callback is not None:  # without one only the newest is looked at
            profile.depth = row.queue or row.qos.depth
        message_class, topic = interface_class(row.type), name or row.name
        if row.bulk and not transport.carries_bulk():
            guest = self._bulk_inputs.subscribe(message_class, topic, on_message, profile, entry.raw, wakes=wakes)
            entry.end = partial(self._bulk_inputs.unsubscribe, guest)
            return entry
        subscription = self.create_subscription(message_class, topic, on_message, profile, raw=entry.raw)
        entry.end = partial(self.destroy_subscription, subscription)
        if not wakes:
            self.taken_at_tick.append(subscription)
            self._wake_executor()
        return entry

    def listen(self, row: Topic, callback: Callable[..., None], *, raw: bool = True, wakes: bool = False) -> Any:
        """Subscribes to every message of a row whatever nodes it names: the recorder alone may.

        callback: with a message, and the middleware's info if it takes two arguments. raw: messages as the bytes that
        came over the wire. wakes: the node is woken for them; else it takes them at its next tick.
        Returns what ``destroy_subscription`` takes. Raises ContractViolation.
        """
        self._check(row.name, "listen to", (RECORDER,))
        message_class, profile = interface_class(row.type), listener_profile(row)
        subscription = self.create_subscription(message_class, row.name, callback, profile, raw=raw)
        if not wakes:
            self.taken_at_tick.append(subscription)
        return subscription

    def unsubscribe(self, entry: Input) -> None:
        """Ends what ``subscribe`` began: for what is needed at times only. Its silence is no fault any more."""
        if not entry.ended:
            entry.ended = True
            entry.end()
            self._health.remove(entry.topic.name)
            self._deliveries.forget(entry.topic)

    def prepare_bulk(self) -> None:
        """Makes the participant for clouds and images now: one that comes up later holds others for a moment."""
        if not transport.carries_bulk():
            _ = self._bulk_inputs

    def create_subscription(self, msg_type: Any, topic: str, *args: Any, **kwargs: Any) -> Any:
        """As rclpy's; every message wakes the node. Not for /clock where the world's time is in shared memory."""
        if topic == CLOCK_TOPIC and self._world_clock is not None:
            return None
        return super().create_subscription(msg_type, topic, *args, **kwargs)

    def destroy_subscription(self, subscription: Any) -> bool:
        self.taken_at_tick = [item for item in self.taken_at_tick if item is not subscription]
        return bool(super().destroy_subscription(subscription))

    def serve(self, row: Service, callback: Callable[[Any, Any], Any], name: str = "") -> None:
        """Offers a contract row's service, under ``name`` where the contract calls the name configurable.

        Raises ContractViolation if the row does not name this node.
        """
        self._check(row.name, "serve", (row.server,))
        self.create_service(interface_class(row.type), name or row.name, callback)

    def check_action(self, row: Action) -> Any:
        """The action class of a contract row that this node may serve. Raises ContractViolation."""
        self._check(row.name, "serve", (row.server,))
        return interface_class(row.type)

    def action_client(self, row: Action) -> ActionClient:
        """A client of a contract row's action. Raises ContractViolation if the row does not name this node."""
        self._check(row.name, "ask for", row.clients)
        return ActionClient(self, interface_class(row.type), row.name)

    def every(self, rate_hz: float, callback: Callable[[], None]) -> None:
        """Calls ``callback`` at ``rate_hz``; its duration and overruns go to /diagnostics.

        On the steady clock, or on simulated time. Messages that wake nobody are taken before.
        """
        loop = Loop(callback.__name__.lstrip("_"), 1.0 / rate_hz)
        self.report.loops.append(loop)
        self.create_timer(1.0 / rate_hz, loop.timed(callback))

    def every_real(self, rate_hz: float, callback: Callable[[], None]) -> None:
        """The same on the steady clock, also where simulated time stands still: for what tells that a node lives."""
        self._own_schedule.add(1.0 / rate_hz, callback)

    def create_timer(self, timer_period_sec: float, callback: Callable[[], Any], *_: Any, **__: Any) -> NodeTimer:
        """A timer as ``every`` makes it, without statistics. ``destroy`` ends it."""
        timer = self._schedule.add(timer_period_sec, callback)
        self._wake_executor()
        return timer

    def destroy_timer(self, timer: NodeTimer) -> bool:
        timer.destroy()
        return True

    def call_soon(self, callback: Callable[[], None], *, wakes: bool = True) -> None:
        """Calls ``callback`` once in the node's loop, which is woken for it; may be called from any thread.

        wakes: else it is called when the loop is awake.
        """
        self._soon.append(callback)
        if wakes:
            self._wake_executor()

    def before_wait(self) -> None:
        """The executor is about to sleep: a simulated world waits for a node that is late with what it has to do."""
        if self._time.simulated:
            self.node_record.due(min(self._schedule.next_due_s(), self.work_since_s()))

    def work_since_s(self) -> float:
        """On the node's clock, since when a thread of the node computes what its loop waits for; infinite: none does.

        A simulated world waits for it as for the loop, so that the answer comes after the same time at every speed.
        """
        return math.inf

    def after_wait(self) -> None:
        """The executor is awake: until it sleeps again the node has something to do."""
        if self._time.simulated:
            self.node_record.due(self._time.timer_s())

    def on_taken(self) -> None:
        """The executor has taken what had arrived."""
        self._taken_s = time.monotonic()
        while self._soon:
            self._soon.popleft()()

    @property
    def _bulk_inputs(self) -> BulkInputs:
        if self._bulk is None:
            self._bulk = BulkInputs(self)
        return self._bulk

    def _bulk_idle(self) -> bool:
        return self._bulk is None or self._bulk.idle()

    def _check(self, name: str, verb: str, allowed: tuple[str, ...]) -> None:
        if self.get_name() not in allowed and EVERY_NODE not in allowed:
            raise ContractViolation(f"{self.get_name()} may not {verb} {name}: the contract names {', '.join(allowed)}")

    # --- time --------------------------------------------------------------------------------------------------------

    @property
    def simulated_time(self) -> bool:
        """The node lives on simulated time."""
        return self._time.simulated

    def now_s(self) -> float:
        """The ROS clock in seconds: system time, or the simulated world's with use_sim_time."""
        return self._time.ros_s()

    def now_ns(self) -> int:
        return self._time.ros_ns()

    def age_s(self, real_s: float) -> float:
        """The age on the ROS clock of what was read ``real_s`` ago by the monotonic clock, e.g. an engine's status."""
        return self._time.age_s(real_s)

    def stamp(self) -> Time:
        nanoseconds = self.now_ns()
        return Time(sec=nanoseconds // NANOSECONDS, nanosec=nanoseconds % NANOSECONDS)

    def steady_s(self) -> float:
        """Seconds for ages and watchdogs: never stepped, and standing still while this process was held up.

        Where a simulated world drives, it drives here too.
        """
        return self._time.timer_s() if self._time.simulated else time.monotonic() - self._paused_s

    def _received_s(self, received_ns: int) -> float:
        """The time of a reception, which the middleware gives in system time, on the steady clock.

        A message that wakes nobody lies for a while before it is taken, but never since before the last look: so a
        system clock that is set shifts nothing by more than that.
        """
        now_s = self.steady_s()
        if self._time.simulated:
            return now_s
        waited_s = (time.time_ns() - received_ns) / NANOSECONDS
        return now_s - min(max(waited_s, 0.0), time.monotonic() - self._taken_s)

    def _choose_clock(self) -> NodeClock:
        simulated = bool(self.get_parameter(USE_SIM_TIME_NAME).value)
        self.add_on_set_parameters_callback(_keep_clock)
        if not simulated:
            return SystemClock()
        if self._world_clock is not None:
            return SharedWorldClock(self._world_clock)
        return TopicClock(lambda: float(self.get_clock().now().nanoseconds) / NANOSECONDS)

    def follow_clock(self) -> None:
        """Sets rclpy's own clock, which stamps logs and goals, by the world's time in shared memory."""
        if self._time.simulated and self._world_clock is not None:
            self._time_source.clock_callback(Clock(clock=self.stamp()))

    def on_pause(self, late_s: float) -> None:
        """The executor noticed that this process did not run for so long."""
        self._pauses += 1
        self._paused_s += self._pause_budget.excuse(late_s, time.monotonic())
        self.report.values["held up"] = f"{self._pauses} times, last {late_s:.2f} s"

    # --- health ------------------------------------------------------------------------------------------------------

    @cached_property
    def robot(self) -> Robot:
        """The physical truth, ``config/robot.yaml``."""
        return load_robot()

    def set_health(self, ok: bool, text: str) -> None:
        """What /diagnostics shows, and the heartbeat as ready / waiting for."""
        if (ok, text) != (self.report.ok, self.report.text):
            self.get_logger().info(text) if ok else self.get_logger().warning(text)
        self.report.ok, self.report.text = ok, text

    def log_throttled(self, text: str) -> None:
        """An error that may come back with every message or tick: one line a second, whatever the texts."""
        self.get_logger().error(text, throttle_duration_sec=_LOG_PERIOD_S)

    def input_states(self) -> dict[str, InputState]:
        return self._health.check(self.steady_s())

    # --- stop --------------------------------------------------------------------------------------------------------

    @property
    def emergency_stop(self) -> bool:
        """True from the first /emergency_stop true until the last is false and /safety/status shows no emergency.

        On a machine of the motion-engine layer without a safety monitor, until the last is false.
        """
        return self._stop_latch.active

    def emergency_stop_source(self, *, until_latched: bool = False) -> StopSource:
        """Makes this node a source of the emergency stop, which reports itself until the node ends.

        until_latched: see ``StopSource``.
        """
        stop, sources = self.advertise(topics.EMERGENCY_STOP), self.advertise(topics.EMERGENCY_STOP_SOURCES)
        source = StopSource(self.get_name(), stop, sources, self.stamp, until_latched=until_latched)
        self.every(topics.EMERGENCY_STOP_SOURCES.nominal_rate_hz, source.repeat)
        self._stop_source = source
        return source

    def on_emergency_stop(self) -> None:
        """Called at once, in the subscription's callback, when the emergency stop becomes active."""

    def safe_output(self) -> None:
        """Called on the way out (signal, exception) while publishers still work: leave the outputs safe."""

    def _subscribe_safety(self) -> None:
        self.emergency_stop_input = self.subscribe(topics.EMERGENCY_STOP, self._on_emergency_stop)
        if self.get_name() not in topics.SAFETY_STATUS.publishers:
            self.safety_status_input = self.subscribe(topics.SAFETY_STATUS, self._on_safety_status)

    def _on_emergency_stop(self, message: Bool) -> None:
        was_active = self._stop_latch.active
        self._stop_latch.on_emergency_stop(message.data)
        self._notice_stop(was_active)

    def _on_safety_status(self, message: SafetyStatus) -> None:
        was_active = self._stop_latch.active
        emergency = message.safety_state == SafetyState.EMERGENCY_STOP.name
        self._stop_latch.on_safety_status(emergency)
        if emergency and self._stop_source is not None:
            self._stop_source.on_latched()
        self._notice_stop(was_active)

    def _notice_stop(self, was_active: bool) -> None:
        if self._stop_latch.active and not was_active:
            self.on_emergency_stop()

    def destroy_node(self) -> None:
        if self._bulk is not None:
            self._bulk.close()
        self._deliveries.close()
        super().destroy_node()
        self._lock.close()


def _keep_clock(parameters: list[Any]) -> SetParametersResult:
    """A node cannot change its clock while it runs: every age and timer would jump."""
    changed = any(item.name == USE_SIM_TIME_NAME for item in parameters)
    reason = f"{USE_SIM_TIME_NAME} is chosen at the start of a node" if changed else ""
    return SetParametersResult(successful=not changed, reason=reason)


def run(*node_classes: Callable[[], StackNode], bulk: bool = False) -> None:
    """The body of every node's ``main``: runs the nodes until a signal, then exits with its code.

    bulk: they send or take clouds or images.
    """
    from robot_stack.ros.process import run_nodes

    raise SystemExit(run_nodes(*node_classes, bulk=bulk))


__all__ = ["StackNode", "run"]
