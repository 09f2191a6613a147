"""Node ehmi_display: the simulated external display on a pseudo terminal, and what it shows on /sim/ehmi_display."""

from __future__ import annotations

import json

from std_msgs.msg import String

from robot_stack.contract import services, topics
from robot_stack.core.display_patterns import load_patterns
from robot_stack.core.display_picture import description
from robot_stack.core.runtime import runtime_dir
from robot_stack.middleware.node import StackNode
from sim.ehmi.faults import DisplayFaults
from sim.ehmi.firmware import Display
from sim.ehmi.line import DisplayLine
from sim.ehmi.params import EhmiDisplayParams
from sim.nodes.fault_service import serve_faults


class EhmiDisplayNode(StackNode):
    """The firmware runs in a thread of its own, on real time."""

    def __init__(self) -> None:
        super().__init__("ehmi_display", EhmiDisplayParams)
        self._patterns = load_patterns()
        self._shown: Display | None = None
        self._display = self.advertise(topics.SIM_EHMI_DISPLAY)
        self._line = self.device(DisplayLine, self.params.firmware, runtime_dir() / self.params.link_name)
        self.at_end.callback(self._line.close)
        self._faults = DisplayFaults(self._line)
        serve_faults(self, services.INJECT_EHMI_FAULT, self.inject_fault)
        self.every(self.params.tick_rate_hz, self._tick)
        self.every(topics.SIM_EHMI_DISPLAY.nominal_rate_hz, self._publish)

    def inject_fault(self, kind: str, target: str, value: float, duration_s: float) -> str:
        """Raises FaultRefused."""
        return self._faults.inject(kind, target, value, duration_s)

    def _tick(self) -> None:
        self._faults.update()
        if self._line.display() != self._shown:
            self._publish()

    def _publish(self) -> None:
        self._shown = self._line.display()
        shown = self._shown
        content = description(self._patterns, shown.state, shown.language, shown.volume)
        self._display.publish(String(data=json.dumps(content, ensure_ascii=False)))
        self.report.values["shown"] = str(content["name"])
        self.set_health(True, "the display is on its line")
