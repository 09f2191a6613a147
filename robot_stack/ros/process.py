"""One process with its nodes: start, spin, and an orderly shutdown on every path."""

from __future__ import annotations

import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Protocol, TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions

from robot_stack.contract.model import ContractViolation
from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import AlreadyRunning
from robot_stack.ros import transport
from robot_stack.ros.executor import LeanExecutor

_DELIVERY_S = 0.3
EXIT_CRASHED = 1
EXIT_REFUSED = 2  # a mistake in configuration or use: a restart does not help


class EndingNode(Protocol):
    """A node whose outputs can be left safe."""

    port: Any

    def safe_output(self) -> None: ...
    def destroy_node(self) -> Any: ...


NodeT = TypeVar("NodeT", bound=EndingNode)


class StopSignal:
    """True once SIGINT or SIGTERM has arrived.

    rclpy's own handlers shut the context down inside the signal, after which no node could publish its safe output.
    """

    def __init__(self) -> None:
        self.received: signal.Signals | None = None
        self.wake: Callable[[], None] = lambda: None  # wakes the executor, which sleeps until an event
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        self.received = signal.Signals(number)
        self.wake()

    def __call__(self) -> bool:
        return self.received is not None


@contextmanager
def ros_process(*node_classes: Callable[[], NodeT], bulk: bool = False) -> Iterator[tuple[LeanExecutor, list[NodeT]]]:
    """An executor with the nodes in it. At exit the nodes publish safe outputs and everything is closed."""
    transport.apply(bulk=bulk)
    if bulk:
        transport.keep_memory()
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    executor = LeanExecutor()
    nodes: list[NodeT] = []
    try:
        for node_class in node_classes:
            nodes.append(node_class())
            executor.add_node(nodes[-1].port)
        yield executor, nodes
    finally:
        for node in nodes:
            _leave_safe(node)
        for node in nodes:
            node.destroy_node()
        executor.shutdown()
        rclpy.try_shutdown()


def run_nodes(*node_classes: Callable[[], EndingNode], bulk: bool = False) -> int:
    """Runs the nodes until SIGINT or SIGTERM. Returns the exit code; errors of use are one line on stderr."""
    should_stop = StopSignal()
    try:
        with ros_process(*node_classes, bulk=bulk) as (executor, _):
            should_stop.wake = executor.wake
            executor.spin(should_stop)
    except (ConfigError, AlreadyRunning, ContractViolation) as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return EXIT_REFUSED
    except ExternalShutdownException:
        return 0
    except Exception:
        traceback.print_exc()
        return EXIT_CRASHED
    return 0


def _leave_safe(node: EndingNode) -> None:
    try:
        node.safe_output()
        # A last message in flight is lost with its publisher: wait for it, but only briefly.
        node.port.wait_delivered(_DELIVERY_S)
    except Exception:  # the other nodes still have to publish theirs
        traceback.print_exc()
