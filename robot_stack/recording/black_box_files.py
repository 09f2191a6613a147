"""The black box on the disk: rolling segments, and events that keep them by hard links.

Folder ``<state>/black_box/``: ``segments/`` and ``events/`` (``robot_stack.core.kept_events``). A link costs no copy
and also contains what is written afterwards, so an event is on the disk from its trigger on, and a killed process loses
at most the last ``flush_period_s``; the next one completes its files.
"""

from __future__ import annotations

import os
import re
import shutil
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError

from robot_stack.core import kept_events
from robot_stack.core.atomic_file import sync_folder
from robot_stack.core.kept_events import EventRecord, EventState, MapUsed, NodeSnapshot, Software, Trigger
from robot_stack.recording.background import bytes_over
from robot_stack.recording.black_box import INTERRUPTED, Retention, Stored, Timing, Window, to_delete
from robot_stack.recording.metadata import METADATA_FILE, TopicInfo, metadata_text
from robot_stack.recording.params import BlackBoxParams
from robot_stack.recording.recovery import InUse, NotRecoverable, is_complete, recover_file, recover_folder
from robot_stack.recording.writer import BagFile, Format, definitions

_FAILED = (OSError, McapError)
_NAME = re.compile(r"black_box_(\d{6,})\.mcap")
# The triggers that a record lists, or that wait for a disk that refuses: a chattering fault must not make them grow.
_TRIGGERS_MAX = 100
_RETRY_S = 5.0
_RETENTION_PERIOD_S = 10.0


@dataclass(frozen=True, slots=True)
class Provenance:
    """What an event keeps beside its messages. config: the archive of ``CONFIG_FILE``.

    nodes: called at an event's first trigger.
    """

    software: Software
    map: MapUsed | None
    config: bytes
    nodes: Callable[[], tuple[NodeSnapshot, ...]]


@dataclass(frozen=True, slots=True)
class Clocks:
    """See ``Port``. ros_s: the clock of the messages' times."""

    steady_s: Callable[[], float]
    system_s: Callable[[], float]
    ros_s: Callable[[], float]


class BlackBox:
    """Written by one thread, except ``trigger``. Raises nothing after its construction: see ``problem``.

    notes: what was completed of an earlier black box, a line each.
    """

    def __init__(
        self,
        folder: Path,
        topics: Sequence[TopicInfo],
        params: BlackBoxParams,
        provenance: Provenance,
        clocks: Clocks,
    ) -> None:
        """Raises OSError, DefinitionMissing."""
        self._segments, self._events = folder / "segments", folder / "events"
        self._topics, self._definitions = tuple(topics), definitions(topics)
        self._params, self._provenance = params, provenance
        self._steady_s, self._system_s, self._ros_s = clocks.steady_s, clocks.system_s, clocks.ros_s
        segment_bytes = round(params.segment_max_mb * 1e6)
        self._form = Format(segment_bytes, round(params.chunk_size_kb * 1e3), params.compression == "zstd")
        self._window = Window(
            Timing(params.before_s, params.after_s, params.segment_s, segment_bytes, params.event_max_s)
        )
        self._retention = Retention(params.retention_days)
        self._triggers: deque[Trigger] = deque()
        self._file: BagFile | None = None
        self._event: EventRecord | None = None
        self._problem = ""
        self._retry_at_s = self._retention_at_s = -float("inf")
        self.notes: list[str] = []
        for made in (self._segments, self._events):
            made.mkdir(parents=True, exist_ok=True)
        self._number = self._last_number()
        incomplete = self._inherit()
        records = kept_events.read_events(self._events)
        self._event_number = max((record.number for record in records), default=0)
        self._stored = [stored for item in records if (stored := self._sized(item))]
        self.flush()
        if self.event:  # which keeps them: complete files do not show an interruption
            for path in incomplete:
                self._complete_segment(path)

    @property
    def path(self) -> Path:
        return self._segments

    @property
    def problem(self) -> str:
        """Why messages or events are not kept, empty while they are."""
        return self._problem

    @property
    def events(self) -> int:
        """Completed events on the disk."""
        return len(self._stored)

    @property
    def event(self) -> str:
        """The id of the event under way, else an empty text."""
        event = self._event
        return event.id if event is not None else ""

    def trigger(self, reasons: Sequence[str]) -> None:
        """Begins or extends an event, if there is any reason; may be called from any thread."""
        if reasons and len(self._triggers) < _TRIGGERS_MAX:
            self._triggers.append(Trigger(at_s=self._system_s(), ros_s=self._ros_s(), reasons=tuple(reasons)))

    def write(self, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None:
        """See ``BagWriter.write``. The message is lost while nothing can be written."""
        if self._file is None:
            return
        try:
            self._file.write(topic, log_ns, publish_ns, data)
        except _FAILED as error:
            self._abandon(error)

    def flush(self) -> None:
        """Writes to the disk what has arrived, and does what is due."""
        now_s = self._steady_s()
        try:
            if self._file is not None:
                self._file.flush()
            room = self._keep_room(now_s)
            self._step(now_s)
            if self._file is None and room and now_s >= self._retry_at_s:
                self._open(now_s)
                self._problem = ""
        except _FAILED as error:
            self._abandon(error)

    def close(self) -> None:
        """Completes the files; an event under way ends here."""
        try:
            self._finish_file()
            self._window.closed(self._steady_s())
            if self._event is not None:
                self._end_event(EventState.INTERRUPTED)
        except _FAILED as error:
            self._abandon(error)

    def abandon(self) -> None:
        """Ends without completing anything; the next black box does it."""
        if self._file is not None:
            self._file.abandon()
            self._file = None

    # --- segments ----------------------------------------------------------------------------------------------------

    def _open(self, now_s: float, *, of_event: bool = True) -> None:
        """of_event: an event under way keeps the segment."""
        self._number += 1
        name = f"black_box_{self._number:06d}.mcap"
        path = self._segments / name
        try:
            self._file = BagFile(path, self._topics, self._definitions, self._form)
        except OSError:
            path.unlink(missing_ok=True)  # a part of a file would look like an interruption
            raise
        sync_folder(self._segments)
        self._window.opened(name, now_s)
        if self._event is not None and of_event:
            self._link(name, self._events / self._event.id)

    def _cut(self, now_s: float, *, of_event: bool) -> None:
        """The next segment begins before this one is complete, so that an interruption always leaves one incomplete."""
        ended = self._file
        try:
            self._open(now_s, of_event=of_event)
        finally:
            self._finish(ended)

    def _finish_file(self) -> None:
        file, self._file = self._file, None
        self._finish(file)

    def _finish(self, file: BagFile | None) -> None:
        if file is not None:
            file.finish(metadata_text([file.info()], self._topics))

    def _abandon(self, error: Exception) -> None:
        """Nothing more can be written: tries again later."""
        self.abandon()
        now_s = self._steady_s()
        self._window.closed(now_s)
        self._problem = f"{self._segments} cannot be written: {error}"
        self._retry_at_s = now_s + _RETRY_S

    def _link(self, name: str, event: Path) -> None:
        with suppress(FileExistsError, FileNotFoundError):  # deleted by others
            os.link(self._segments / name, event / name)
        sync_folder(event)

    # --- events ------------------------------------------------------------------------------------------------------

    def _step(self, now_s: float) -> None:
        refused = now_s < self._retry_at_s
        if self._event is not None and not (self._events / self._event.id).is_dir():
            self._event = None  # deleted by others
        if not (refused or self._window.in_event):
            self._end_event(EventState.COMPLETE)  # what has failed before
        triggers = list(self._triggers)
        step = self._window.step(now_s, 0 if self._file is None else self._file.size, bool(triggers))
        if step.cut:
            self._cut(now_s, of_event=not step.end)
        if step.end and not refused:
            self._end_event(EventState.COMPLETE)
        if triggers and not refused:
            self._note(triggers)
            for _ in triggers:
                self._triggers.popleft()
        for name in step.drop:
            (self._segments / name).unlink(missing_ok=True)

    def _note(self, triggers: list[Trigger]) -> None:
        """Begins the event with these triggers, or adds them. If this fails, a later step tries it again."""
        if self._event is None:
            self._event = self._begin_event(triggers)
        elif len(self._event.triggers) < _TRIGGERS_MAX:
            record = self._event.model_copy(update={"triggers": (*self._event.triggers, *triggers)})
            kept_events.write_record(self._events / record.id, record)
            self._event = record

    def _begin_event(self, triggers: list[Trigger]) -> EventRecord:
        record = EventRecord(
            id=self._new_id(triggers[0].at_s),
            number=self._event_number + 1,
            state=EventState.OPEN,
            triggers=tuple(triggers),
            software=self._provenance.software,
            map=self._provenance.map,
            nodes=self._provenance.nodes(),
        )
        folder = self._events / record.id
        folder.mkdir()
        try:
            # The record last: a folder without one is no event, and the next start deletes it.
            for name in self._window.segments:
                self._link(name, folder)
            (folder / kept_events.CONFIG_FILE).write_bytes(self._provenance.config)
            kept_events.write_record(folder, record)
            sync_folder(self._events)
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        self._event_number = record.number
        return record

    def _new_id(self, at_s: float) -> str:
        name = time.strftime("%Y%m%d-%H%M%S", time.gmtime(at_s))
        taken = {path.name for path in self._events.iterdir()}
        return next(chosen for n in range(1, 10**6) if (chosen := name if n == 1 else f"{name}-{n}") not in taken)

    def _end_event(self, state: EventState) -> None:
        event = self._event
        if event is not None:
            self._complete(event, state)
            self._event = None
            self._stored += [stored for stored in [self._sized(event)] if stored]

    def _complete(self, event: EventRecord, state: EventState) -> None:
        """Completes an event's files and its record. Raises OSError if the record cannot be written."""
        folder = self._events / event.id
        (folder / METADATA_FILE).unlink(missing_ok=True)  # made anew for all files
        self._recover(folder)
        kept_events.write_record(folder, event.model_copy(update={"state": state}))

    def _recover(self, folder: Path) -> None:
        try:
            self.notes += recover_folder(folder)
        except (InUse, *_FAILED) as error:
            self.notes.append(f"{folder}: cannot be completed: {error}")

    # --- an earlier black box ----------------------------------------------------------------------------------------

    def _last_number(self) -> int:
        names = [path.name for folder in (self._segments, *self._events.iterdir()) for path in folder.glob("*.mcap")]
        return max((int(match[1]) for name in names if (match := _NAME.fullmatch(name))), default=0)

    def _inherit(self) -> list[Path]:
        """Takes over the files of an earlier black box. Returns its incomplete segments, which an event is to keep."""
        now_s, system_s = self._steady_s(), self._system_s()
        incomplete = []
        for path in sorted(self._segments.glob("*.mcap"), key=lambda item: (len(item.name), item.name)):
            if not is_complete(path):
                incomplete.append(path)
            self._window.opened(path.name, now_s)
            # A set clock makes the age unknown; a segment is then as old as this process.
            self._window.closed(now_s - max(system_s - path.stat().st_mtime, 0.0))
        self._inherit_events(now_s)
        if incomplete and self._event is None:
            self.trigger((INTERRUPTED,))
        return incomplete

    def _complete_segment(self, path: Path) -> None:
        """Deletes a file that contains nothing."""
        if is_complete(path):  # by the event under way
            return
        try:
            self.notes.append(f"{path}: completed with {recover_file(path)} messages")
        except NotRecoverable as error:
            self.notes.append(str(error))
            for name in (path, self._events / self.event / path.name):
                name.unlink(missing_ok=True)
        except (InUse, *_FAILED) as error:
            self.notes.append(f"{path}: cannot be completed: {error}")

    def _inherit_events(self, now_s: float) -> None:
        """Goes on with an event that was under way. Deletes folders of interrupted deletions."""
        records = kept_events.read_events(self._events)
        for path in self._events.iterdir():
            if path.is_dir() and path.name not in {record.id for record in records}:
                kept_events.delete_event(path)
        under_way = [record for record in records if record.state is EventState.OPEN]
        for record in under_way[1:]:
            self._complete(record, EventState.INTERRUPTED)
        for record in under_way[:1]:
            self._recover(self._events / record.id)
            self._event = record
            self._window.begin_event(now_s)
            self.trigger((INTERRUPTED,))

    # --- room --------------------------------------------------------------------------------------------------------

    def _keep_room(self, now_s: float) -> bool:
        """Deletes old events; without room nevertheless, writing pauses. Returns True with room."""
        paused = self._file is None
        if now_s < self._retention_at_s and not paused:
            return True
        self._retention_at_s = now_s + _RETENTION_PERIOD_S
        params, missing = self._params, bytes_over(self._segments, self._params.max_disk_use)
        there = {path.name for path in self._events.iterdir()}
        self._stored = [event for event in self._stored if event.id in there]
        before_s = self._retention.before_s(self._system_s(), now_s)
        self._delete(to_delete(self._stored, before_s, params.retention_gb, missing))
        room = bytes_over(self._segments, params.max_disk_use) <= 0.0
        if not room:
            self._finish_file()
            self._window.closed(now_s)
            limit = f"limit max_disk_use {params.max_disk_use:.0%}"
            self._problem = (
                f"the disk of {self._segments} is full, {limit}, and deleting events does not give enough room"
            )
        return room

    def _delete(self, ids: Sequence[str]) -> None:
        for name in ids:
            with suppress(OSError):
                kept_events.delete_event(self._events / name)
        self._stored = [event for event in self._stored if event.id not in ids]

    def _sized(self, event: EventRecord) -> Stored | None:
        """None for the event under way and for one that has been deleted."""
        if self._event is not None and event.id == self._event.id:
            return None
        try:
            return Stored(event.id, event.number, event.at_s, kept_events.event_bytes(self._events / event.id))
        except OSError:
            return None
