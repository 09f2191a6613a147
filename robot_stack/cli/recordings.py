"""Reads recordings message by message up to the first error, without changing them."""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.recording import recovery

# Exceptions from reading an incomplete or damaged file.
_DAMAGED = (McapError, ValueError, EOFError, struct.error, zstandard.ZstdError)


class Recorded(NamedTuple):
    """A message: time of reception in s since the epoch; ``decode`` makes an object with the fields of its type."""

    topic: str
    at_s: float
    decode: Callable[[], Any]


def recording_files(path: Path) -> list[Path]:
    """The MCAP files of a recording's folder, or the one file. Raises CommandError."""
    try:
        return recovery.recording_files(path)
    except recovery.NoRecording as error:
        raise CommandError(str(error), WRONG_USE) from None


def read_all(
    files: Sequence[Path], topics: Collection[str], progress: Callable[[int, int], None]
) -> Iterator[Recorded | str]:
    """``read_messages`` of all files in turn. progress: called with (bytes read, total bytes)."""
    total, before = sum(file.stat().st_size for file in files), 0
    for file in files:
        yield from read_messages(file, topics, lambda position, before=before: progress(before + position, total))  # type: ignore[misc]
        before += file.stat().st_size
        progress(before, total)


def read_messages(path: Path, topics: Collection[str], progress: Callable[[int], None]) -> Iterator[Recorded | str]:
    """Messages of ``topics`` in one file, in order of reception; then an error text if the file is cut off or damaged.

    progress: called periodically with the number of bytes read.
    """
    factory = DecoderFactory()
    schemas: dict[int, Schema] = {}
    wanted: dict[int, tuple[str, Callable[[bytes], Any]]] = {}
    with open(path, "rb") as file:
        try:
            # The chunks' checksums distinguish a damaged file from an unknown message.
            for count, record in enumerate(StreamReader(file, validate_crcs=True).records):
                if isinstance(record, Message) and record.channel_id in wanted:
                    topic, decoder = wanted[record.channel_id]
                    yield Recorded(topic, 1e-9 * record.log_time, partial(decoder, record.data))
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel) and record.topic in topics:
                    found = factory.decoder_for(record.message_encoding, schemas.get(record.schema_id))
                    if found is not None:
                        wanted[record.id] = (record.topic, found)
                if count % 1000 == 0:
                    progress(file.tell())
        except _DAMAGED as error:
            why = str(error) or type(error).__name__
            yield f"{path} is cut off or damaged after {file.tell() / 1e6:.1f} MB ({why})"
