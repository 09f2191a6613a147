"""Node ``recorder``: every topic of the contract, as it is on the wire, into a recording."""

from __future__ import annotations

import time
from collections.abc import Callable
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import recordings_dir
from robot_stack.recording.background import BackgroundWriter, disk_use
from robot_stack.recording.images import IMAGE_TYPE, DockingWatch, Thinning
from robot_stack.recording.params import RecorderParams
from robot_stack.recording.recovery import recover_all
from robot_stack.recording.sweeps import SweepChoice
from robot_stack.recording.writer import BagWriter, Format, topic_info
from robot_stack.ros.interfaces import interface_class, listener_profile
from robot_stack.ros.node import StackNode, run

_TAKE_HZ = 10.0


class RecorderNode(StackNode):
    def __init__(self) -> None:
        super().__init__("recorder", RecorderParams)
        rows = _selected(self.params)
        output = recordings_dir(self.params.output_folder)
        for line in _prepare(output, self.params.max_disk_use):
            self.get_logger().warning(line)
        name = self.params.name or time.strftime("%Y%m%d-%H%M%S", time.gmtime())
        self.folder = output / name
        self._writer = _open(self.folder, rows, self.params)
        images = [row for row in rows if row.type == IMAGE_TYPE]
        self._images = _Images(self, images) if images else None
        self._sweeps = SweepChoice(self.params.sweeps, self.params.sweep_rate_hz)
        rows = [row for row in rows if row not in images and self._sweeps.subscribes(row)]
        self._row_subscriptions = [
            self.record(row, self._on_sweep if self._sweeps.thins(row) else self.on_message) for row in rows
        ]
        self.every(_TAKE_HZ, lambda: None)  # what has come is taken before
        self.every(1.0, self._watch)
        self._watch()

    def record(self, row: Topic, on_message: Callable[[str, bytes, Any], None]) -> Any:
        callback = partial(on_message, row.name)
        subscription = self.create_subscription(
            interface_class(row.type), row.name, callback, listener_profile(row), raw=True
        )
        self.taken_at_tick.append(subscription)
        return subscription

    def on_message(self, topic: str, data: bytes, info: Any) -> None:
        # The middleware's times are the system's; beside a simulated clock they would be of another time.
        simulated = self.simulated_time
        log_ns = self.now_ns() if simulated else info["received_timestamp"]
        sent_ns = 0 if simulated else info["source_timestamp"]
        self._writer.add(topic, log_ns, sent_ns or log_ns, data)

    def _on_sweep(self, topic: str, data: bytes, info: Any) -> None:
        if self._sweeps.wants(topic, self.now_s()):
            self.on_message(topic, data, info)

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
            self.destroy_subscription(subscription)
        self._row_subscriptions = []
        if self._images is not None:
            self._images.close()

    def safe_output(self) -> None:
        """Completes the recording."""
        self._end_subscriptions()
        self._writer.close()


class _Images:
    """Subscribes to images only while they are recorded: receiving what nobody writes would cost as much."""

    def __init__(self, node: RecorderNode, rows: list[Topic]) -> None:
        self._node = node
        self._rows = rows
        self._mode = node.params.images
        self._thinning = Thinning(node.params.image_rate_hz)
        self._docking = DockingWatch(node.params.image_tail_s)
        self._subscriptions: list[Any] = []
        self._closed = False
        if self._mode == "docking":
            row = topics.DOCKING_STATUS
            node.create_subscription(interface_class(row.type), row.name, self._on_status, listener_profile(row))
            node.every(2.0, self._update)  # a controller that fell silent
        self._update()

    def _on_status(self, message: Any) -> None:
        self._docking.on_status(message.state, self._node.steady_s())
        self._update()

    def _update(self) -> None:
        docking = self._mode == "docking" and self._docking.active(self._node.steady_s())
        wanted = (docking or self._mode == "always") and not self._closed
        if wanted and not self._subscriptions:
            self._subscriptions = [self._node.record(row, self._on_image) for row in self._rows]
        elif not wanted and self._subscriptions:
            for subscription in self._subscriptions:
                self._node.destroy_subscription(subscription)
            self._subscriptions = []

    def _on_image(self, topic: str, data: bytes, info: Any) -> None:
        if self._thinning.wants(topic, self._node.now_s()):
            self._node.on_message(topic, data, info)

    def close(self) -> None:
        self._closed = True
        self._update()


def _selected(params: RecorderParams) -> list[Topic]:
    """The rows to record. Raises ConfigError for a pattern that fits no topic, and if none is left."""
    rows = topics.of_system(*params.systems)
    # What another machine has may be left out here as well.
    for field, known in (("include", rows), ("exclude", topics.TOPICS)):
        for pattern in getattr(params, field):
            if not any(fnmatchcase(row.name, pattern) for row in known):
                raise ConfigError(f"recorder: {field}: {pattern!r} fits no topic of the contract")
    chosen = [row for row in rows if _fits(row, params.include) and not _fits(row, params.exclude)]
    if not chosen:
        raise ConfigError("recorder: include and exclude leave no topic to record")
    return chosen


def _fits(row: Topic, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(row.name, pattern) for pattern in patterns)


def _prepare(output: Path, max_disk_use: float) -> list[str]:
    """Makes the folder and completes what an earlier recorder left behind. Raises ConfigError if there is no room."""
    try:
        output.mkdir(parents=True, exist_ok=True)
        use = disk_use(output)
        if use >= max_disk_use:
            limit = f"limit max_disk_use {max_disk_use:.0%}"
            raise ConfigError(f"recorder: the disk of {output} is {use:.0%} full, {limit}")
        return recover_all(output)
    except OSError as error:
        raise ConfigError(f"recorder: output_folder {output} cannot be used: {error.strerror or error}") from error


def _open(folder: Path, rows: list[Topic], params: RecorderParams) -> BackgroundWriter:
    form = Format(
        split_bytes=round(params.split_size_mb * 1e6),
        chunk_bytes=round(params.chunk_size_kb * 1e3),
        compress=params.compression == "zstd",
    )
    try:
        bag = BagWriter(folder, [topic_info(row) for row in rows], form)
    except OSError as error:
        raise ConfigError(f"recorder: {folder} cannot be made: {error.strerror or error}") from error
    return BackgroundWriter(
        bag,
        folder,
        flush_period_s=params.flush_period_s,
        max_disk_use=params.max_disk_use,
        queue_bytes=round(params.queue_mb * 1e6),
    )


def main() -> None:
    run(RecorderNode, bulk=True)
