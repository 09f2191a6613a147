"""A node outside the process table: of a tool, or a second participant of a process."""

from __future__ import annotations

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from robot_stack.ros.executor import LeanExecutor


class Guest:
    """A node with a context and an executor of its own. What others would have to discover for nothing is left out.

    Whoever makes one has applied ``robot_stack.ros.transport`` and leaves by ``close``.
    """

    def __init__(self, name: str) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(
            name,
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self.executor = LeanExecutor(context=self._context)
        self.executor.add_node(self.node)

    def close(self) -> None:
        self.node.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown(context=self._context)
