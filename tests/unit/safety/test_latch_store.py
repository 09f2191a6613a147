"""The latch on file: it survives what ends the monitor, and is an emergency stop where nobody can tell what it was."""

from __future__ import annotations

import json
import os
import shutil
import stat
import threading
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from robot_stack.ros.workers import ThreadWorker
from robot_stack.safety import latch_store
from robot_stack.safety.latch_store import COPIES, UNKNOWN_PAST, LatchStore, Record, decode, encode
from robot_stack.safety.monitor import Memory
from robot_stack.safety.stop_sources import Press
from tests.support.waiting import wait_for

LATCHED = Memory(("ESTOP_PRESSED", "TILT"), True, (Press("touch_ui", 17), Press("unknown", 0)))


class Disk:
    """A state folder and a runtime folder, and stores that come and go."""

    def __init__(self, tmp_path: Path) -> None:
        self.folder, self.shadow = tmp_path / "state" / "safety", tmp_path / "run" / "safety_latch"
        self.shadow.parent.mkdir()
        self._open: list[LatchStore] = []

    def store(self, slow_s: float = 60.0) -> LatchStore:
        store = LatchStore(
            self.folder, self.shadow, slow_s, ThreadWorker("latch", lambda deliver: deliver()), time.monotonic
        )
        self._open.append(store)
        return store

    def load(self) -> Memory:
        return self.store().load()

    def saved(self, *memories: Memory) -> LatchStore:
        """A store that has written these, one after the other, to the disk."""
        store = self.store()
        store.load()
        for memory in memories:
            store.save(memory)
            wait_for(lambda memory=memory: self.copies() == [memory, memory], "both copies")
        return store

    def copies(self) -> list[Memory | None]:
        return [_read(self.folder / name) for name in COPIES]

    def close(self) -> None:
        for store in self._open:
            store.close()


def _read(path: Path) -> Memory | None:
    try:
        return decode(path.read_bytes()).memory
    except (OSError, ValueError):
        return None


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    disk = Disk(tmp_path)
    yield disk
    disk.close()


@pytest.mark.parametrize("memory", [Memory(), LATCHED, Memory(("DRIVE_FAULT",), False), Memory((), True)])
def test_round_trip(disk: Disk, memory: Memory) -> None:
    disk.saved(memory)
    assert disk.load() == memory


def test_the_first_start_ever_knows_of_nothing_and_leaves_both_copies(disk: Disk) -> None:
    store = disk.store()
    assert store.load() == Memory()
    store.save(Memory())
    wait_for(lambda: disk.copies() == [Memory(), Memory()], "both copies")
    assert not disk.folder.with_name("safety.new").exists()


def test_only_what_is_new_is_saved_again(disk: Disk) -> None:
    store = disk.store()
    store.save(LATCHED)
    disk.shadow.unlink()
    store.save_if_new(LATCHED)
    assert not disk.shadow.exists()
    store.save_if_new(Memory())
    assert disk.load() == Memory()


def test_the_first_memory_is_new_whatever_is_stored(disk: Disk) -> None:
    disk.saved(LATCHED)
    disk.shadow.unlink()
    disk.store().save_if_new(LATCHED)
    assert disk.shadow.exists()


def test_an_unknown_past_is_an_emergency_with_a_passenger() -> None:
    assert Memory(("ESTOP_PRESSED",), True) == UNKNOWN_PAST


def test_a_logout_that_clears_the_memory_forgets_nothing(disk: Disk) -> None:
    disk.saved(LATCHED)
    shutil.rmtree(disk.shadow.parent)
    assert disk.load() == LATCHED


def test_a_crash_before_the_disk_has_it_forgets_nothing(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.saved(Memory())
    monkeypatch.setattr(latch_store, "_write_through", _full)
    store.save(LATCHED)
    assert disk.load() == LATCHED
    assert disk.copies() == [Memory(), Memory()]


@pytest.mark.parametrize("name", COPIES)
def test_one_copy_that_is_gone_takes_nothing_away(disk: Disk, name: str) -> None:
    disk.saved(LATCHED)
    disk.shadow.unlink()
    (disk.folder / name).unlink()
    assert disk.load() == LATCHED


@pytest.mark.parametrize("name", COPIES)
def test_one_copy_that_broke_while_it_was_written_is_a_stop(disk: Disk, name: str) -> None:
    disk.saved(Memory((), True))
    disk.shadow.unlink()
    (disk.folder / name).write_bytes(b"{" * 100)
    assert disk.load() == Memory(("ESTOP_PRESSED",), True)


def test_a_broken_copy_adds_no_second_stop(disk: Disk) -> None:
    disk.saved(LATCHED)
    (disk.folder / COPIES[0]).write_bytes(b"")
    assert disk.load() == LATCHED


def test_the_newest_of_several_counts(disk: Disk) -> None:
    disk.saved(Memory(), LATCHED)
    (disk.folder / COPIES[0]).write_bytes(encode(Record(1, Memory())))
    assert disk.load() == LATCHED
    disk.shadow.unlink()
    assert disk.load() == LATCHED


def test_a_store_goes_on_counting_where_the_last_one_ended(disk: Disk) -> None:
    disk.saved(LATCHED, Memory())
    disk.saved(Memory((), True))
    assert decode((disk.folder / COPIES[0]).read_bytes()).generation == 3


@pytest.mark.parametrize("broken", ["gone", "nonsense", "unreadable"])
def test_nothing_readable_where_there_should_be_something_is_an_unknown_past(disk: Disk, broken: str) -> None:
    disk.saved(Memory())
    disk.shadow.unlink()
    for name in COPIES:
        (disk.folder / name).unlink()
        if broken == "nonsense":
            (disk.folder / name).write_bytes(b"\xff\xfe\x80")
        elif broken == "unreadable":
            (disk.folder / name).mkdir()
    assert disk.load() == UNKNOWN_PAST


def test_a_state_folder_that_is_lost_while_the_memory_is_there_is_no_first_start(disk: Disk) -> None:
    disk.saved(LATCHED)
    shutil.rmtree(disk.folder)
    assert disk.load() == LATCHED
    disk.shadow.write_bytes(b"")
    assert disk.load() == UNKNOWN_PAST


def test_a_folder_that_nobody_may_look_into_is_no_first_start(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> Any:
        raise PermissionError("no")

    monkeypatch.setattr(Path, "lstat", refuse)
    assert disk.load() == UNKNOWN_PAST


GOOD = {"generation": 1, "latched": ["TILT"], "passenger": False, "presses": []}


@pytest.mark.parametrize(
    "changes",
    [
        {"generation": "1"},
        {"latched": "TILT"},
        {"latched": None},
        {"latched": ["NO_SUCH_FAULT"]},
        {"latched": [["TILT"]]},
        {"passenger": 0},
        {"passenger": None},
        {"presses": [["a"]]},
        {"presses": [[1, 2]]},
        {"presses": [["a", "b"]]},
        {"presses": None},
    ],
)
def test_what_makes_no_sense_is_no_record(changes: dict[str, Any]) -> None:
    assert decode(_signed(GOOD)).memory == Memory(("TILT",))
    with pytest.raises(ValueError, match="sense"):
        decode(_signed({**GOOD, **changes}))


def test_it_is_said_what_is_wrong_with_a_record() -> None:
    body, checksum, _ = _signed(GOOD).split(b"\n", 2)
    with pytest.raises(ValueError, match=r"^the checksum is wrong$"):
        decode(body + b" \n" + checksum + b"\n")
    with pytest.raises(ValueError, match=r"\('wrong types'\)$"):
        decode(_signed({**GOOD, "generation": "1"}))
    with pytest.raises(ValueError, match=r"\('wrong values'\)$"):
        decode(_signed({**GOOD, "passenger": 0}))


def test_what_a_longer_record_has_left_behind_a_shorter_one_is_not_read() -> None:
    """The power went after the write and before the file was cut."""
    many = Memory(presses=tuple(Press(f"source {index}", index) for index in range(300)))
    short = encode(Record(2, LATCHED))
    left = encode(Record(1, many))[len(short) :]
    assert b"\n" in left
    assert decode(short + left) == Record(2, LATCHED)


def test_a_record_that_lacks_something_is_none() -> None:
    for name in GOOD:
        with pytest.raises(ValueError, match="sense"):
            decode(_signed({key: value for key, value in GOOD.items() if key != name}))
    with pytest.raises(ValueError, match="sense"):
        decode(_signed([]))


def test_every_changed_byte_shows() -> None:
    data = encode(Record(3, LATCHED))
    used = len(data.rstrip())
    for index in range(used):
        broken = bytearray(data)
        broken[index] ^= 1
        try:
            assert decode(bytes(broken)) == Record(3, LATCHED), f"byte {index}"  # another way to write the checksum
        except ValueError:
            continue
    for end in range(used):
        with pytest.raises(ValueError):  # noqa: PT011 - whatever is wrong with it
            decode(data[:end])


def test_a_record_fills_whole_blocks() -> None:
    assert len(encode(Record(1, Memory()))) == 4096
    many = Memory(presses=tuple(Press(f"source {index}", index) for index in range(300)))
    assert len(encode(Record(1, many))) % 4096 == 0
    assert decode(encode(Record(1, many))).memory == many


def test_a_shorter_record_overwrites_a_longer_one(disk: Disk) -> None:
    many = Memory(presses=tuple(Press(f"source {index}", index) for index in range(300)))
    disk.saved(many, Memory())
    assert (disk.folder / COPIES[0]).stat().st_size == 4096


def _signed(data: Any) -> bytes:
    body = json.dumps(data).encode()
    return body + b"\n%08x\n" % zlib.crc32(body)


def _full(*_: Any) -> None:
    raise OSError(28, "No space left on device")


def test_a_disk_that_takes_nothing_is_told_until_it_does(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.saved(Memory())
    assert store.problem() == ""
    with monkeypatch.context() as patch:
        patch.setattr(latch_store, "_write_through", _full)
        store.save(LATCHED)
        wait_for(lambda: "No space left" in store.problem(), "the problem")
    wait_for(lambda: store.problem() == "" and disk.copies() == [LATCHED, LATCHED], "another try")


class Clock:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s


@dataclass
class HangingDisk:
    """Takes nothing before ``back`` is set."""

    back: threading.Event
    reached: threading.Event

    def write(self, *_: Any) -> None:
        self.reached.set()
        self.back.wait(60.0)


@pytest.fixture
def hanging(monkeypatch: pytest.MonkeyPatch) -> Iterator[HangingDisk]:
    disk = HangingDisk(threading.Event(), threading.Event())
    monkeypatch.setattr(latch_store.LatchStore, "_make_folder", disk.write)
    yield disk
    disk.back.set()


def test_a_disk_that_hangs_is_told(disk: Disk, hanging: HangingDisk) -> None:
    store = disk.store(slow_s=0.05)
    store.save(LATCHED)
    wait_for(lambda: hanging.reached.is_set() and "not written for" in store.problem(), "the problem")
    hanging.back.set()
    wait_for(lambda: store.problem() == "", "its end")


def test_a_slow_disk_is_told_from_when_the_first_record_waits(
    disk: Disk, hanging: HangingDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(latch_store, "time", clock)
    store = disk.store(slow_s=30.0)
    assert store.problem() == ""
    store.save(LATCHED)
    assert store.problem() == ""
    clock.now_s = 1020.0
    store.save(Memory())
    clock.now_s = 1030.0
    assert store.problem() == ""
    clock.now_s = 1031.0
    assert store.problem() == "not written for 31 s"
    hanging.back.set()
    wait_for(lambda: store.problem() == "", "its end")
    clock.now_s = 5000.0
    assert store.problem() == ""


def test_a_disk_that_hangs_keeps_nobody_from_ending(
    disk: Disk, hanging: HangingDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(latch_store, "_END_S", 0.05)
    store = disk.store()
    store.save(LATCHED)
    assert hanging.reached.wait(60.0)
    store.close()
    assert store._thread.is_alive()
    assert store._thread.daemon, "an interpreter that ends would wait for it"
    assert store._thread.name == "latch"


def test_what_comes_during_a_write_is_written_at_once(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latch_store, "_RETRY_S", 600.0)
    store = disk.saved(Memory())
    real = latch_store._write_through

    def another(path: Path, data: bytes) -> None:
        monkeypatch.setattr(latch_store, "_write_through", real)
        real(path, data)
        store.save(LATCHED)

    monkeypatch.setattr(latch_store, "_write_through", another)
    store.save(Memory((), True))
    wait_for(lambda: disk.copies() == [LATCHED, LATCHED], "both copies")


def test_a_disk_that_takes_nothing_is_left_alone_for_a_while(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latch_store, "_write_through", _full)
    store, waits = disk.store(), []
    real = store._wake.wait

    def wait(timeout_s: float | None = None) -> bool:
        waits.append(timeout_s)
        return real(timeout_s)

    monkeypatch.setattr(store._wake, "wait", wait)
    store.save(LATCHED)
    wait_for(lambda: latch_store._RETRY_S in waits, "a pause")


def test_a_first_start_that_was_cut_off_is_begun_again(disk: Disk) -> None:
    beside = disk.folder.with_name("safety.new")
    beside.mkdir(parents=True)
    (beside / COPIES[0]).write_bytes(b"half")
    assert disk.load() == Memory()
    disk.saved(LATCHED)
    assert not beside.exists()


def test_nobody_else_may_read_or_write_the_latch(disk: Disk) -> None:
    before = os.umask(0)
    try:
        disk.saved(LATCHED)
    finally:
        os.umask(before)
    assert stat.S_IMODE(disk.folder.stat().st_mode) == 0o700
    assert [stat.S_IMODE((disk.folder / name).stat().st_mode) for name in COPIES] == [0o600] * 2


def test_a_new_copy_s_name_is_on_the_disk_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append(os.fstat(descriptor).st_ino))
    copy = tmp_path / "copy"
    latch_store._write_through(copy, b"data")
    assert synced == [copy.stat().st_ino, tmp_path.stat().st_ino]


def test_a_file_system_that_syncs_no_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def files_only(descriptor: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(22, "Invalid argument")

    monkeypatch.setattr(os, "fsync", files_only)
    latch_store._write_through(tmp_path / "copy", b"data")
    assert (tmp_path / "copy").read_bytes() == b"data"


def test_a_runtime_folder_that_takes_nothing_is_told(disk: Disk) -> None:
    shutil.rmtree(disk.shadow.parent)
    store = disk.saved(LATCHED)
    assert "safety_latch" in store.problem()
    disk.shadow.parent.mkdir()
    store.save(Memory())
    wait_for(lambda: store.problem() == "", "the end of the problem")


def test_half_a_write_is_a_failed_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "pwrite", lambda *_: 7)
    with pytest.raises(OSError, match="only 7 of 4096 bytes"):
        latch_store._write_through(tmp_path / "copy", encode(Record(1, Memory())))


def test_a_copy_is_overwritten_in_place_and_to_the_disk(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk has no room for a second file, and what is not on the disk does not survive a power cut."""
    store = disk.saved(Memory())
    inodes = [(disk.folder / name).stat().st_ino for name in COPIES]
    synced: list[int] = []
    real = os.fsync
    monkeypatch.setattr(os, "fsync", lambda descriptor: (synced.append(os.fstat(descriptor).st_ino), real(descriptor)))
    store.save(LATCHED)
    wait_for(lambda: disk.copies() == [LATCHED, LATCHED] and store.problem() == "", "both copies")
    wait_for(lambda: len(synced) >= 2, "both on the disk")
    assert synced == inodes == [(disk.folder / name).stat().st_ino for name in COPIES]


def test_the_last_word_is_written_at_the_end(disk: Disk) -> None:
    store = disk.store()
    for _ in range(20):
        store.save(LATCHED)
    store.save(Memory((), True))
    store.close()
    assert disk.copies() == [Memory((), True)] * 2


def test_a_disk_that_takes_nothing_keeps_nobody_from_ending(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latch_store, "_write_through", _full)
    store = disk.store()
    store.save(LATCHED)
    wait_for(lambda: store.problem() != "", "the problem")
    store.close()
    assert not store._thread.is_alive()
