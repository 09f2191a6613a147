"""A node outside the process table: of a tool, or a second participant of a process."""

from __future__ import annotations

import threading

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from robot_stack.ros.executor import LeanExecutor

_JOIN_S = 5.0


class ToolNode:
    """A node with its own context and executor, without the endpoints that others would discover needlessly.

    Apply ``robot_stack.ros.transport`` before making one, and end it with ``close``.
    """

    def __init__(self, name: str, domain: int | None = None) -> None:
        """domain: None for this process' own."""
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(
            name,
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self.executor = LeanExecutor(context=self._context)
        self.executor.add_node(self.node)
        self._thread: threading.Thread | None = None

    def spin_beside(self, name: str) -> None:
        """Runs the callbacks in a thread of this name until ``close``."""
        self._thread = threading.Thread(target=self.executor.spin, name=name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """A thread that does not end in time keeps its resources until the process ends: destroying a subscription
        while it is read would crash the process.
        """
        self.executor.stop()
        if self._thread is not None:
            self._thread.join(_JOIN_S)
            if self._thread.is_alive():
                return
        self.node.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown(context=self._context)
