"""/departure_warning: how the nodes that start the robot share the warning before it starts."""

from __future__ import annotations

import math
from collections.abc import Callable

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from robot_stack.contract import topics
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.node import StackNode

_STALE_S = topics.DEPARTURE_WARNING.stale_limit_s
# Nodes tick at the row's rate or at a multiple of it.
_PERIOD_S = 0.95 / topics.DEPARTURE_WARNING.nominal_rate_hz
_SECOND_NS = 1_000_000_000


class MotionWarnings:
    """given: called when another node has completed its warning."""

    def __init__(self, node: StackNode, given: Callable[[], None]) -> None:
        self._node, self._given = node, given
        self._received_s = self._published_s = -math.inf
        self._publisher = node.advertise(topics.DEPARTURE_WARNING)
        node.subscribe(topics.DEPARTURE_WARNING, self._on_warning)

    @property
    def active(self) -> bool:
        """True while another node is warning people."""
        return self._node.steady_s() - self._received_s < _STALE_S

    def publish(self, remaining_s: float | None) -> None:
        """remaining_s: until the robot starts, as ``Departure.remaining_s``."""
        now_s = self._node.steady_s()
        if remaining_s is None or (remaining_s > 0.0 and now_s - self._published_s < _PERIOD_S):
            return
        self._published_s = now_s
        at_ns = round((self._node.now_s() + remaining_s) * _SECOND_NS)
        stamp = Time(sec=at_ns // _SECOND_NS, nanosec=at_ns % _SECOND_NS)
        self._publisher.publish(Header(stamp=stamp, frame_id=self._node.get_name()))

    def _on_warning(self, message: Header) -> None:
        if message.frame_id == self._node.get_name():
            return
        # The sender's clock may be a little ahead of this node's.
        over = time_to_s(message.stamp) <= self._node.now_s() + 0.5 * _PERIOD_S
        self._received_s = -math.inf if over else self._node.steady_s()
        if over:
            self._given()
