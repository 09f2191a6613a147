"""Reads the messages of a recording that a replay needs, and writes a recording with no others."""

from __future__ import annotations

import json
import math
import struct
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Message, Schema
from mcap.stream_reader import StreamReader

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.contract.processes import PROCESSES
from robot_stack.core.kept_events import CONFIG_FILE
from robot_stack.core.message_definitions import type_hash
from robot_stack.recording import metadata
from robot_stack.recording.recovery import NoRecording, recording_files
from robot_stack.recording.writer import BagFile, Format, definitions, topic_info
from sim.scheduler.decoding import decoder
from sim.stack.recording import RUN_FILE, run_file

# Exceptions from reading an incomplete or damaged file.
_DAMAGED = (McapError, ValueError, EOFError, struct.error, zstandard.ZstdError)
_ROWS = {row.name: row for row in topics.TOPICS}
NODES = frozenset(node for process in PROCESSES for node in process.nodes)
_THIN = Format(split_bytes=2_000_000_000, chunk_bytes=4_000_000, compress=True)


class ReplayError(Exception):
    """The replay cannot be carried out. The message is one line for users."""


class Sent(NamedTuple):
    """A recorded message: when the recorder received it and when it left its node, ns on the ROS clock."""

    received_ns: int
    sent_ns: int
    data: bytes


@dataclass(slots=True)
class Recorded:
    """A recording's messages by topic, each in the order of reception.

    topics: those that were recorded, also without a message. changed: topics of another type or definition than the
    contract's, and the reason. configuration: the YAML files as a tar archive, None if it is not stored. seed: of a
    run on the scheduler. parameters: overrides by node and name. damages: of files that end early. begin_ns, end_ns: of
    all topics.
    """

    path: Path
    messages: dict[str, list[Sent]] = field(default_factory=lambda: defaultdict(list))
    topics: set[str] = field(default_factory=set)
    changed: dict[str, str] = field(default_factory=dict)
    configuration: bytes | None = None
    seed: int | None = None
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    damages: list[str] = field(default_factory=list)
    begin_ns: int = 0
    end_ns: int = 0

    def of(self, row: Topic) -> list[Sent]:
        return self.messages.get(row.name, [])

    def nodes(self) -> set[str]:
        """Those of the contract with a heartbeat."""
        read = decoder(topics.HEARTBEAT.type)
        return {read(item.data).node for item in self.of(topics.HEARTBEAT)} & NODES

    @property
    def times_of_reception(self) -> bool:
        """False if a scheduler recorded: it writes the time of departure twice."""
        return any(item.received_ns != item.sent_ns for items in self.messages.values() for item in items)


def read_recording(path: Path, wanted: Collection[Topic], until_s: float = math.inf) -> Recorded:
    """Messages of the wanted rows. path: the folder of a recording, of an event, or one file. until_s: since its first
    message. Raises ReplayError.
    """
    files = _files(path)
    recorded, names = Recorded(path), {row.name for row in wanted}
    begin_ns, end_ns = 2**63, 0
    for file in files:
        for topic, message in _messages(file, recorded):
            begin_ns = min(begin_ns, message.log_time)
            if message.log_time - begin_ns > 1e9 * until_s:
                continue
            end_ns = max(end_ns, message.log_time)
            if topic in names:
                sent = Sent(message.log_time, message.publish_time or message.log_time, message.data)
                recorded.messages[topic].append(sent)
    if not end_ns:
        raise ReplayError(
            f"{path} contains no message of the contract" + "".join(f"; {item}" for item in recorded.damages)
        )
    recorded.begin_ns, recorded.end_ns = begin_ns, end_ns
    for items in recorded.messages.values():
        items.sort(key=lambda item: item.received_ns)
    beside = (path if path.is_dir() else path.parent) / CONFIG_FILE
    if recorded.configuration is None and beside.is_file():  # an event of the black box
        recorded.configuration = beside.read_bytes()
    return recorded


def write_thinned(recorded: Recorded, rows: Sequence[Topic], path: Path) -> None:
    """A file with the messages of these rows and what ``simulate`` stores of the run.

    Without the configuration: it is replayed with the present one. Raises ReplayError.
    """
    infos = [topic_info(row) for row in rows if row.name in recorded.topics]
    try:
        file = BagFile(path, infos, definitions(infos), _THIN)
    except OSError as error:
        raise ReplayError(f"{path} cannot be written: {error.strerror or error}") from None
    items = [(item, row.name) for row in rows for item in recorded.of(row)]
    for item, name in sorted(items, key=lambda pair: pair[0].received_ns):
        file.write(name, item.received_ns, item.sent_ns, item.data)
    attachments = {RUN_FILE: run_file(recorded.seed, recorded.parameters)}
    file.finish(metadata.metadata_text([file.info()], infos), attachments)


def _files(path: Path) -> list[Path]:
    try:
        return recording_files(path)
    except NoRecording as error:
        raise ReplayError(str(error)) from None


def _messages(path: Path, recorded: Recorded) -> Iterator[tuple[str, Message]]:
    """Messages of contract topics; notes topics, attachments and damages."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, str] = {}
    with open(path, "rb") as file:
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Message) and record.channel_id in channels:
                    yield channels[record.channel_id], record
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel) and record.topic in _ROWS:
                    channels[record.id] = record.topic
                    _note_topic(recorded, record, schemas.get(record.schema_id))
                elif isinstance(record, Attachment):
                    _note_attachment(recorded, record)
        except _DAMAGED as error:
            why = str(error) or type(error).__name__
            recorded.damages.append(f"{path} is cut off or damaged after {file.tell() / 1e6:.1f} MB ({why})")


def _note_topic(recorded: Recorded, channel: Channel, schema: Schema | None) -> None:
    row = _ROWS[channel.topic]
    recorded.topics.add(row.name)
    found = "" if schema is None else schema.name
    if found != row.type:
        recorded.changed[row.name] = f"recorded as {found or 'an unknown type'}, the contract has {row.type}"
    elif channel.metadata.get(metadata.HASH_KEY, type_hash(row.type)) != type_hash(row.type):
        recorded.changed[row.name] = f"recorded with another definition of {row.type}"


def _note_attachment(recorded: Recorded, attachment: Attachment) -> None:
    if attachment.name == CONFIG_FILE:
        recorded.configuration = attachment.data
    elif attachment.name == RUN_FILE:
        run = json.loads(attachment.data)
        recorded.seed, recorded.parameters = run["seed"], run["parameters"]
