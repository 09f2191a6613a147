"""A node that receives joint states on topics of its own at a tick, and its sender.

``python -m tests.benchmarks.nodes.listener listen|send INPUTS RATE_HZ DURATION_S``; ``listen`` prints the
processor time in us and the number of messages.
"""

from __future__ import annotations

import sys
import time

from sensor_msgs.msg import JointState

from robot_stack.contract import topics
from robot_stack.middleware.node import StackNode
from robot_stack.ros import transport
from robot_stack.ros.process import StopSignal, ros_process

_SETTLE_S = 3.0


class Listener(StackNode):
    """Has the name of a contract node that does not run during the benchmark."""

    def __init__(self, inputs: int, rate_hz: float) -> None:
        super().__init__("system_monitor")
        self.received = 0
        for number in range(inputs):
            name, depth = f"/bench/input_{number}", topics.JOINT_STATES.qos.depth
            self.port.subscribe(topics.JOINT_STATES, name, self._on_message, depth, wakes=False, raw=False)
        self.every(rate_hz, self._tick)

    def _on_message(self, _: JointState, received_s: float) -> None:
        self.received += 1

    def _tick(self) -> None:
        pass


class Sender(StackNode):
    def __init__(self, inputs: int, rate_hz: float) -> None:
        super().__init__("touch_ui")
        self._publishers = [self.port.advertise(topics.JOINT_STATES, f"/bench/input_{n}") for n in range(inputs)]
        zeros = [0.0] * 8
        self._message = JointState(name=[f"joint_{n}" for n in range(8)], position=zeros, velocity=zeros, effort=zeros)
        self.every(rate_hz, self._send)

    def _send(self) -> None:
        for publisher in self._publishers:
            publisher.publish(self._message)


def main() -> None:
    role, inputs, rate_hz, duration_s = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
    sys.argv[1:] = []
    transport.apply()
    should_stop = StopSignal()
    node_class = Listener if role == "listen" else Sender
    with ros_process(lambda: node_class(inputs, rate_hz)) as (executor, nodes):
        should_stop.wake = executor.wake
        if role == "send":
            executor.spin(should_stop)
            return
        listener = nodes[0]
        assert isinstance(listener, Listener)
        _spin(executor, _SETTLE_S)
        listener.received, used_s = 0, time.process_time()
        _spin(executor, duration_s)
        print(f"{1e6 * (time.process_time() - used_s):.1f} {listener.received}")


def _spin(executor: object, duration_s: float) -> None:
    end_s = time.monotonic() + duration_s
    executor.spin(lambda: time.monotonic() > end_s)  # type: ignore[attr-defined]


if __name__ == "__main__":
    main()
