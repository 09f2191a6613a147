"""Events kept by the black box: a folder for each, with a record, the configuration and an MCAP recording.

Folder ``<state>/black_box/events/<id>/``:
    event.json       the record (``EventRecord``)
    config.tar.gz    the YAML files of the configuration that were in force
    *.mcap, metadata.yaml    the recording, in the form of rosbag2
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path

from pydantic import ValidationError

from robot_stack.core.atomic_file import replace_file, sync_folder
from robot_stack.core.config import Config
from robot_stack.core.runtime import state_dir

RECORD_FILE, CONFIG_FILE = "event.json", "config.tar.gz"


class EventState(StrEnum):
    """``OPEN``: being recorded. ``INTERRUPTED``: ended by the end of the black box, complete up to then."""

    OPEN = "open"
    COMPLETE = "complete"
    INTERRUPTED = "interrupted"


class Trigger(Config):
    """Reasons that began at one moment. at_s: of the system clock; ros_s: of the ROS clock, as in the recording."""

    at_s: float
    ros_s: float
    reasons: tuple[str, ...]


class NodeSnapshot(Config):
    """A node's record in shared memory. silent_s: age of its last heartbeat."""

    name: str
    pid: int
    ready: bool
    text: str
    silent_s: float


class MapUsed(Config):
    """sha256: of map.yaml, which contains the checksums of the other files."""

    name: str
    sha256: str


class Software(Config):
    """sha256: over the Python files of the package, which also shows a changed checkout."""

    version: str
    sha256: str


class EventRecord(Config):
    """id: date and time (UTC) of the first trigger. number: counts the events, whatever the system clock shows."""

    id: str
    number: int = 0
    state: EventState
    triggers: tuple[Trigger, ...]
    software: Software
    map: MapUsed | None
    nodes: tuple[NodeSnapshot, ...]

    @property
    def at_s(self) -> float:
        """Of the first trigger, s since the epoch."""
        return self.triggers[0].at_s

    @property
    def reasons(self) -> tuple[str, ...]:
        """Each once, in the order in which they began."""
        return tuple(dict.fromkeys(reason for trigger in self.triggers for reason in trigger.reasons))


def black_box_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """It need not exist yet."""
    return state_dir(environment) / "black_box"


def events_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """It need not exist yet."""
    return black_box_dir(environment) / "events"


def write_record(folder: Path, record: EventRecord) -> None:
    """Replaces the record atomically. Raises OSError."""
    replace_file(folder / RECORD_FILE, record.model_dump_json(indent=1))


def read_record(folder: Path) -> EventRecord | None:
    """None if there is no readable record: a folder that is being made or deleted."""
    try:
        return EventRecord.model_validate_json((folder / RECORD_FILE).read_bytes())
    except (OSError, ValidationError):
        return None


def read_events(folder: Path) -> list[EventRecord]:
    """The events in a folder, the newest first."""
    try:
        found = [record for item in folder.iterdir() if item.is_dir() and (record := read_record(item)) is not None]
    except OSError:
        return []
    return sorted(found, key=lambda record: (record.number, record.at_s, record.id), reverse=True)


def event_bytes(folder: Path) -> int:
    """Size of an event's files. Raises OSError."""
    return sum(item.stat().st_size for item in folder.iterdir() if item.is_file())


def delete_event(folder: Path) -> None:
    """Deletes the record first: an interrupted deletion leaves no event that looks whole. Raises OSError."""
    (folder / RECORD_FILE).unlink(missing_ok=True)
    sync_folder(folder)
    shutil.rmtree(folder)
