"""Writes a recording: a folder with MCAP files and ``metadata.yaml``.

Messages collect in a chunk; a chunk goes to the file when it is full or flushed, followed by the index of its
messages. So an interrupted file is complete up to its last chunk, and ``recovery`` adds the missing end.
https://mcap.dev/spec
"""

from __future__ import annotations

import fcntl
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.writer import CompressionType, Writer

from robot_stack.contract.model import Topic
from robot_stack.core.atomic_file import sync_folder
from robot_stack.core.message_definitions import message_definition, type_hash
from robot_stack.recording import metadata
from robot_stack.recording.metadata import FileInfo, TopicInfo

PROFILE = "ros2"
LIBRARY = "robot_stack recorder"


@dataclass(frozen=True, slots=True)
class Format:
    """Format of the files: sizes in bytes; that of a chunk is uncompressed."""

    split_bytes: int
    chunk_bytes: int
    compress: bool


def topic_info(row: Topic) -> TopicInfo:
    """The recording's metadata of a contract topic. Raises DefinitionMissing."""
    return TopicInfo(row.name, row.type, type_hash(row.type), metadata.offered_qos(row.qos))


def definitions(topics: Sequence[TopicInfo]) -> dict[str, bytes]:
    """The definition of each message type. Raises DefinitionMissing."""
    return {topic.type: message_definition(topic.type).encode() for topic in topics}


class BagWriter:
    """One recording. Not thread-safe. Raises OSError if the disk is full; flushed data stays readable."""

    def __init__(
        self, folder: Path, topics: Sequence[TopicInfo], form: Format, attachments: Mapping[str, bytes] | None = None
    ) -> None:
        """Makes ``folder``, which must not exist, and the first file in it. attachments: see ``BagFile.finish``.

        Raises OSError, DefinitionMissing.
        """
        self._folder = folder
        self._attachments = attachments or {}
        self._topics = tuple(topics)
        self._format = form
        self._finished: list[FileInfo] = []
        # Checked before anything is created, so that a missing definition leaves no empty folder.
        self._definitions = definitions(topics)
        folder.mkdir(parents=True)
        self._file = self._next_file()

    @property
    def path(self) -> Path:
        """The file being written."""
        return self._folder / self._file.name

    def write(self, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None:
        """Adds a message: CDR with its encapsulation header, times in ns since the epoch."""
        if self._file.size >= self._format.split_bytes:
            self._finish_file()
            self._file = self._next_file()
        self._file.write(topic, log_ns, publish_ns, data)

    def flush(self) -> None:
        """Flushes all messages to the disk: they survive a killed process and a power cut."""
        self._file.flush()

    def close(self) -> None:
        """Completes the file and ``metadata.yaml``."""
        self._finish_file()

    def abandon(self) -> None:
        """Closes a file that cannot be completed because the disk is full. Recovery completes it later."""
        self._file.abandon()

    def _next_file(self) -> BagFile:
        name = f"{self._folder.name}_{len(self._finished)}.mcap"
        file = BagFile(self._folder / name, self._topics, self._definitions, self._format)
        metadata.write_metadata(self._folder, [*self._finished, file.info()], self._topics)
        sync_folder(self._folder)
        return file

    def _finish_file(self) -> None:
        self._file.finish(metadata.metadata_text([self._file.info()], self._topics), self._attachments)
        self._finished.append(self._file.info())
        metadata.write_metadata(self._folder, self._finished, self._topics)


class BagFile:
    """One MCAP file under construction, locked until it is complete. definitions: see the function of this name."""

    def __init__(self, path: Path, topics: Sequence[TopicInfo], definitions: dict[str, bytes], form: Format) -> None:
        """Raises OSError."""
        self.name = path.name
        self._stream: BinaryIO = open(path, "xb")  # noqa: SIM115 - closed in finish() and abandon()
        fcntl.flock(self._stream, fcntl.LOCK_EX)
        compression = CompressionType.ZSTD if form.compress else CompressionType.NONE
        self._writer = Writer(self._stream, chunk_size=form.chunk_bytes, compression=compression)
        self._writer.start(profile=PROFILE, library=LIBRARY)
        self._stream.flush()
        schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        for topic in topics:
            if topic.type not in schemas:
                schemas[topic.type] = self._writer.register_schema(topic.type, "ros2msg", definitions[topic.type])
            about = {metadata.QOS_KEY: metadata.qos_text(topic.qos), metadata.HASH_KEY: topic.type_hash}
            self._channels[topic.name] = self._writer.register_channel(topic.name, "cdr", schemas[topic.type], about)
        self._counts: Counter[str] = Counter()
        self._start_ns = self._end_ns = 0

    @property
    def size(self) -> int:
        """Bytes in finished chunks."""
        return self._stream.tell()

    def info(self) -> FileInfo:
        return FileInfo(self.name, self._start_ns, self._end_ns, dict(self._counts))

    def write(self, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None:
        first = not self._counts
        self._start_ns = log_ns if first else min(self._start_ns, log_ns)
        self._end_ns = max(self._end_ns, log_ns)
        self._writer.add_message(self._channels[topic], log_ns, data, publish_ns, self._counts[topic])
        self._counts[topic] += 1

    def flush(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]
        os.fdatasync(self._stream.fileno())

    def finish(self, serialized_metadata: str, attachments: Mapping[str, bytes] | None = None) -> None:
        """Completes the file. attachments: contents by name, of which an interrupted file has none."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        for name, content in (attachments or {}).items():
            self._writer.add_attachment(self._start_ns, self._start_ns, name, "application/octet-stream", content)
        # rosbag2 reads this from a file without its metadata.yaml. Metadata records are between chunks.
        self._writer.add_metadata("rosbag2", {"serialized_metadata": serialized_metadata})
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.flush()
        os.fdatasync(self._stream.fileno())
        self._stream.close()

    def abandon(self) -> None:
        with suppress(OSError):  # closing retries writes to a full disk, but closes in any case
            self._stream.close()
