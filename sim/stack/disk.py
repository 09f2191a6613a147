"""The disk of the robot's computer on the scheduler: the files that survive a process, and faults of their writes.

Covered: the safety latch, docking's record of an attached wheelchair, the mission journal. Files are real; a fault
makes their writes fail, late, or end in the middle. Reads never fail.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from robot_stack.core.worker import Worker
from robot_stack.docking.nodes.attached_file import AttachedFile
from robot_stack.mission.journal import SqliteJournal
from robot_stack.mission.perform import JournalError
from robot_stack.mission.record import Record as MissionRecord
from robot_stack.safety.latch_store import COPIES, LatchStore, Record, encode
from sim.scheduler.events import NANOSECONDS
from sim.scheduler.port import SimPort
from sim.scheduler.scheduler import Scheduler

T = TypeVar("T")

LATCH, ATTACHED, JOURNAL = "latch", "attached", "journal"
FILES = (LATCH, ATTACHED, JOURNAL)
_NO_SPACE, _BROKEN = os.strerror(errno.ENOSPC), os.strerror(errno.EIO)


@dataclass(slots=True)
class ScheduledDisk:
    """full: new blocks are refused. broken: every write is refused. slow_s: additional time of a worker's write.

    torn: the file whose next write ends after ``torn_bytes`` by a loss of power.
    """

    full: bool = False
    broken: bool = False
    slow_s: float = 0.0
    torn: str = ""
    torn_bytes: int = 0

    def register(
        self, devices: dict[Any, Callable[..., Any]], scheduler: Scheduler, lose_power: Callable[[], object]
    ) -> None:
        """lose_power: called when a torn write has ended, in an event of its own."""

        def power_goes() -> None:
            scheduler.at(scheduler.now_ns, lose_power)

        devices[LatchStore] = lambda port, folder, shadow, witness, slow_s, worker, now_s: _Latch(
            folder, shadow, witness, slow_s, _DiskWorker(self, port, worker), now_s, self, power_goes
        )
        devices[AttachedFile] = lambda port: _Attached(self, power_goes)
        devices[SqliteJournal] = lambda port, path: _Journal(path, self, power_goes)

    def problem(self, *, in_place: bool) -> str:
        """Why a write fails, else an empty text. in_place: into blocks that the file already has."""
        if self.broken:
            return _BROKEN
        return _NO_SPACE if self.full and not in_place else ""

    def tears(self, file: str) -> bool:
        """True once, for the torn write."""
        if self.torn != file:
            return False
        self.torn = ""
        return True


class _DiskWorker:
    """See ``Worker``. Jobs of a slow disk begin later, which delays their results."""

    def __init__(self, disk: ScheduledDisk, port: SimPort, worker: Worker) -> None:
        self._disk, self._port, self._worker = disk, port, worker

    def submit(self, job: Callable[[], T], done: Callable[[T], None]) -> None:
        if self._disk.slow_s <= 0.0:
            self._worker.submit(job, done)
            return
        events = self._port.life.events
        at_ns = events.now_ns + round(self._disk.slow_s * NANOSECONDS)
        events.push(at_ns, self._port.order, lambda: self._worker.submit(job, done))

    def close(self, timeout_s: float) -> None:
        self._worker.close(timeout_s)


class _Latch(LatchStore):
    def __init__(
        self,
        folder: Path,
        shadow: Path,
        witness: Path,
        slow_s: float,
        worker: Worker,
        now_s: Callable[[], float],
        disk: ScheduledDisk,
        power_goes: Callable[[], None],
    ) -> None:
        super().__init__(folder, shadow, witness, slow_s, worker, now_s)
        self._first, self._disk, self._power_goes = folder / COPIES[0], disk, power_goes

    def _write(self, record: Record) -> str:
        in_place = self._first.exists()
        problem = self._disk.problem(in_place=in_place)
        if problem:
            return problem
        if in_place and self._disk.tears(LATCH):
            with open(self._first, "r+b") as file:
                file.write(encode(record)[: self._disk.torn_bytes])
            self._power_goes()
            return _BROKEN
        return super()._write(record)


class _Attached(AttachedFile):
    def __init__(self, disk: ScheduledDisk, power_goes: Callable[[], None]) -> None:
        super().__init__()
        self._disk, self._power_goes = disk, power_goes

    def _write(self, text: str) -> str:
        problem = self._disk.problem(in_place=False)
        if self._disk.tears(ATTACHED):  # the draft is torn, and the file stays as it was
            self._power_goes()
            problem = _BROKEN
        return problem or super()._write(text)


class _Journal(SqliteJournal):
    """A torn write loses the transaction, as SQLite does with a frame of its log whose checksum is wrong."""

    def __init__(self, path: Path, disk: ScheduledDisk, power_goes: Callable[[], None]) -> None:
        super().__init__(path)
        self._disk, self._power_goes = disk, power_goes

    def save(self, record: MissionRecord) -> None:
        problem = self._disk.problem(in_place=False)
        if self._disk.tears(JOURNAL):
            self._power_goes()
            problem = _BROKEN
        if problem:
            raise JournalError(f"{self.path}: {problem}")
        super().save(record)
