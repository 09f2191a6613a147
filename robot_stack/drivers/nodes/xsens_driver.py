"""Node xsens_driver: an Xsens inertial unit on a serial line as /sensors/imu."""

from __future__ import annotations

import math
from functools import partial

from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.nodes.imu_output import ImuOutput
from robot_stack.drivers.nodes.serial_line import SerialLine
from robot_stack.drivers.xsens.params import XsensDriverParams
from robot_stack.drivers.xsens.unit import START, Unit
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode


class XsensDriverNode(StackNode):
    """Bytes are timestamped in the reader's thread; all else happens in the node's."""

    def __init__(self) -> None:
        super().__init__("xsens_driver", XsensDriverParams)
        self._unit = Unit(self.params)
        self._output = ImuOutput(self, self.params)
        self._sampled_s = -math.inf
        # An absolute path replaces the runtime folder.
        port = str(runtime_dir() / self.params.serial.port)
        self.set_health(False, f"waiting for the inertial unit on {port}")
        serial = self.params.serial
        line = SerialLine(self.device_s, port, self.params.baud_rate, serial, START, self._on_opened, self._on_bytes)
        self._thread = DeviceThread(line, serial.reopen_s)
        self.at_end.callback(self._thread.close)
        self.every(1.0 / self.params.silence_s, self._watch)

    def _on_opened(self) -> None:
        self.call_soon(self._unit.opened)

    def _on_bytes(self, data: bytes) -> None:
        self.call_soon(partial(self._take, data, self.now_s()))

    def _take(self, data: bytes, arrival_s: float) -> None:
        for sample in self._unit.received(data, arrival_s):
            self._output.publish(sample)
            self._sampled_s = self.steady_s()

    def _watch(self) -> None:
        silent = self.steady_s() - self._sampled_s > self.params.silence_s
        if silent:
            self.set_health(False, f"no samples: {self._thread.problem(self._unit.problem)}")
        elif not self._unit.settled:
            self.set_health(True, "samples arrive; the unit's orientation is not settled yet")
        else:
            self.set_health(True, "samples arrive")
        self.report.values |= {
            "device": f"Xsens on {self._thread.state}",
            "opened": f"{self._thread.opened} times",
            "clock drift": f"{self._unit.drift_ppm:.1f} ppm",
            **self._unit.counters.values(),
        }
