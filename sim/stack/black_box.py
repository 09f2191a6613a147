"""The black box on the scheduler: its files are real; the node's own timer writes them instead of a thread."""

from __future__ import annotations

from pathlib import Path

from robot_stack.contract.model import Topic
from robot_stack.recording.background import Counts
from robot_stack.recording.black_box_files import BlackBox, Clocks, Provenance
from robot_stack.recording.opening import make_black_box
from robot_stack.recording.params import BlackBoxParams
from sim.scheduler.port import SimPort


class ScheduledWriter:
    """See ``BackgroundWriter``."""

    problem = ""

    def __init__(self, box: BlackBox) -> None:
        self._box = box
        self._messages = self._bytes = 0

    def counts(self) -> Counts:
        return Counts(self._messages, self._bytes, 0)

    def add(self, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None:
        self._box.write(topic, log_ns, publish_ns, data)
        self._messages += 1
        self._bytes += len(data)

    def close(self) -> None:
        self._box.close()


class ScheduledBlackBox:
    """See ``open_black_box``. A killed black box writes nothing more, and its files stay incomplete."""

    def __init__(self) -> None:
        self._latest: BlackBox | None = None

    def open(
        self, port: SimPort, folder: Path, rows: list[Topic], params: BlackBoxParams, kept: Provenance, clocks: Clocks
    ) -> tuple[BlackBox, ScheduledWriter]:
        if self._latest is not None:
            self._latest.abandon()
        box = self._latest = make_black_box(folder, rows, params, kept, clocks)
        port.add_timer(params.flush_period_s, box.flush)
        return box, ScheduledWriter(box)
