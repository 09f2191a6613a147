"""The black box on a real disk: events as other tools read them, after a kill, and on a full disk."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import tarfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from robot_stack.contract import topics
from robot_stack.core import kept_events
from robot_stack.core.config import load
from robot_stack.core.kept_events import EventState, MapUsed, NodeSnapshot, Software, read_events
from robot_stack.recording import black_box_files
from robot_stack.recording.black_box import INTERRUPTED
from robot_stack.recording.black_box_files import BlackBox, Clocks, Provenance
from robot_stack.recording.opening import open_black_box
from robot_stack.recording.params import BlackBoxParams
from robot_stack.recording.provenance import provenance
from robot_stack.recording.recovery import is_complete
from robot_stack.recording.writer import topic_info
from tests.support.waiting import wait_for
from tests.unit.recording.test_recording_files import ROWS, status, waypoints

NODE = NodeSnapshot(name="safety_monitor", pid=7, ready=True, text="", silent_s=0.1)
KEPT = Provenance(Software(version="1", sha256="ab"), MapUsed(name="yard", sha256="cd"), b"archive", lambda: (NODE,))
EPOCH_S = 1_750_000_000.0
STEP_S = 0.5


class Rig:
    """A black box with a clock of its own that writes a numbered message every half a second."""

    def __init__(self, folder: Path, **changes: Any) -> None:
        self.folder, self.events = folder, folder / "events"
        self._changes = {"max_disk_use": 0.9, **changes}
        self.now_s = 0.0
        self.step_s = 0.0  # of the system clock
        self.number = 0
        self.box = self.make()

    def make(self) -> BlackBox:
        """Another black box on the same folder, as after a restart."""
        params = load(BlackBoxParams, "black_box", self._changes)
        # Files have the computer's time, from which the age of those of an earlier black box is known.
        clocks = Clocks(lambda: self.now_s, self.system_s, self.system_s)
        self.box = BlackBox(self.folder, [topic_info(row) for row in ROWS], params, KEPT, clocks)
        return self.box

    def system_s(self) -> float:
        return EPOCH_S + self.step_s + self.now_s

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            at_ns = round(1e9 * (EPOCH_S + self.now_s))
            self.box.write("/mission/status", at_ns, at_ns, status(self.number))
            self.number += 1
            self.now_s += STEP_S
            self.box.flush()

    def segments(self) -> list[str]:
        return sorted(path.name for path in (self.folder / "segments").iterdir())

    def numbers(self, event: str) -> list[int]:
        """The numbers of the messages in an event, as rosbags reads them."""
        return [int(name[1:]) for name in waypoints(self.events / event)]


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """The share of the disk in use, independent of the machine."""
    use = {"share": 0.5}
    monkeypatch.setattr("robot_stack.recording.background.disk_use", lambda folder: use["share"])
    return use


@pytest.fixture
def rig(tmp_path: Path, disk: dict[str, float]) -> Rig:
    return Rig(tmp_path / "box")


def test_an_event_is_a_recording_from_a_minute_before_to_ten_seconds_after(rig: Rig) -> None:
    rig.run(195.0)
    rig.box.trigger(())  # no reason, no event
    rig.run(5.0)
    assert len(rig.segments()) == 8, "the last minute and little more"
    assert read_events(rig.events) == []
    rig.box.trigger(("CONTACT", "EMERGENCY_STOP"))
    rig.run(100.0)
    (event,) = read_events(rig.events)
    assert event.state is EventState.COMPLETE
    assert event.reasons == ("CONTACT", "EMERGENCY_STOP")
    assert event.at_s == EPOCH_S + 200.0
    assert (event.software, event.map, event.nodes) == (KEPT.software, KEPT.map, (NODE,))
    assert (rig.events / event.id / kept_events.CONFIG_FILE).read_bytes() == b"archive"
    numbers = rig.numbers(event.id)
    assert numbers == list(range(numbers[0], numbers[-1] + 1)), "without a gap"
    assert numbers[0] <= (200.0 - 60.0) / STEP_S
    assert 210.0 / STEP_S <= numbers[-1] + 1 <= 212.0 / STEP_S


def test_triggers_close_together_are_one_event_and_later_ones_another(rig: Rig) -> None:
    rig.run(100.0)
    rig.box.trigger(("CONTACT",))
    rig.run(6.0)
    rig.box.trigger(("TILT",))
    rig.run(30.0)
    rig.box.trigger(("DRIVE_FAULT",))
    rig.run(30.0)
    late, early = read_events(rig.events)
    assert early.reasons == ("CONTACT", "TILT")
    assert [trigger.at_s - EPOCH_S for trigger in early.triggers] == [100.0, 106.0]
    assert rig.numbers(early.id)[-1] + 1 >= 116.0 / STEP_S
    assert late.reasons == ("DRIVE_FAULT",)
    assert rig.numbers(late.id)[0] <= (136.0 - 60.0) / STEP_S


def test_two_events_of_one_second_have_two_names(rig: Rig) -> None:
    rig.run(1.0)
    rig.box.trigger(("CONTACT",))
    rig.run(0.5)
    (event,) = read_events(rig.events)
    shutil.copytree(rig.events / event.id, rig.events / "19700101-000000")
    rig.run(15.0)
    rig.box._system_s = lambda: event.at_s
    rig.box.trigger(("TILT",))
    rig.run(0.5)
    assert f"{event.id}-2" in [item.id for item in read_events(rig.events)]


@pytest.mark.parametrize("refused", [False, True])
def test_a_chattering_fault_does_not_make_the_record_grow(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, refused: bool
) -> None:
    with monkeypatch.context() as full:
        if refused:
            full.setattr(kept_events, "write_record", Mock(side_effect=OSError(errno.ENOSPC, "No space left")))
        for _ in range(250):
            rig.box.trigger(("COLLISION_IMMINENT",))
            rig.run(0.5)
    rig.run(20.0)
    (event,) = read_events(rig.events)
    assert len(event.triggers) == 100
    assert rig.numbers(event.id)[-1] + 1 >= 135.0 / STEP_S, "the messages are kept to the end"


# --- ends of the black box -------------------------------------------------------------------------------------------


def test_an_ordered_end_leaves_nothing_to_complete_and_no_event(rig: Rig) -> None:
    rig.run(30.0)
    rig.box.close()
    assert all(is_complete(path) for path in (rig.folder / "segments").iterdir())
    rig.make()
    rig.run(30.0)
    assert rig.box.notes == []
    assert read_events(rig.events) == []


def test_an_ordered_end_during_an_event_completes_it(rig: Rig) -> None:
    rig.run(30.0)
    rig.box.trigger(("CONTACT",))
    rig.run(3.0)
    rig.box.close()
    (event,) = read_events(rig.events)
    assert event.state is EventState.INTERRUPTED
    assert rig.numbers(event.id) == list(range(66))


def test_an_interrupted_black_box_is_an_event_of_before_and_after(rig: Rig) -> None:
    rig.run(100.0)
    rig.box.abandon()
    rig.now_s += 5.0
    rig.make()
    rig.run(30.0)
    (event,) = read_events(rig.events)
    assert event.reasons == (INTERRUPTED,)
    assert event.state is EventState.COMPLETE
    numbers = rig.numbers(event.id)
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert numbers[0] <= 40.0 / STEP_S
    assert numbers[-1] >= 108.0 / STEP_S


def test_an_event_that_was_interrupted_goes_on(rig: Rig) -> None:
    rig.run(100.0)
    rig.box.trigger(("CONTACT",))
    rig.run(4.0)
    rig.box.abandon()
    (event,) = read_events(rig.events)
    assert event.state is EventState.OPEN
    rig.make()
    rig.run(30.0)
    (event,) = read_events(rig.events)
    assert event.state is EventState.COMPLETE
    assert event.reasons == ("CONTACT", INTERRUPTED)
    numbers = rig.numbers(event.id)
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert numbers[0] <= 40.0 / STEP_S
    assert numbers[-1] + 1 == 228, "to 10 s after the restart"


def test_an_interrupted_deletion_leaves_no_event(rig: Rig) -> None:
    rig.run(10.0)
    rig.box.trigger(("CONTACT",))
    rig.run(20.0)
    (event,) = read_events(rig.events)
    (rig.events / event.id / kept_events.RECORD_FILE).unlink()
    rig.box.close()
    rig.make()
    assert list(rig.events.iterdir()) == []


# Writes and triggers an event; prints the number of messages after each flush. No disk is full.
_WRITE_FOR_EVER = """
import sys, threading
from pathlib import Path
import robot_stack.recording.background as background
import tests.unit.recording.test_black_box_files as test
from robot_stack.recording.black_box_files import BlackBox
background.disk_use = lambda folder: 0.5
flush, write, written, turns = BlackBox.flush, BlackBox.write, [], threading.Semaphore(0)

def counted(box, *message):
    write(box, *message)
    written.append(message)

def reported(box):
    flush(box)
    print(len(written), flush=True)
    turns.release()

BlackBox.write, BlackBox.flush = counted, reported
box, writer = test.open_real(Path(sys.argv[1]))
for number in range(10**9):
    at_ns = round(1e9 * test.EPOCH_S) + number
    writer.add("/mission/status", at_ns, at_ns, test.status(number))
    if number == 60:
        box.trigger(("CONTACT",))
    if number % 10 == 0:
        turns.acquire()
"""


def open_real(folder: Path) -> Any:
    """The black box with its thread on the real clock, with small and short files."""
    import time

    changes = {"flush_period_s": 0.05, "segment_max_mb": 0.03, "chunk_size_kb": 2.0}
    params = load(BlackBoxParams, "black_box", changes)
    return open_black_box(folder, list(ROWS), params, KEPT, Clocks(time.monotonic, time.time, time.time))


def test_a_killed_process_keeps_what_was_flushed(tmp_path: Path, disk: dict[str, float]) -> None:
    command = [sys.executable, "-c", _WRITE_FOR_EVER, str(tmp_path / "box")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=os.getcwd())
    try:
        flushed = 0
        while flushed < 200:
            line = process.stdout.readline()
            assert line, "the process has ended"
            flushed = int(line)
    finally:
        process.send_signal(signal.SIGKILL)
        rest, _ = process.communicate(timeout=30)
    flushed = max([flushed, *map(int, rest.splitlines()[:-1])])
    segments = len(list((tmp_path / "box" / "segments").iterdir()))
    assert segments > 2, "several files, of which one is open"
    rig = Rig(tmp_path / "box")
    rig.run(15.0)
    (event,) = read_events(rig.events)
    assert event.state is EventState.COMPLETE
    assert event.reasons == ("CONTACT", INTERRUPTED)
    numbers = rig.numbers(event.id)
    # The new black box counts from 0, with later times.
    before = [number for position, number in enumerate(numbers) if number == position]
    assert before == list(range(len(before))), "without a gap from the first message"
    assert len(before) >= flushed


class Killed(BaseException):
    pass


class Killer:
    """Kills before the n-th change of files, counted from ``armed`` on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.left: int | None = None
        for name in ("fsync", "fdatasync"):  # a kill does not need them, and a busy disk takes long
            monkeypatch.setattr(os, name, lambda _: None)
        files = black_box_files
        for owner, names in {
            files: ("BagFile", "sync_folder", "recover_file", "recover_folder"),
            files.os: ("link",),
            files.BagFile: ("finish",),
            kept_events: ("write_record",),
        }.items():
            for name in names:
                monkeypatch.setattr(owner, name, self._counted(getattr(owner, name)))

    def _counted(self, function: Any) -> Any:
        def call(*args: Any, **named: Any) -> Any:
            if self.left is not None:
                self.left -= 1
                if self.left < 0:
                    raise Killed
            return function(*args, **named)

        return call

    def kills(self, at: int, action: Callable[[], object]) -> bool:
        """True if the action was killed before its change number ``at``."""
        self.left = at
        try:
            action()
        except Killed:
            return True
        finally:
            self.left = None
        return False


@pytest.mark.parametrize("when", ["running", "starting"])
def test_a_kill_before_any_change_of_the_files_loses_nothing(
    when: str, tmp_path: Path, disk: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With segments of 2 s, and events from 10 s before to 3 s after; the start is that after another kill."""
    killer, at, killed = Killer(monkeypatch), 0, True
    while killed:
        rig = Rig(tmp_path / str(at), before_s=10.0, after_s=3.0, segment_s=2.0)
        rig.run(14.0)
        if when == "running":
            rig.run(1.0)
            rig.box.trigger(("CONTACT",))
            killed = killer.kills(at, lambda rig=rig: rig.run(6.0))  # type: ignore[misc]
        else:
            rig.run(1.0)
            rig.box.abandon()
            killed = killer.kills(at, rig.make)
        rig.box.abandon()
        written = rig.number
        rig.make()
        rig.run(6.0)
        kept = {number for event in read_events(rig.events) for number in rig.numbers(event.id)}
        assert kept >= set(range(written - 20, written + 5)), at
        at += 1
    assert at > 5


# --- room ------------------------------------------------------------------------------------------------------------


def make_events(rig: Rig, count: int) -> list[str]:
    """Ids, the oldest first."""
    for _ in range(count):
        rig.box.trigger(("CONTACT",))
        rig.run(12.0)
    return [event.id for event in reversed(read_events(rig.events))]


def test_old_events_are_deleted_after_their_days(rig: Rig) -> None:
    old = make_events(rig, 2)
    rig.now_s += 29 * 86_400.0
    young = make_events(rig, 3)[2:]
    assert [event.id for event in reversed(read_events(rig.events))] == old + young
    rig.now_s += 2 * 86_400.0
    rig.run(11.0)
    assert [event.id for event in reversed(read_events(rig.events))] == young


def test_events_are_bounded_by_gigabytes(tmp_path: Path, disk: dict[str, float]) -> None:
    rig = Rig(tmp_path / "box", retention_gb=1e-3)
    ids = make_events(rig, 12)
    rig.run(11.0)
    left = [event.id for event in reversed(read_events(rig.events))]
    assert left == ids[-len(left) :]
    assert 0 < len(left) < 12
    assert sum(kept_events.event_bytes(rig.events / name) for name in left) <= 1e6


def test_a_clock_that_is_set_forward_deletes_no_events(rig: Rig) -> None:
    ids = make_events(rig, 2)
    rig.step_s = 40 * 86_400.0
    rig.run(22.0)
    assert [event.id for event in reversed(read_events(rig.events))] == ids


def test_an_event_of_a_clock_that_is_behind_is_the_newest(tmp_path: Path, disk: dict[str, float]) -> None:
    """Also after a restart."""
    rig = Rig(tmp_path / "box", retention_gb=1e-3)
    make_events(rig, 8)
    rig.box.close()
    rig.step_s = -365 * 86_400.0
    rig.make()
    late = []
    for _ in range(2):
        rig.box.trigger(("TILT",))
        rig.run(0.5)
        late.append(rig.box.event)
        rig.run(23.5)
    assert [event.id for event in reversed(read_events(rig.events))][-2:] == late


def test_a_full_disk_takes_the_oldest_events(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    ids = make_events(rig, 3)
    size = kept_events.event_bytes(rig.events / ids[0])
    missing = [size + 1.0, size + 1.0, -1.0]  # before and after the deletion
    monkeypatch.setattr(
        "robot_stack.recording.black_box_files.bytes_over", lambda *_: missing.pop(0) if missing[1:] else missing[0]
    )
    rig.run(11.0)
    assert [event.id for event in read_events(rig.events)] == ids[2:]


def test_a_disk_filled_by_others_pauses_the_black_box_until_there_is_room(rig: Rig, disk: dict[str, float]) -> None:
    ids = make_events(rig, 3)
    disk["share"] = 0.95
    rig.run(11.0)
    assert "full, limit max_disk_use 90%" in rig.box.problem
    rig.run(70.0)
    assert rig.segments() == [], "all have become old"
    assert len(read_events(rig.events)) == 3
    disk["share"] = 0.5
    rig.run(20.0)
    assert rig.box.problem == ""
    assert rig.numbers(make_events(rig, 1)[-1])
    assert [event.id for event in reversed(read_events(rig.events))][:3] == ids


def test_an_event_on_a_full_disk_is_recorded_without_messages(rig: Rig, disk: dict[str, float]) -> None:
    rig.run(30.0)
    disk["share"] = 0.95
    rig.run(11.0)
    rig.box.trigger(("CONTACT",))
    rig.run(2.0)
    (event,) = read_events(rig.events)
    assert event.reasons == ("CONTACT",)
    rig.run(20.0)
    (event,) = read_events(rig.events)
    assert event.state is EventState.COMPLETE
    assert rig.numbers(event.id)[0] == 0, "what was written before"


def test_the_event_under_way_is_never_deleted(rig: Rig, disk: dict[str, float]) -> None:
    rig.box.trigger(("TILT",))
    rig.run(1.0)
    rig.now_s += 8.0
    disk["share"] = 0.95
    rig.run(1.0)
    assert [event.reasons for event in read_events(rig.events)] == [("TILT",)]


def test_an_event_deleted_by_somebody_else_counts_no_longer(rig: Rig) -> None:
    ids = make_events(rig, 2)
    kept_events.delete_event(rig.events / ids[0])
    rig.run(11.0)
    assert rig.box.events == 1


@pytest.mark.parametrize("refused_after_s", [0.0, 5.0], ids=["begin", "end"])
def test_a_refused_record_is_tried_again_every_five_seconds_and_costs_no_other_event(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, refused_after_s: float
) -> None:
    ids = make_events(rig, 3)
    rig.box.trigger(("TILT",))
    rig.run(refused_after_s)
    begun = {path.name for path in rig.events.iterdir()}
    tries = []

    def refuse(folder: Path, record: kept_events.EventRecord) -> None:
        tries.append(rig.now_s)
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(kept_events, "write_record", refuse)
        rig.run(20.0)
    assert len(tries) > 1
    assert all(late - early >= 5.0 for early, late in pairwise(tries))
    assert {path.name for path in rig.events.iterdir()} == begun
    rig.run(20.0)
    events = list(reversed(read_events(rig.events)))
    assert [event.id for event in events[:3]] == ids
    assert [(event.reasons, event.state) for event in events[3:]] == [(("TILT",), EventState.COMPLETE)]


def test_an_event_whose_folder_is_removed_is_dropped(rig: Rig) -> None:
    rig.box.trigger(("CONTACT",))
    rig.run(5.0)
    shutil.rmtree(rig.events / rig.box.event)
    rig.run(20.0)
    assert (rig.box.problem, rig.box.event) == ("", "")
    rig.box.trigger(("TILT",))
    rig.run(20.0)
    (event,) = read_events(rig.events)
    assert (event.reasons, event.state) == (("TILT",), EventState.COMPLETE)
    assert rig.numbers(event.id) == list(range(71))


_REFUSED = """
import resource, sys
from pathlib import Path
import robot_stack.recording.background as background
import tests.unit.recording.test_black_box_files as test
background.disk_use = lambda folder: 0.5
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
rig = test.Rig(Path(sys.argv[1]), segment_s=60.0)
problems = set()
for _ in range(400):
    rig.run(0.5)
    problems.add(rig.box.problem)
rig.box.trigger(("CONTACT",))
rig.run(12.0)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
rig.run(12.0)
print(len(problems), [event.state.value for event in test.read_events(rig.events)], rig.box.problem)
"""


def test_refused_writes_are_reported_and_writing_goes_on(tmp_path: Path) -> None:
    """The operating system really refuses to extend the files."""
    command = [sys.executable, "-c", _REFUSED, str(tmp_path / "box")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=os.getcwd(), check=False)
    assert done.returncode == 0, done.stderr
    kinds, rest = done.stdout.split(" ", 1)
    assert int(kinds) > 1
    assert rest.strip() == "['complete']"


def test_a_segment_that_cannot_be_begun_leaves_no_file(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise the next black box would find an interruption after an ordered end."""

    def refuse(_: object, path: Path, *__: object) -> None:
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    rig.run(5.0)
    with monkeypatch.context() as full:
        full.setattr(black_box_files.BagFile, "__init__", refuse)
        rig.run(12.0)
    rig.run(6.0)
    rig.box.close()
    rig.make()
    assert (rig.box.notes, read_events(rig.events)) == ([], [])


# --- what an event contains ------------------------------------------------------------------------------------------


def test_provenance_names_software_map_configuration_and_nodes(tmp_path: Path) -> None:
    kept = provenance("yard", lambda: 0.0)
    assert len(kept.software.sha256) == 64
    assert (kept.map.name, len(kept.map.sha256)) == ("yard", 64)
    (tmp_path / "config.tar.gz").write_bytes(kept.config)
    with tarfile.open(tmp_path / "config.tar.gz") as archive:
        names = archive.getnames()
    assert {"config/robot.yaml", "config/black_box.yaml", "config/maps/yard/map.yaml"} <= set(names)
    assert provenance("", lambda: 0.0).map is None


def test_every_row_has_a_definition(tmp_path: Path, disk: dict[str, float]) -> None:
    params = load(BlackBoxParams, "black_box")
    box = BlackBox(
        tmp_path / "box", [topic_info(row) for row in topics.TOPICS if row.system.value != "wmx"], params, KEPT,
        Clocks(lambda: 0.0, lambda: 0.0, lambda: 0.0),
    )  # fmt: skip
    box.close()
    wait_for(lambda: all(is_complete(path) for path in (tmp_path / "box" / "segments").iterdir()), "complete files")
