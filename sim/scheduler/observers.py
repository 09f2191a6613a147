"""Observers of a run: called for each event, without effect on it."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from pathlib import Path

from robot_stack.contract.model import Topic
from robot_stack.contract.topics import DIAGNOSTICS
from robot_stack.recording.writer import BagWriter, Format, topic_info


class LifeChange(Enum):
    STARTED = "started"  # construction begins
    READY = "ready"  # its loop runs
    STOPPED = "stopped"  # in order
    KILLED = "killed"
    CRASHED = "crashed"  # by an exception
    REFUSED = "refused"  # by its configuration; starting again will not help
    HUNG = "hung"
    RESUMED = "resumed"


class Observer:
    """Override what is of interest; a method that is not overridden costs nothing. Times in ns of virtual time."""

    def on_publish(self, time_ns: int, node: str, topic: str, data: bytes) -> None:
        """A message leaves its publisher."""

    def on_deliver(self, time_ns: int, node: str, topic: str, data: bytes) -> None:
        """A message arrives in the queue of subscriber ``node``; it may still be overwritten by the next."""

    def on_exception(self, time_ns: int, process: str, text: str) -> None:
        """text: the traceback."""

    def on_life_change(self, time_ns: int, process: str, change: LifeChange) -> None:
        """A process starts, ends, hangs or continues."""


class Digest(Observer):
    """SHA-256 over time, topic, publisher and bytes of all messages, in the order in which they leave.

    folders: paths that differ from run to run; nodes name them in /diagnostics, where they are left out.
    """

    _HEAD = struct.Struct("<qIII")

    def __init__(self, folders: Sequence[bytes] = ()) -> None:
        self._folders = folders
        self._sum = hashlib.sha256()
        self.messages = 0
        self._names: dict[tuple[str, str], bytes] = {}

    def on_publish(self, time_ns: int, node: str, topic: str, data: bytes) -> None:
        self.messages += 1
        names = self._names.get((topic, node))
        if names is None:
            names = self._names[topic, node] = topic.encode() + node.encode()
        self._sum.update(self._HEAD.pack(time_ns, len(topic), len(node), len(data)) + names)
        if topic == DIAGNOSTICS.name:
            for folder in self._folders:
                data = data.replace(folder, b"")
        self._sum.update(data)

    def add(self, data: bytes) -> None:
        """Includes other data, e.g. the ground truth."""
        self._sum.update(data)

    def hexdigest(self) -> str:
        return self._sum.hexdigest()


class Recording(Observer):
    """Writes the messages of some rows in the recorder's format.

    clock_start_ns: the ROS clock at virtual time 0. keeps: takes topic and ROS time in s; False leaves a message out,
    e.g. ``robot_stack.recording.sweeps.SweepChoice.keeps``. attachments: contents by name. Raises OSError,
    DefinitionMissing.
    """

    FORMAT = Format(split_bytes=2_000_000_000, chunk_bytes=1_000_000, compress=True)

    def __init__(
        self,
        folder: Path,
        rows: Sequence[Topic],
        clock_start_ns: int,
        keeps: Callable[[str, float], bool] | None = None,
        form: Format = FORMAT,
        attachments: Mapping[str, bytes] | None = None,
    ) -> None:
        self._bag = BagWriter(folder, [topic_info(row) for row in rows], form, attachments)
        self._topics = {row.name for row in rows}
        self._clock_start_ns = clock_start_ns
        self._keeps = keeps

    def on_publish(self, time_ns: int, node: str, topic: str, data: bytes) -> None:
        if topic not in self._topics:
            return
        ros_ns = self._clock_start_ns + time_ns
        if self._keeps is None or self._keeps(topic, 1e-9 * ros_ns):
            self._bag.write(topic, ros_ns, ros_ns, data)

    def close(self) -> None:
        """Completes the recording."""
        self._bag.close()
