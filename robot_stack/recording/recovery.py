"""Completes interrupted recordings: ``python -m robot_stack.recording.recovery FOLDER``.

In place: the data after the last complete chunk is cut off, that chunk's message index is written again, and summary
and footer are appended. It needs neither time nor disk space for a copy, however large the file is.
"""

from __future__ import annotations

import fcntl
import os
import re
import struct
import sys
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from robot_stack.recording import metadata
from robot_stack.recording.metadata import FileInfo, TopicInfo
from robot_stack.recording.writer import LIBRARY, PROFILE

_RECORD_HEADER = struct.Struct("<BQ")  # opcode, length of the content
_INDEX_HEADER = struct.Struct("<HI")  # channel, length of the entries
_INDEX_ENTRY_BYTES = 16
_NUMBER = re.compile(r"_\d+$")  # of a file in its recording
# Exceptions from reading a damaged chunk.
_DAMAGED = (CRCValidationError, McapError, ValueError, struct.error, zstandard.ZstdError)


class NotRecoverable(Exception):
    """The file is no MCAP file. The message is one line for users."""


class InUse(Exception):
    """A recorder is writing this file."""


class NoRecording(Exception):
    """A path is not one recording. The message is one line for users."""


@dataclass(slots=True)
class _Found:
    """The content of a file up to its last complete chunk."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    counts: Counter[int] = field(default_factory=Counter)
    end: int = 0
    has_header: bool = False


def is_complete(path: Path) -> bool:
    """True if the file ends as an MCAP file does."""
    with open(path, "rb") as file:
        file.seek(0, os.SEEK_END)
        if file.tell() < 2 * len(MCAP0_MAGIC):
            return False
        file.seek(-len(MCAP0_MAGIC), os.SEEK_END)
        return file.read() == MCAP0_MAGIC


def recover_file(path: Path) -> int:
    """Completes one file and returns how many messages are in it. Raises NotRecoverable, InUse, OSError."""
    with open(path, "r+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InUse(f"{path} is being recorded") from error
        found = _scan(file, path)
        file.seek(found.end)
        file.truncate()
        file.write(_ending(found))
        file.flush()
        os.fsync(file.fileno())
        return found.counts.total()


def recover_folder(folder: Path) -> list[str]:
    """Completes a recording's files and its ``metadata.yaml``. Returns the actions, a line each.

    Raises InUse if a recorder is writing it, OSError.
    """
    done = []
    names = recorded_files(folder)
    for name in names:
        path = folder / name
        if is_complete(path):
            continue
        try:
            done.append(f"{path}: completed with {recover_file(path)} messages")
        except NotRecoverable as error:
            done.append(str(error))
    whole = [name for name in names if is_complete(folder / name)]
    if done or not (folder / metadata.METADATA_FILE).exists():
        rebuild_metadata(folder, whole)
    return done


def recover_all(output_folder: Path) -> list[str]:
    """Completes every recording in a folder, except those being written. Returns a line for each."""
    done = []
    for folder in sorted(path for path in output_folder.glob("*") if path.is_dir()):
        try:
            if any(not is_complete(folder / name) for name in recorded_files(folder)):
                done += recover_folder(folder)
        except InUse:
            continue
        except (OSError, McapError) as error:
            done.append(f"{folder}: cannot be completed: {error}")
    return done


def recorded_files(folder: Path) -> list[str]:
    """MCAP files of a recording in their order, also those that metadata.yaml does not name."""
    there = {path.name for path in folder.glob("*.mcap")}
    named = [name for name in metadata.recorded_files(folder) if name in there]
    return [*named, *sorted(there.difference(named), key=lambda name: (len(name), name))]


def recording_files(path: Path) -> list[Path]:
    """The MCAP files of a recording's folder in their order, or the one file. Raises NoRecording.

    Left out: files of a folder that are empty, as a power failure can leave the newest one.
    """
    try:
        files = [path / name for name in recorded_files(path)] if path.is_dir() else [path]
        files = [file for file in files if file == path or file.stat().st_size > 0]
        for file in files:
            with open(file, "rb") as opened:
                if opened.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                    raise NoRecording(f"{file} is no recording: it does not begin as an MCAP file")
    except OSError as error:
        raise NoRecording(f"{path} cannot be read: {error.strerror or error}") from None
    if not files:
        raise NoRecording(f"{path} is no recording: there is no .mcap file in it")
    named = set(metadata.recorded_files(path))
    own = {_NUMBER.sub("", Path(name).stem) for name in named}
    recordings: dict[str, str] = {}  # the first file of each
    for file in files:
        prefix = _NUMBER.sub("", file.stem)
        recordings.setdefault("" if file.name in named or prefix in own else prefix, file.name)
    if len(recordings) > 1:
        names = ", ".join(recordings.values())
        raise NoRecording(f"{path} contains {len(recordings)} recordings, which begin with {names}: choose one of them")
    return files


# --- reading ---------------------------------------------------------------------------------------------------------


def _scan(file: BinaryIO, path: Path) -> _Found:
    size = os.fstat(file.fileno()).st_size
    if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        raise NotRecoverable(f"{path}: does not begin as an MCAP file")
    found = _Found(end=file.tell())
    last: tuple[int, int] | None = None  # offset and length of the newest complete chunk
    while (record := _next_record(file, size)) is not None:
        opcode, start, length = record
        match opcode:
            case Opcode.HEADER:
                found.end, found.has_header = start + _RECORD_HEADER.size + length, True
            case Opcode.CHUNK:
                if last is not None:
                    found.end = start  # another chunk begins, so the previous one is complete with its index
                last = (start, length)
                _note_chunk(file, found, start, length)
            case Opcode.MESSAGE_INDEX:
                _note_index(file, found, start, length)
            case Opcode.METADATA if last is not None:
                break  # written only after the last chunk
            case Opcode.DATA_END | Opcode.FOOTER:
                break
        file.seek(start + _RECORD_HEADER.size + length)
    if last is not None:
        _settle_last(file, found, *last)
    if found.chunks and not found.channels:
        raise NotRecoverable(f"{path}: its first chunk is damaged, and with it the list of topics")
    return found


def _next_record(file: BinaryIO, size: int) -> tuple[int, int, int] | None:
    """(opcode, offset, length) of the record at the file's position, None if it is cut off."""
    start = file.tell()
    header = file.read(_RECORD_HEADER.size)
    if len(header) < _RECORD_HEADER.size:
        return None
    opcode, length = _RECORD_HEADER.unpack(header)
    # Opcode 0 does not exist: a power cut can leave a hole of zeros.
    return (opcode, start, length) if opcode != 0 and start + _RECORD_HEADER.size + length <= size else None


def _note_chunk(file: BinaryIO, found: _Found, start: int, length: int) -> None:
    """Stores a chunk's header; the first chunk is opened too, because it declares all channels."""
    if not found.chunks:
        _note_declarations(file, found, start)
    file.seek(start + _RECORD_HEADER.size)
    fixed = file.read(8 + 8 + 8 + 4)
    begin_ns, end_ns, uncompressed, _ = struct.unpack("<QQQI", fixed)
    (name_length,) = struct.unpack("<I", file.read(4))
    compression = file.read(name_length).decode()
    (compressed,) = struct.unpack("<Q", file.read(8))
    found.chunks.append(
        ChunkIndex(
            chunk_length=_RECORD_HEADER.size + length,
            chunk_start_offset=start,
            compression=compression,
            compressed_size=compressed,
            message_end_time=end_ns,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=begin_ns,
            uncompressed_size=uncompressed,
        )
    )


def _note_declarations(file: BinaryIO, found: _Found, start: int) -> None:
    with suppress(*_DAMAGED):
        for _, record in _open_chunk(_read_chunk(file, start)):
            if isinstance(record, Schema):
                found.schemas[record.id] = record
            elif isinstance(record, Channel):
                found.channels[record.id] = record


def _note_index(file: BinaryIO, found: _Found, start: int, length: int) -> None:
    channel, entries = _INDEX_HEADER.unpack(file.read(_INDEX_HEADER.size))
    chunk = found.chunks[-1]
    chunk.message_index_offsets[channel] = start
    chunk.message_index_length += _RECORD_HEADER.size + length
    found.counts[channel] += entries // _INDEX_ENTRY_BYTES


def _settle_last(file: BinaryIO, found: _Found, start: int, length: int) -> None:
    """Rebuilds the last chunk's index, which may be incomplete, if the chunk itself is intact."""
    chunk = found.chunks[-1]
    for channel, offset in chunk.message_index_offsets.items():
        file.seek(offset + _RECORD_HEADER.size)
        _, entries = _INDEX_HEADER.unpack(file.read(_INDEX_HEADER.size))
        found.counts[channel] -= entries // _INDEX_ENTRY_BYTES
    chunk.message_index_offsets, chunk.message_index_length = {}, 0
    try:
        records = _open_chunk(_read_chunk(file, start))
    except _DAMAGED:
        found.chunks.pop()
        found.end = start
        return
    found.end = start + _RECORD_HEADER.size + length
    builder = RecordBuilder()
    for index in _index_of(records):
        chunk.message_index_offsets[index.channel_id] = found.end + builder.count
        found.counts[index.channel_id] += len(index.records)
        index.write(builder)
    written = _taken(builder)
    chunk.message_index_length = len(written)
    file.seek(found.end)
    file.write(written)
    found.end += len(written)


def _read_chunk(file: BinaryIO, start: int) -> Chunk:
    file.seek(start + _RECORD_HEADER.size)
    chunk: Chunk = Chunk.read(ReadDataStream(file))
    return chunk


def _open_chunk(chunk: Chunk) -> list[tuple[int, McapRecord]]:
    """(offset in the uncompressed chunk, record) of everything in a chunk. Raises CRCValidationError and others."""
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    data = stream.read(size)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"chunk of {len(data)} bytes, not {chunk.uncompressed_size}")
    records: list[tuple[int, McapRecord]] = []
    offset = 0
    while offset < size:
        opcode, length = _RECORD_HEADER.unpack_from(data, offset)
        begin = offset + _RECORD_HEADER.size
        body = ReadDataStream(BytesIO(data[begin : begin + length]))
        if opcode == Opcode.MESSAGE:
            records.append((offset, Message.read(body, length)))
        elif opcode == Opcode.SCHEMA:
            records.append((offset, Schema.read(body)))
        elif opcode == Opcode.CHANNEL:
            records.append((offset, Channel.read(body)))
        offset = begin + length
    return records


def _index_of(records: list[tuple[int, McapRecord]]) -> list[MessageIndex]:
    indexes: dict[int, MessageIndex] = {}
    for offset, record in records:
        if isinstance(record, Message):
            index = indexes.setdefault(record.channel_id, MessageIndex(record.channel_id, []))
            index.records.append((record.log_time, offset))
    return list(indexes.values())


# --- writing ---------------------------------------------------------------------------------------------------------


def _ending(found: _Found) -> bytes:
    """Everything after ``found.end``: DataEnd, summary and footer, and the header if it is missing."""
    head = RecordBuilder()
    if not found.has_header:
        Header(PROFILE, LIBRARY).write(head)
    DataEnd(0).write(head)
    before = _taken(head)
    summary_start = found.end + len(before)
    summary, offsets = RecordBuilder(), RecordBuilder()
    for opcode, records in _summary_groups(found):
        begin = summary.count
        for record in records:
            record.write(summary)
        SummaryOffset(opcode, summary_start + begin, summary.count - begin).write(offsets)
    body = _taken(summary)
    footer = RecordBuilder()
    Footer(summary_start, summary_start + len(body), 0).write(footer)
    return b"".join((before, body, _taken(offsets), _taken(footer), MCAP0_MAGIC))


def _taken(builder: RecordBuilder) -> bytes:
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


def _summary_groups(found: _Found) -> list[tuple[Opcode, list[McapRecord]]]:
    groups: list[tuple[Opcode, list[McapRecord]]] = [
        (Opcode.SCHEMA, list(found.schemas.values())),
        (Opcode.CHANNEL, list(found.channels.values())),
        (Opcode.STATISTICS, [_statistics(found)]),
        (Opcode.CHUNK_INDEX, list(found.chunks)),
    ]
    return [(opcode, records) for opcode, records in groups if records]


def _statistics(found: _Found) -> Statistics:
    return Statistics(
        attachment_count=0,
        channel_count=len(found.channels),
        channel_message_counts={channel: count for channel, count in found.counts.items() if count},
        chunk_count=len(found.chunks),
        message_count=found.counts.total(),
        message_end_time=max((chunk.message_end_time for chunk in found.chunks), default=0),
        message_start_time=min((chunk.message_start_time for chunk in found.chunks), default=0),
        metadata_count=0,
        schema_count=len(found.schemas),
    )


def rebuild_metadata(folder: Path, names: list[str]) -> None:
    """Writes ``metadata.yaml`` for these complete files, in their order. Raises OSError, McapError."""
    files: list[FileInfo] = []
    topics: dict[str, TopicInfo] = {}
    for name in names:
        with open(folder / name, "rb") as file:
            summary = make_reader(file).get_summary()
        if summary is None or summary.statistics is None:
            continue
        counts = summary.statistics.channel_message_counts
        by_topic = {channel.topic: counts.get(number, 0) for number, channel in summary.channels.items()}
        statistics = summary.statistics
        files.append(FileInfo(name, statistics.message_start_time, statistics.message_end_time, by_topic))
        for channel in summary.channels.values():
            qos = metadata.qos_from_text(channel.metadata.get(metadata.QOS_KEY, ""))
            type_name = summary.schemas[channel.schema_id].name
            type_hash = channel.metadata.get(metadata.HASH_KEY, "")
            topics.setdefault(channel.topic, TopicInfo(channel.topic, type_name, type_hash, qos))
    metadata.write_metadata(folder, files, list(topics.values()))


def main(arguments: list[str]) -> int:
    if len(arguments) != 1:
        print("usage: python -m robot_stack.recording.recovery FOLDER", file=sys.stderr)
        return 2
    try:
        done = recover_folder(Path(arguments[0]))
    except (InUse, OSError, McapError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print("\n".join(done) or f"{arguments[0]}: is complete")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
