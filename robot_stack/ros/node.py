"""The base of every node: endpoints by contract row, validated parameters, input health, heartbeat, a safe way out."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property
from typing import IO, Any

from builtin_interfaces.msg import Time
from pydantic import BaseModel
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import topics
from robot_stack.contract.model import Action, ContractViolation, SafetyState, Service, System, Topic
from robot_stack.contract.processes import BY_NAME
from robot_stack.core.health import InputHealth, InputState
from robot_stack.core.pauses import PauseBudget
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.runtime import hold_lock
from robot_stack.core.stop_latch import StopLatch
from robot_stack.ros import transport
from robot_stack.ros.bulk import BulkInputs
from robot_stack.ros.inputs import Input
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.parameters import load_parameters, refuse_overrides
from robot_stack.ros.report import Loop, Report


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
        super().__init__(name)
        if parameters is None:
            refuse_overrides(self)
        self.params: Any = load_parameters(self, parameters) if parameters else None
        self._health = InputHealth()
        self._paused_s = 0.0
        self._pauses = 0
        self._pause_budget = PauseBudget(time.monotonic())
        # The machines of the motion-engine layer have no safety monitor of their own.
        self._stop_latch = StopLatch(monitored=name not in BY_NAME or BY_NAME[name].system is not System.WMX)
        self.report = Report(self)
        self._bulk: BulkInputs | None = None
        self._subscribe_safety()

    # --- endpoints ---------------------------------------------------------------------------------------------------

    def advertise(self, row: Topic, name: str = "") -> Publisher:
        """The publisher of a contract row, under ``name`` where the contract calls the name configurable.

        Raises ContractViolation if the row does not name this node, or is bulk and the process was not started for it.
        """
        self._check(row.name, "publish", row.publishers)
        if row.bulk and not transport.carries_bulk():
            raise ContractViolation(f"{self.get_name()} may not publish {row.name}: its process runs without bulk=True")
        return self.create_publisher(
            interface_class(row.type),
            name or row.name,
            qos_profile(row.qos),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )

    def subscribe(self, row: Topic, callback: Callable[[Any], None] | None = None, name: str = "") -> Input:
        """Subscribes to a contract row, under ``name`` where the contract calls the name configurable.

        Raises ContractViolation if the row does not name this node.
        """
        self._check(row.name, "subscribe to", row.subscribers)
        entry = Input(row, callback, self._health, self.steady_s)
        profile = qos_profile(row.qos)
        profile.depth = row.queue or row.qos.depth
        apart = row.bulk and not transport.carries_bulk()
        create = self._bulk_inputs.subscribe if apart else self.create_subscription
        create(interface_class(row.type), name or row.name, entry.on_message, profile)
        return entry

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
        """Calls ``callback`` at ``rate_hz`` on the ROS clock; its duration and overruns go to /diagnostics."""
        loop = Loop(callback.__name__.lstrip("_"), 1.0 / rate_hz)
        self.report.loops.append(loop)
        self.create_timer(1.0 / rate_hz, loop.timed(callback))

    @property
    def _bulk_inputs(self) -> BulkInputs:
        if self._bulk is None:
            self._bulk = BulkInputs(self)
        return self._bulk

    def _check(self, name: str, verb: str, allowed: tuple[str, ...]) -> None:
        if self.get_name() not in allowed and topics.EVERY_NODE not in allowed:
            raise ContractViolation(f"{self.get_name()} may not {verb} {name}: the contract names {', '.join(allowed)}")

    # --- time --------------------------------------------------------------------------------------------------------

    def now_s(self) -> float:
        """The ROS clock in seconds: system time, or /clock with use_sim_time."""
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def stamp(self) -> Time:
        return self.get_clock().now().to_msg()

    def steady_s(self) -> float:
        """Seconds for ages and watchdogs: never stepped, and standing still while this process was held up.

        Where /clock drives, it drives here too.
        """
        return self.now_s() if self.get_clock().ros_time_is_active else time.monotonic() - self._paused_s

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

    def input_states(self) -> dict[str, InputState]:
        return self._health.check(self.steady_s())

    # --- stop --------------------------------------------------------------------------------------------------------

    @property
    def emergency_stop(self) -> bool:
        """True from the first /emergency_stop true until the last is false and /safety/status shows no emergency.

        On a machine of the motion-engine layer without a safety monitor, until the last is false.
        """
        return self._stop_latch.active

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
        self._stop_latch.on_safety_status(message.safety_state == SafetyState.EMERGENCY_STOP.name)
        self._notice_stop(was_active)

    def _notice_stop(self, was_active: bool) -> None:
        if self._stop_latch.active and not was_active:
            self.on_emergency_stop()

    def destroy_node(self) -> None:
        if self._bulk is not None:
            self._bulk.close()
        super().destroy_node()
        self._lock.close()


def run(*node_classes: Callable[[], StackNode], bulk: bool = False) -> None:
    """The body of every node's ``main``: runs the nodes until a signal, then exits with its code.

    bulk: they send or take clouds or images.
    """
    from robot_stack.ros.process import run_nodes

    raise SystemExit(run_nodes(*node_classes, bulk=bulk))


__all__ = ["StackNode", "run"]
