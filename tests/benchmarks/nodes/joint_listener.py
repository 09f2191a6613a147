"""Receives joint states as raw bytes: time of arrival and publisher's stamp of each."""

from __future__ import annotations

import struct
import time

import numpy as np
from numpy.typing import NDArray
from rclpy.qos import QoSProfile

from robot_stack.contract import topics
from robot_stack.middleware.interfaces import interface_class
from robot_stack.ros import transport
from robot_stack.ros.tool_node import ToolNode
from tests.benchmarks.support.framework import BenchError

_STAMP = struct.Struct("<iI")
_STAMP_AT = 4  # after the encapsulation
_DEPTH = 500  # a second of messages, so that a delay of this process loses none


class JointListener:
    """A context manager on ``domain``."""

    def __init__(self, domain: int) -> None:
        transport.apply()
        self._tool = ToolNode("joint_listener", domain)
        self._arrived_ns: list[int] = []
        self._stamped_ns: list[int] = []
        row = topics.WMX_JOINT_STATES
        self._tool.node.create_subscription(
            interface_class(row.type), row.name, self._on_message, QoSProfile(depth=_DEPTH), raw=True
        )

    def __enter__(self) -> JointListener:
        return self

    def __exit__(self, *_: object) -> None:
        self._tool.close()

    def _on_message(self, data: bytes) -> None:
        self._arrived_ns.append(time.monotonic_ns())
        seconds, nanoseconds = _STAMP.unpack_from(data, _STAMP_AT)
        self._stamped_ns.append(seconds * 1_000_000_000 + nanoseconds)

    def wait(self, count: int, longest_s: float = 60.0) -> None:
        """Waits for ``count`` messages from now. Raises BenchError if they do not come."""
        self._clear()
        end_s = time.monotonic() + longest_s
        while len(self._arrived_ns) < count:
            if time.monotonic() > end_s:
                raise BenchError(f"{len(self._arrived_ns)} of {count} joint states in {longest_s:g} s")
            self._tool.executor.spin_once(0.1)

    def run(self, duration_s: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Times of arrival (monotonic) and stamps (system clock) of the messages received within ``duration_s``, ns."""
        self._clear()
        end_s = time.monotonic() + duration_s
        while time.monotonic() < end_s:
            self._tool.executor.spin_once(0.1)
        return np.array(self._arrived_ns, np.int64), np.array(self._stamped_ns, np.int64)

    def _clear(self) -> None:
        self._arrived_ns.clear()
        self._stamped_ns.clear()
