"""Disk faults under the files that outlive a process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robot_stack.docking.nodes.attached_file import AttachedFile
from robot_stack.mission.journal import SqliteJournal
from robot_stack.mission.perform import JournalError
from robot_stack.mission.record import Record
from robot_stack.safety.latch_store import LatchStore
from robot_stack.safety.monitor import ESTOP_PRESSED, Memory
from sim.scheduler import Scheduler
from sim.stack.disk import ATTACHED, JOURNAL, LATCH, ScheduledDisk
from tests.unit.scheduler.rig import params

_STOPPED = Memory((ESTOP_PRESSED,), passenger=True)


class Prompt:
    """A worker that executes jobs at once."""

    def submit(self, job: Callable[[], Any], done: Callable[[Any], None]) -> None:
        done(job())

    def close(self, timeout_s: float) -> None:
        """No thread to end."""


class Stage:
    def __init__(self, folder: Path) -> None:
        self.folder, self.disk, self.lost = folder, ScheduledDisk(), 0
        self.scheduler = Scheduler(1, params())
        self.devices: dict[Any, Callable[..., Any]] = {}
        self.disk.register(self.devices, self.scheduler, self._lose)

    def _lose(self) -> None:
        self.lost += 1

    def latch(self) -> LatchStore:
        store: LatchStore = self.devices[LatchStore](
            None, self.folder / "safety", self.folder / "shadow", self.folder / "witness", 2.0, Prompt(), lambda: 0.0
        )
        return store


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stage:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return Stage(tmp_path)


def test_a_broken_disk_is_reported_and_a_full_one_takes_no_new_file(stage: Stage) -> None:
    stage.disk.full = True
    latch = stage.latch()
    latch.save(Memory())
    assert "No space" in latch.problem()
    stage.disk.full = False
    latch.save(Memory())
    stage.disk.full = True
    latch.save(_STOPPED)  # in place
    assert not latch.problem()
    stage.disk.broken = True
    latch.save(Memory())
    assert "Input/output" in latch.problem()


def test_a_torn_latch_counts_as_a_stop(stage: Stage) -> None:
    latch = stage.latch()
    latch.save(Memory())
    stage.disk.torn, stage.disk.torn_bytes = LATCH, 20
    latch.save(Memory(passenger=True))
    stage.scheduler.run(0.1)
    assert stage.lost == 1
    (stage.folder / "shadow").unlink()  # was in memory
    assert ESTOP_PRESSED in stage.latch().load().latched


def test_a_torn_record_of_the_chair_leaves_the_one_before(stage: Stage) -> None:
    def attached() -> AttachedFile:
        file: AttachedFile = stage.devices[AttachedFile](None)
        return file

    file = attached()
    assert not file.save(True)
    stage.disk.torn = ATTACHED
    assert "cannot be written" in file.save(False)
    stage.scheduler.run(0.1)
    assert stage.lost == 1
    assert attached().load()
    stage.disk.full = True
    assert "No space" in file.save(False)


def test_a_torn_transaction_is_lost_and_the_journal_is_not(stage: Stage) -> None:
    path = stage.folder / "journal.db"
    journal: SqliteJournal = stage.devices[SqliteJournal](None, path)
    before, after = Record(reason="before"), Record(reason="after")
    journal.save(before)
    stage.disk.torn = JOURNAL
    with pytest.raises(JournalError):
        journal.save(after)
    stage.scheduler.run(0.1)
    assert stage.lost == 1
    assert SqliteJournal(path).load() == before
    stage.disk.full = True
    with pytest.raises(JournalError, match="No space"):
        journal.save(after)
