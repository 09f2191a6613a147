"""Clouds and images for a node whose own DDS participant has no shared memory."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from robot_stack.ros import transport
from robot_stack.ros.executor import LeanExecutor

_JOIN_S = 5.0


class BulkInputs:
    """Subscriptions in a participant of their own, with shared memory, taken in a thread of their own.

    What they bring is handed to the callbacks in the owner's thread. Held up by a process that comes up, they delay
    nothing but themselves (``robot_stack.ros.transport``). In the graph they belong to the hidden node
    ``_<owner>_bulk``.
    """

    def __init__(self, owner: Node) -> None:
        self._owner = owner
        self._context = Context()
        with transport.shared_memory():
            rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(
            f"_{owner.get_name()}_bulk",
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = LeanExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, name="bulk", daemon=True)
        self._thread.start()

    def subscribe(self, message_class: Any, name: str, callback: Callable[[Any], None], profile: QoSProfile) -> None:
        """Calls ``callback`` in the owner's executor; of what it has no time for, the newest ``depth`` are kept."""
        arrived: deque[Any] = deque(maxlen=profile.depth)

        def hand_over() -> None:
            while arrived:
                callback(arrived.popleft())

        guard = self._owner.create_guard_condition(hand_over)

        def keep(message: Any) -> None:
            arrived.append(message)
            guard.trigger()

        self._node.create_subscription(message_class, name, keep, profile)

    def close(self) -> None:
        self._executor.stop()
        self._thread.join(_JOIN_S)
        self._node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self._context)
