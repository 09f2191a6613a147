"""Clouds and images for a node whose own DDS participant has no shared memory."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from rclpy.qos import QoSProfile

from robot_stack.ros import transport
from robot_stack.ros.tool_node import ToolNode

_HIDDEN = re.compile(r"_(.+)_bulk")


def owner_of(node: str) -> str:
    """The node that a node of the graph belongs to: differs only for the hidden node that receives its bulk inputs."""
    found = _HIDDEN.fullmatch(node)
    return found.group(1) if found else node


class Owner(Protocol):
    """The node that the bulk inputs are for."""

    def get_name(self) -> str: ...
    def call_soon(self, callback: Callable[[], None], *, wakes: bool) -> None: ...


class BulkInputs:
    """Subscriptions in a separate participant, with shared memory, read in a separate thread.

    Their messages are passed to the callbacks in the owner's thread. A process that starts delays only this participant
    (``robot_stack.ros.transport``). In the graph the subscriptions belong to the hidden node ``_<owner>_bulk``.
    """

    def __init__(self, owner: Owner) -> None:
        self._owner = owner
        transport.keep_memory()
        with transport.shared_memory():
            self._tool = ToolNode(f"_{owner.get_name()}_bulk")
        self._node = self._tool.node
        self._tool.spin_beside("bulk")

    def subscribe(
        self,
        message_class: Any,
        name: str,
        callback: Callable[[Any, Any], None],
        profile: QoSProfile,
        raw: bool,
        *,
        wakes: bool,
    ) -> Any:
        """Calls ``callback`` with message and info in the owner's executor; while it is busy, the newest ``depth``
        messages are kept. wakes: the owner is woken; otherwise it reads the message at its next wake-up.
        Returns the argument for ``unsubscribe``.
        """
        arrived: deque[tuple[Any, Any]] = deque(maxlen=profile.depth)

        def hand_over() -> None:
            if arrived:  # else replaced by newer messages
                callback(*arrived.popleft())

        def keep(message: Any, info: Any) -> None:
            arrived.append((message, info))
            self._owner.call_soon(hand_over, wakes=wakes)

        return self._node.create_subscription(message_class, name, keep, profile, raw=raw)

    def unsubscribe(self, subscription: Any) -> None:
        self._node.destroy_subscription(subscription)

    def idle(self) -> bool:
        """True if the thread has passed on everything that has arrived."""
        return self._tool.executor.idle()

    def close(self) -> None:
        self._tool.close()
