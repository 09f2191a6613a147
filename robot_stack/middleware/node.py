"""The base of every node: endpoints by contract row, validated parameters, input health, heartbeat, safe shutdown.

A node reaches its middleware through a port (``robot_stack.middleware.port``) and is independent of the implementation.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from contextlib import ExitStack
from functools import cached_property
from typing import Any, ClassVar, ParamSpec, TypeVar

from builtin_interfaces.msg import Time
from pydantic import BaseModel
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import topics
from robot_stack.contract.graph import RECORDERS
from robot_stack.contract.model import (
    EVERY_NODE,
    Action,
    ContractViolation,
    Process,
    SafetyState,
    Service,
    System,
    Topic,
)
from robot_stack.contract.processes import BY_NAME
from robot_stack.core.health import InputHealth, InputState
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.stop_latch import StopLatch
from robot_stack.core.worker import Worker
from robot_stack.middleware.conversions import NANOSECONDS
from robot_stack.middleware.emergency_stop import StopSource
from robot_stack.middleware.inputs import Input
from robot_stack.middleware.parameters import load_parameters, refuse_overrides
from robot_stack.middleware.port import (
    ActionClient,
    ActionGoal,
    Logger,
    Port,
    Publisher,
    ServiceClient,
    Subscription,
    open_port,
)
from robot_stack.middleware.report import Loop, Report
from robot_stack.middleware.timers import NodeTimer

P = ParamSpec("P")
T = TypeVar("T")
_LOG_PERIOD_S = 1.0


class StackNode:
    """A node of the stack.

    name: a node name of the contract.
    parameters: the model of ``config/<name>.yaml``; None for a node without parameters.

    Raises AlreadyRunning if this domain has a node of this name, ConfigError if the parameters are wrong,
    ContractViolation for an endpoint that the contract does not give this node.
    """

    bulk: ClassVar[bool] = False

    def __init_subclass__(cls, *, bulk: bool = False) -> None:
        """bulk: the node publishes or subscribes to clouds or images (``robot_stack.ros.transport``)."""
        cls.bulk = bulk or cls.bulk

    def __init__(self, name: str, parameters: type[BaseModel] | None = None) -> None:
        self.port: Port = open_port(name)
        # What the node closes at its end, the last first, and its port last.
        self.at_end = ExitStack()
        self.at_end.callback(self.port.close)
        self.params: Any = None
        if parameters is None:
            refuse_overrides(self.port)
        else:
            self.params = load_parameters(self.port, parameters)
        self._health = InputHealth()
        # The machines of the motion-engine layer have no safety monitor of their own.
        self._stop_latch = StopLatch(monitored=name not in BY_NAME or BY_NAME[name].system is not System.WMX)
        self._stop_source: StopSource | None = None
        self.report = Report(self)
        self._subscribe_safety()

    def get_name(self) -> str:
        return self.port.name

    def get_logger(self) -> Logger:
        return self.port.logger

    # --- endpoints ---------------------------------------------------------------------------------------------------

    def advertise(self, row: Topic, name: str = "") -> Publisher:
        """The publisher of a contract row, under ``name`` where the contract calls the name configurable.

        Raises ContractViolation if the row does not name this node, or is bulk and the process was not started for it.
        """
        self._check(row.name, "publish", row.publishers)
        return self.port.advertise(row, name or row.name)

    def subscribe(
        self, row: Topic, callback: Callable[[Any], None] | None = None, name: str = "", *, raw: bool = False
    ) -> Input:
        """Subscribes to a contract row, under ``name`` where the contract calls the name configurable.

        Clouds and images come as views on the received bytes, with the message's fields
        (``robot_stack.middleware.wire``). raw: messages come as their bytes.
        Raises ContractViolation if the row does not name this node.
        """
        self._check(row.name, "subscribe to", row.subscribers)
        entry = Input(row, callback, self._health, self.steady_s)
        # Without a callback only the newest message is used.
        depth = row.qos.depth if callback is None else row.queue or row.qos.depth
        wakes = row.wakes_node(self.get_name())
        entry.end = self.port.subscribe(row, name or row.name, entry.on_message, depth, wakes=wakes, raw=raw).end
        return entry

    def listen(
        self, row: Topic, callback: Callable[[Any, int, int], None], *, raw: bool = True, wakes: bool = False
    ) -> Subscription:
        """Subscribes to every message of any row; only the recorder and the black box may do so.

        callback: see ``Port.listen``. raw: messages as the bytes received. wakes: messages wake the node;
        otherwise it reads them at its next tick. Raises ContractViolation.
        """
        self._check(row.name, "listen to", RECORDERS)
        return self.port.listen(row, callback, raw=raw, wakes=wakes)

    def unsubscribe(self, entry: Input) -> None:
        """Ends a subscription that is needed only at times. Its input health is no longer watched."""
        if not entry.ended:
            entry.ended = True
            entry.end()
            self._health.remove(entry.topic.name)

    def prepare_bulk(self) -> None:
        """Makes the participant for clouds and images now: one that starts later delays the others for a moment."""
        self.port.prepare_bulk()

    def serve(self, row: Service, callback: Callable[[Any, Any], Any], name: str = "") -> None:
        """Offers a contract row's service, under ``name`` where the contract calls the name configurable.

        callback: takes the request and an empty response, returns the response.
        Raises ContractViolation if the row does not name this node.
        """
        self.serve_later(row, lambda request, response, answer: answer(callback(request, response)), name)

    def serve_later(
        self, row: Service, callback: Callable[[Any, Any, Callable[[Any], None]], None], name: str = ""
    ) -> None:
        """Like ``serve`` for slow answers. callback: gets request, empty response, and the function that responds."""
        self._check(row.name, "serve", (row.server,))
        self.port.serve(row.type, name or row.name, callback)

    def client(self, row: Service) -> ServiceClient:
        return self.port.client(row.type, row.name)

    def serve_action(self, row: Action, on_goal: Callable[[ActionGoal], None], name: str = "") -> None:
        """Offers a contract row's action. Every goal is accepted and passed to ``on_goal``, which ends it later.

        Raises ContractViolation if the row does not name this node.
        """
        self._check(row.name, "serve", (row.server,))
        self.port.serve_action(row, name or row.name, on_goal)

    def action_client(self, row: Action) -> ActionClient:
        """A client of a contract row's action. Raises ContractViolation if the row does not name this node."""
        self._check(row.name, "ask for", row.clients)
        return self.port.action_client(row)

    def count_publishers(self, name: str) -> int:
        return self.port.count_publishers(name)

    def _check(self, name: str, verb: str, allowed: tuple[str, ...]) -> None:
        if self.get_name() not in allowed and EVERY_NODE not in allowed:
            raise ContractViolation(f"{self.get_name()} may not {verb} {name}: the contract names {', '.join(allowed)}")

    # --- timers, work beside the loop, devices -----------------------------------------------------------------------

    def every(self, rate_hz: float, callback: Callable[[], None]) -> None:
        """Calls ``callback`` at ``rate_hz``; its duration and overruns go to /diagnostics.

        On the steady clock, or on simulated time. Messages that do not wake the node are read before.
        """
        loop = Loop(callback.__name__.lstrip("_"), 1.0 / rate_hz)
        self.report.loops.append(loop)
        self.create_timer(1.0 / rate_hz, loop.timed(callback, self.monotonic_s))

    def every_real(self, rate_hz: float, callback: Callable[[], None]) -> None:
        """Like ``every``, on the computer's clock, which also runs while simulated time stands still: heartbeats."""
        self.port.add_real_timer(1.0 / rate_hz, callback)

    def create_timer(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        """A timer like that of ``every``, without statistics. ``destroy`` ends it."""
        return self.port.add_timer(period_s, callback)

    def call_soon(self, callback: Callable[[], None], *, wakes: bool = True) -> None:
        """Calls ``callback`` once in the node's loop; may be called from any thread.

        wakes: wakes the loop; otherwise the call waits for the next wake-up.
        """
        self.port.call_soon(callback, wakes=wakes)

    def worker(self, name: str, *, world_waits: bool = False) -> Worker:
        """Runs jobs beside the tick, see ``Port.worker``."""
        return self.port.worker(name, world_waits=world_waits)

    def device(self, make: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Makes a connection of this node to hardware, see ``Port.device``."""
        return self.port.device(make, *arguments, **options)

    # --- time --------------------------------------------------------------------------------------------------------

    @property
    def simulated_time(self) -> bool:
        """True if the node runs on simulated time."""
        return self.port.simulated_time

    def now_s(self) -> float:
        """The ROS clock in seconds: system time, or the simulated world's with use_sim_time."""
        return self.port.now_ns() / NANOSECONDS

    def now_ns(self) -> int:
        return self.port.now_ns()

    def stamp(self) -> Time:
        nanoseconds = self.now_ns()
        return Time(sec=nanoseconds // NANOSECONDS, nanosec=nanoseconds % NANOSECONDS)

    def steady_s(self) -> float:
        """Seconds for ages and watchdogs: never stepped, and stands still while this process is paused.

        With a simulated world, its time.
        """
        return self.port.steady_s()

    def monotonic_s(self) -> float:
        """The computer's monotonic clock, also where simulated time stands still."""
        return self.port.monotonic_s()

    def device_s(self) -> float:
        """Seconds for data of devices and their silence: the clock by which the kernel stamps, never stepped.

        With a simulated world, its time. May be called from any thread.
        """
        return self.port.device_s()

    def age_s(self, real_s: float) -> float:
        """The age on the ROS clock of a value read ``real_s`` ago by the monotonic clock, e.g. an engine's status."""
        return self.port.age_s(real_s)

    # --- health ------------------------------------------------------------------------------------------------------

    @cached_property
    def robot(self) -> Robot:
        """Physical parameters, ``config/robot.yaml``."""
        return load_robot()

    def set_health(self, ok: bool, text: str) -> None:
        """Sets the status in /diagnostics, and in the heartbeat as ready / waiting for."""
        if (ok, text) != (self.report.ok, self.report.text):
            self.get_logger().info(text) if ok else self.get_logger().warning(text)
        self.report.ok, self.report.text = ok, text

    def log_throttled(self, text: str) -> None:
        """Logs an error that may occur with every message or tick: at most one line a second, whatever the text."""
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
        source = StopSource(
            self.get_name(), self.port.process_id, stop, sources, self.stamp, until_latched=until_latched
        )
        self.every(topics.EMERGENCY_STOP_SOURCES.nominal_rate_hz, source.repeat)
        self._stop_source = source
        return source

    def on_emergency_stop(self) -> None:
        """Called at once, in the subscription's callback, when the emergency stop becomes active."""

    def safe_output(self) -> None:
        """Called at shutdown (signal, exception) while publishers still work: publish safe outputs here."""

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
        self.at_end.close()


def node_class(row: Process) -> type[StackNode]:
    """The class of a process with one node: ``<Node>Node`` of its module."""
    name = "".join(part.capitalize() for part in row.name.split("_"))
    found: type[StackNode] = getattr(importlib.import_module(str(row.module)), f"{name.removesuffix('Node')}Node")
    return found
