"""Node ``black_box``: keeps the last minute of all topics on the disk, events, and records of rides."""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from robot_stack.contract import topics
from robot_stack.core.kept_events import black_box_dir
from robot_stack.core.rides import rides_dir
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.report import diagnostic_status
from robot_stack.recording.black_box import TriggerWatch
from robot_stack.recording.black_box_files import Clocks
from robot_stack.recording.nodes.blur import blurred
from robot_stack.recording.nodes.ride_log import RideLog
from robot_stack.recording.nodes.row_recording import RowRecording
from robot_stack.recording.opening import open_black_box
from robot_stack.recording.params import BlackBoxParams
from robot_stack.recording.provenance import provenance
from robot_stack.recording.selection import selected

_CHECK_HZ = 5.0


class BlackBoxNode(StackNode, bulk=True):
    def __init__(self) -> None:
        super().__init__("black_box", BlackBoxParams)
        params, rows = self.params, selected(self.params, self.get_name())
        clocks = Clocks(self.steady_s, self.port.system_s, self.now_s)
        self._kept = provenance(params.map, self.monotonic_s)
        self._box, self._writer = self.device(open_black_box, black_box_dir(), rows, params, self._kept, clocks)
        for line in self._box.notes:
            self.get_logger().warning(line)
        self._triggers = TriggerWatch(params.ignored_faults, params.silence_s, params.settle_s)
        self._rows = RowRecording(self, rows, params, self._on_message, self._on_image)
        self.listen(topics.SAFETY_STATUS, self._on_status, raw=False, wakes=True)
        self._rides = RideLog(self, rides_dir(), params.rides_retention_days)
        self.every(_CHECK_HZ, self._check_silence)
        self.every(1.0, self._watch)
        self.report.more = self._disk_status
        self._watch()

    def _on_message(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        self._writer.add(topic, received_ns, sent_ns, data)

    def _on_image(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        self._on_message(topic, blurred(data, self.params.image_block_px), received_ns, sent_ns)

    def _on_status(self, message: Any, *_: int) -> None:
        self._box.trigger(self._triggers.on_status(message.active_faults, self.emergency_stop, self.steady_s()))

    def on_emergency_stop(self) -> None:
        self._box.trigger(self._triggers.on_emergency_stop(self.emergency_stop))

    def _check_silence(self) -> None:
        self._box.trigger(self._triggers.on_emergency_stop(self.emergency_stop))
        self._box.trigger(self._triggers.check(self.steady_s()))

    def _watch(self) -> None:
        self._box.trigger(self._triggers.on_nodes({node.name: node.pid for node in self._kept.nodes()}))
        counts = self._writer.counts()
        self.report.values |= {
            "folder": str(self._box.path),
            "megabytes": f"{counts.bytes / 1e6:.1f}",
            "lost": str(counts.lost),
            "events": str(self._box.events),
            "event": self._box.event,
        }
        self.set_health(True, f"recording to {self._box.path}")

    def _disk_status(self) -> tuple[DiagnosticStatus]:
        """A full disk is a warning and leaves the node ready: it must not keep the robot from starting."""
        lost = self._writer.counts().lost
        problem = self._writer.problem or self._box.problem or (f"{lost} messages are lost: slow disk" if lost else "")
        level = DiagnosticStatus.WARN if problem else DiagnosticStatus.OK
        return (diagnostic_status(f"{self.get_name()}: disk", level, problem or "has room", ()),)

    def safe_output(self) -> None:
        """Completes the files."""
        self._rows.close()
        self._writer.close()
