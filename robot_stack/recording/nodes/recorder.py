"""Node ``recorder``: records every topic of the contract as received bytes."""

from __future__ import annotations

import time

from robot_stack.core.runtime import recordings_dir
from robot_stack.middleware.node import StackNode
from robot_stack.recording.nodes.row_recording import RowRecording
from robot_stack.recording.opening import open_recording, prepare_folder
from robot_stack.recording.params import RecorderParams
from robot_stack.recording.selection import selected


class RecorderNode(StackNode, bulk=True):
    def __init__(self) -> None:
        super().__init__("recorder", RecorderParams)
        rows = selected(self.params)
        output = recordings_dir(self.params.output_folder)
        for line in prepare_folder(output, self.params.max_disk_use):
            self.get_logger().warning(line)
        name = self.params.name or time.strftime("%Y%m%d-%H%M%S", time.gmtime(self.port.system_s()))
        self.folder = output / name
        self._writer = open_recording(self.folder, rows, self.params)
        self._rows = RowRecording(self, rows, self.params, self._on_message, self._on_message)
        self.every(1.0, self._watch)
        self._watch()

    def _on_message(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        self._writer.add(topic, received_ns, sent_ns, data)

    def _watch(self) -> None:
        counts = self._writer.counts()
        self.report.values |= {
            "folder": str(self.folder),
            "messages": str(counts.messages),
            "megabytes": f"{counts.bytes / 1e6:.1f}",
            "lost": str(counts.lost),
        }
        if self._writer.problem:
            self.set_health(False, f"recording has stopped: {self._writer.problem}")
            self._rows.close()
        elif counts.lost:
            self.set_health(False, f"recording to {self.folder}, messages are lost: the disk is too slow")
        else:
            self.set_health(True, f"recording to {self.folder}")

    def safe_output(self) -> None:
        """Completes the recording."""
        self._rows.close()
        self._writer.close()
