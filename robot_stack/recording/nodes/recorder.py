"""Node ``recorder``: records every topic of the contract as received bytes."""

from __future__ import annotations

import time
from functools import partial

from robot_stack.core.runtime import recordings_dir
from robot_stack.middleware.node import StackNode, run
from robot_stack.recording.images import IMAGE_TYPE
from robot_stack.recording.nodes.image_recording import ImageRecording
from robot_stack.recording.opening import open_recording, prepare_folder
from robot_stack.recording.params import RecorderParams
from robot_stack.recording.selection import selected
from robot_stack.recording.sweeps import SweepChoice

_TAKE_HZ = 10.0


class RecorderNode(StackNode):
    def __init__(self) -> None:
        super().__init__("recorder", RecorderParams)
        rows = selected(self.params)
        output = recordings_dir(self.params.output_folder)
        for line in prepare_folder(output, self.params.max_disk_use):
            self.get_logger().warning(line)
        name = self.params.name or time.strftime("%Y%m%d-%H%M%S", time.gmtime(self.port.system_s()))
        self.folder = output / name
        self._writer = open_recording(self.folder, rows, self.params)
        images = [row for row in rows if row.type == IMAGE_TYPE]
        self._images = ImageRecording(self, images, self.params, self._on_message) if images else None
        self._sweeps = SweepChoice(self.params.sweeps, self.params.sweep_rate_hz)
        rows = [row for row in rows if row not in images and self._sweeps.subscribes(row)]
        self._row_subscriptions = [
            self.listen(row, partial(self._on_sweep if self._sweeps.thins(row) else self._on_message, row.name))
            for row in rows
        ]
        self.every(_TAKE_HZ, lambda: None)  # the tick reads the queued messages
        self.every(1.0, self._watch)
        self._watch()

    def _on_message(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        self._writer.add(topic, received_ns, sent_ns, data)

    def _on_sweep(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        if self._sweeps.keeps(topic, self.now_s()):
            self._on_message(topic, data, received_ns, sent_ns)

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
            self._end_subscriptions()
        elif counts.lost:
            self.set_health(False, f"recording to {self.folder}, messages are lost: the disk is too slow")
        else:
            self.set_health(True, f"recording to {self.folder}")

    def _end_subscriptions(self) -> None:
        for subscription in self._row_subscriptions:
            subscription.end()
        self._row_subscriptions = []
        if self._images is not None:
            self._images.close()

    def safe_output(self) -> None:
        """Completes the recording."""
        self._end_subscriptions()
        self._writer.close()


def main() -> None:
    run(RecorderNode, bulk=True)
