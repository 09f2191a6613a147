"""The node of the emergency-stop button: an input bit of the motion engine to ``/emergency_stop``."""

from __future__ import annotations

import threading

from std_msgs.msg import Bool

from robot_stack.middleware.node import StackNode
from robot_stack.safety.button import Contact, EmergencyButton, read_contact
from robot_stack.safety.params import ButtonParams
from robot_stack.safety.timing import age_s
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.view import EngineView


class EmergencyStopButtonNode(StackNode):
    """Reads the contact in the thread of an EngineView and publishes there: a press does not wait for the executor."""

    def __init__(self) -> None:
        super().__init__("emergency_stop_button", ButtonParams)
        self._byte, self._bit = self.robot.estop_input_byte, self.robot.estop_input_bit
        self._button = EmergencyButton(self.params.debounce_s, self.params.startup_settle_s)
        self._turn = threading.Lock()
        self._read_at_s: float | None = None
        self._stop = self.emergency_stop_source()
        self._view = self.device(EngineView, self.get_name(), self.params.poll_hz, self._on_status)
        self.at_end.callback(self._view.close)
        self.every(2.0 / self.params.silence_s, self._watch)
        self._view.start()

    def _on_status(self, status: StatusSnapshot | None) -> None:
        now_s = self.monotonic_s()
        self._read_at_s = now_s
        self._take(read_contact(status, self._byte, self._bit), now_s)

    def _watch(self) -> None:
        """Detects a thread that hangs or died: then the contact counts as unreadable."""
        now_s = self.monotonic_s()
        if age_s(now_s, self._read_at_s) > self.params.silence_s:
            self._take(Contact.UNREADABLE, now_s)
        pressed = self._button.pressed
        text = "waiting for the engine's inputs" if pressed is None else "pressed" if pressed else "released"
        self.report.values["contact"] = text if self._button.settled else f"{text}, settling"
        self.set_health(pressed is not None, text)

    def _take(self, contact: Contact, now_s: float) -> None:
        with self._turn:
            say = self._button.update(contact, now_s)
            if say is not None:
                self._stop.publish(say)

    def _on_emergency_stop(self, message: Bool) -> None:
        super()._on_emergency_stop(message)
        with self._turn:
            if self._button.contradicts(message.data):
                self._stop.publish(True)
