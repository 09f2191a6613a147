"""The latch on disk: it survives the end of the monitor. A state that cannot be read counts as an emergency stop."""

from __future__ import annotations

import json
import os
import shutil
import stat
import zlib
from pathlib import Path
from typing import Any

import pytest

from robot_stack.safety import latch_store
from robot_stack.safety.latch_store import COPIES, UNKNOWN_PAST, LatchStore, Record, decode, encode
from robot_stack.safety.monitor import Memory
from robot_stack.safety.stop_sources import Press
from tests.support.stepped_worker import SteppedWorker

LATCHED = Memory(("ESTOP_PRESSED", "TILT"), True, (Press("touch_ui", 17), Press("unknown", 0)))


class Disk:
    """A state folder, a runtime folder, a clock, and the worker of the store that was opened last."""

    def __init__(self, tmp_path: Path) -> None:
        self.folder, self.shadow = tmp_path / "state" / "safety", tmp_path / "run" / "safety_latch"
        self.witness = tmp_path / "state.latch"
        self.shadow.parent.mkdir(mode=0o700)
        self.now_s = 1000.0
        self.worker = SteppedWorker()

    def store(self, slow_s: float = 60.0) -> LatchStore:
        self.worker = SteppedWorker()
        return LatchStore(self.folder, self.shadow, self.witness, slow_s, self.worker, lambda: self.now_s)

    def load(self) -> Memory:
        return self.store().load()

    def saved(self, *memories: Memory) -> LatchStore:
        """A store that has written these states to the disk in order."""
        store = self.store()
        store.load()
        for memory in memories:
            store.save(memory)
            self.worker.finish()
        return store

    def copies(self) -> list[Memory | None]:
        return [_read(self.folder / name) for name in COPIES]


def _read(path: Path) -> Memory | None:
    try:
        return decode(path.read_bytes()).memory
    except (OSError, ValueError):
        return None


@pytest.fixture
def disk(tmp_path: Path) -> Disk:
    return Disk(tmp_path)


def test_first_start_has_an_empty_memory_and_writes_both_copies(disk: Disk) -> None:
    store = disk.store()
    assert store.load() == Memory()
    store.save(Memory())
    disk.worker.finish()
    assert disk.copies() == [Memory(), Memory()]
    assert not disk.folder.with_name("safety.new").exists()
    assert disk.witness.read_bytes() == b""


def test_only_the_first_and_a_changed_memory_are_saved(disk: Disk) -> None:
    disk.saved(LATCHED)
    store = disk.store()
    disk.shadow.unlink()
    store.save_if_new(LATCHED)
    assert disk.shadow.exists()
    disk.shadow.unlink()
    store.save_if_new(LATCHED)
    assert not disk.shadow.exists()
    store.save_if_new(Memory((), True))
    assert disk.load() == Memory((), True)


def test_missing_shadow_copy_keeps_the_latch(disk: Disk) -> None:
    disk.saved(LATCHED)
    shutil.rmtree(disk.shadow.parent)
    assert disk.load() == LATCHED


def test_crash_before_the_write_keeps_the_latch(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.saved(Memory())
    monkeypatch.setattr(latch_store, "_write_through", _full)
    store.save(LATCHED)
    disk.worker.finish()
    assert disk.load() == LATCHED
    assert disk.copies() == [Memory(), Memory()]


@pytest.mark.parametrize("name", COPIES)
def test_missing_copy_keeps_the_latch(disk: Disk, name: str) -> None:
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
    disk.saved(LATCHED)
    (disk.folder / name).write_bytes(b"")
    assert disk.load() == LATCHED, "no second stop"


def test_the_newest_of_several_counts(disk: Disk) -> None:
    disk.saved(Memory(), LATCHED)
    (disk.folder / COPIES[0]).write_bytes(encode(Record(1, Memory())))
    assert disk.load() == LATCHED
    disk.shadow.unlink()
    assert disk.load() == LATCHED


def test_store_continues_the_sequence_number(disk: Disk) -> None:
    disk.saved(LATCHED, Memory())
    disk.saved(Memory((), True))
    assert decode((disk.folder / COPIES[0]).read_bytes()).generation == 3


@pytest.mark.parametrize("broken", ["gone", "nonsense", "unreadable", "folder"])
def test_unreadable_copies_are_an_unknown_past(disk: Disk, broken: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> Any:
        raise PermissionError("no")

    assert Memory(("ESTOP_PRESSED",), True) == UNKNOWN_PAST
    if broken == "folder":
        monkeypatch.setattr(Path, "lstat", refuse)
        assert disk.load() == UNKNOWN_PAST, "no first start"
        return
    disk.saved(Memory())
    disk.shadow.unlink()
    for name in COPIES:
        (disk.folder / name).unlink()
        if broken == "nonsense":
            (disk.folder / name).write_bytes(b"\xff\xfe\x80")
        elif broken == "unreadable":
            (disk.folder / name).mkdir()
    assert disk.load() == UNKNOWN_PAST


def test_a_state_folder_that_was_deleted_is_no_first_start(disk: Disk) -> None:
    disk.saved(LATCHED)
    disk.witness.unlink()
    disk.saved(LATCHED)
    assert disk.witness.exists(), "a record of before the witness makes it"
    shutil.rmtree(disk.folder)
    assert disk.load() == LATCHED, "the copy in the runtime folder is still there"
    disk.shadow.write_bytes(b"")
    assert disk.load() == UNKNOWN_PAST
    disk.shadow.unlink()
    assert disk.load() == UNKNOWN_PAST
    disk.witness.unlink()
    assert disk.load() == Memory()


FORGED = encode(Record(99, Memory()))


@pytest.mark.parametrize("how", ["group writes", "others write", "folder", "link"])
def test_a_copy_that_another_user_may_write_is_damaged(disk: Disk, tmp_path: Path, how: str) -> None:
    disk.saved(Memory(("TILT",), True))
    disk.shadow.write_bytes(FORGED)
    if how == "folder":
        disk.shadow.parent.chmod(0o777)
    elif how == "link":
        disk.shadow.rename(tmp_path / "forged")
        disk.shadow.symlink_to(tmp_path / "forged")
    else:
        disk.shadow.chmod(0o620 if how == "group writes" else 0o602)
        with pytest.raises(ValueError, match=r"^another user may have written it$"):
            latch_store._read_own(disk.shadow)
    assert disk.load() == Memory(("TILT", "ESTOP_PRESSED"), True)


@pytest.mark.parametrize("own", ["folder", "file"])
def test_a_copy_of_another_user_is_damaged(disk: Disk, monkeypatch: pytest.MonkeyPatch, own: str) -> None:
    disk.saved(Memory(("TILT",), True))
    disk.shadow.write_bytes(FORGED)
    wrong = (disk.shadow.parent if own == "folder" else disk.shadow).stat().st_ino
    monkeypatch.setattr(latch_store, "only_own", lambda status: status.st_ino != wrong)
    assert disk.load() == Memory(("TILT", "ESTOP_PRESSED"), True)


ABSENT = object()
GOOD: dict[str, Any] = {"generation": 1, "latched": ["TILT"], "passenger": False, "presses": []}


@pytest.mark.parametrize(
    "changes",
    [
        {"generation": "1"},
        {"latched": "TILT"},
        {"latched": ["NO_SUCH_FAULT"]},
        {"latched": [["TILT"]]},
        {"passenger": 0},
        {"presses": [["a"]]},
        {"presses": [[1, 2]]},
        {"presses": [["a", "b"]]},
        {"presses": None},
        *({name: ABSENT} for name in GOOD),
    ],
)
def test_inconsistent_record_is_rejected(changes: dict[str, Any]) -> None:
    assert decode(_signed(GOOD)).memory == Memory(("TILT",))
    data = {key: value for key, value in (GOOD | changes).items() if value is not ABSENT}
    with pytest.raises(ValueError, match="it is inconsistent"):
        decode(_signed(data))


def test_problem_of_a_record_is_reported() -> None:
    body, checksum, _ = _signed(GOOD).split(b"\n", 2)
    with pytest.raises(ValueError, match=r"^the checksum is wrong$"):
        decode(body + b" \n" + checksum + b"\n")
    with pytest.raises(ValueError, match=r"\('wrong types'\)$"):
        decode(_signed({**GOOD, "generation": "1"}))
    with pytest.raises(ValueError, match=r"\('wrong values'\)$"):
        decode(_signed({**GOOD, "passenger": 0}))
    with pytest.raises(ValueError, match="it is inconsistent"):
        decode(_signed([]))


MANY = Memory(presses=tuple(Press(f"source {index}", index) for index in range(300)))


def test_remains_of_a_longer_record_are_not_read(disk: Disk) -> None:
    """Power fails after the write and before the file is truncated. A record fills whole blocks."""
    long, short = encode(Record(1, MANY)), encode(Record(2, LATCHED))
    assert (len(short), len(long) % 4096, decode(long).memory) == (4096, 0, MANY)
    left = long[len(short) :]
    assert b"\n" in left
    assert decode(short + left) == Record(2, LATCHED)
    disk.saved(MANY, Memory())
    assert (disk.folder / COPIES[0]).stat().st_size == 4096


def test_every_changed_byte_shows() -> None:
    data = encode(Record(3, LATCHED))
    used = len(data.rstrip())
    for index in range(used):
        broken = bytearray(data)
        broken[index] ^= 1
        try:
            assert decode(bytes(broken)) == Record(3, LATCHED), f"byte {index}"  # another encoding of the same checksum
        except ValueError:
            continue
    for end in range(used):
        with pytest.raises(ValueError):  # noqa: PT011 - any kind of damage
            decode(data[:end])


def _signed(data: Any) -> bytes:
    body = json.dumps(data).encode()
    return body + b"\n%08x\n" % zlib.crc32(body)


def _full(*_: Any) -> None:
    raise OSError(28, "No space left on device")


def test_failing_disk_is_reported_until_it_recovers(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.saved(Memory())
    assert store.problem() == ""
    with monkeypatch.context() as patch:
        patch.setattr(latch_store, "_write_through", _full)
        store.save(LATCHED)
        disk.worker.step()
        assert "No space left" in store.problem()
    disk.now_s += latch_store._RETRY_S
    assert "No space left" in store.problem()
    disk.worker.step()
    assert store.problem() == ""
    assert disk.copies() == [LATCHED, LATCHED]
    assert not disk.worker.busy


def test_hanging_disk_is_reported_since_the_first_pending_record(disk: Disk) -> None:
    store = disk.store(slow_s=30.0)
    for begun_s in (1000.0, 5000.0):  # each time from the beginning
        disk.now_s = begun_s
        assert store.problem() == ""
        store.save(LATCHED)
        disk.worker.start()
        assert store.problem() == ""
        disk.now_s = begun_s + 20.0
        store.save(Memory())
        disk.now_s = begun_s + 30.0
        assert store.problem() == ""
        disk.now_s = begun_s + 31.0
        assert store.problem() == "not written for 31 s"
        disk.worker.deliver()
        assert store.problem() == "not written for 31 s", "the second record waits"
        disk.worker.finish()
        assert store.problem() == ""


@pytest.mark.parametrize("fails", [False, True])
def test_record_during_a_write_is_written_next(disk: Disk, monkeypatch: pytest.MonkeyPatch, fails: bool) -> None:
    store = disk.saved(Memory())
    with monkeypatch.context() as patch:
        if fails:
            patch.setattr(latch_store, "_write_through", _full)
        store.save(Memory((), True))
        disk.worker.start()
        for _ in range(3):
            store.save(LATCHED)
        assert disk.copies() == [Memory() if fails else Memory((), True)] * 2
        disk.worker.deliver()
        assert ("No space left" in store.problem()) is fails
    disk.worker.step()
    assert store.problem() == ""
    assert disk.copies() == [LATCHED, LATCHED]
    assert not disk.worker.busy, "the newest record is written once"


def test_failing_disk_is_retried_after_a_pause(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latch_store, "_write_through", _full)
    store = disk.store()
    store.save(LATCHED)
    disk.worker.step()
    for _ in range(3):
        store.problem()
        assert not disk.worker.busy
        disk.now_s += 0.99
        store.problem()
        assert not disk.worker.busy
        disk.now_s += 0.01
        store.problem()
        store.problem()
        disk.worker.step()
        assert not disk.worker.busy, "one try a time"


def test_a_new_record_is_tried_on_a_disk_that_is_left_alone(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.saved(Memory())
    with monkeypatch.context() as patch:
        patch.setattr(latch_store, "_write_through", _full)
        store.save(Memory((), True))
        disk.worker.step()
    store.save(LATCHED)
    disk.worker.step()
    assert store.problem() == ""
    assert disk.copies() == [LATCHED, LATCHED]


def test_a_first_start_that_was_cut_off_is_begun_again(disk: Disk) -> None:
    beside = disk.folder.with_name("safety.new")
    beside.mkdir(parents=True)
    (beside / COPIES[0]).write_bytes(b"half")
    assert disk.load() == Memory()
    disk.saved(LATCHED)
    assert not beside.exists()


def test_latch_file_is_private_to_its_user(disk: Disk) -> None:
    before = os.umask(0)
    try:
        disk.saved(LATCHED)
    finally:
        os.umask(before)
    assert stat.S_IMODE(disk.folder.stat().st_mode) == 0o700
    copies = [*(disk.folder / name for name in COPIES), disk.shadow]
    assert [stat.S_IMODE(copy.stat().st_mode) for copy in copies] == [0o600] * 3


@pytest.mark.parametrize("folders", [True, False])
def test_a_new_copy_s_name_is_on_the_disk_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folders: bool) -> None:
    """Where the file system can do that."""
    synced: list[int] = []

    def sync(descriptor: int) -> None:
        status = os.fstat(descriptor)
        if stat.S_ISDIR(status.st_mode) and not folders:
            raise OSError(22, "Invalid argument")
        synced.append(status.st_ino)

    monkeypatch.setattr(os, "fsync", sync)
    copy = tmp_path / "copy"
    latch_store._write_through(copy, b"data")
    assert synced == [copy.stat().st_ino, *([tmp_path.stat().st_ino] if folders else [])]
    assert copy.read_bytes() == b"data"


def test_failing_runtime_folder_is_reported(disk: Disk) -> None:
    shutil.rmtree(disk.shadow.parent)
    store = disk.saved(LATCHED)
    assert "safety_latch" in store.problem()
    disk.shadow.parent.mkdir()
    store.save(Memory())
    assert store.problem() == ""


def test_half_a_write_is_a_failed_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "pwrite", lambda *_: 7)
    with pytest.raises(OSError, match="only 7 of 4096 bytes"):
        latch_store._write_through(tmp_path / "copy", encode(Record(1, Memory())))


def test_a_copy_is_overwritten_in_place_and_to_the_disk(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk has no room for a second file. Data that is not on the disk is lost in a power cut."""
    store = disk.saved(Memory())
    inodes = [(disk.folder / name).stat().st_ino for name in COPIES]
    synced: list[int] = []
    real = os.fsync
    monkeypatch.setattr(os, "fsync", lambda descriptor: (synced.append(os.fstat(descriptor).st_ino), real(descriptor)))
    store.save(LATCHED)
    disk.worker.finish()
    assert disk.copies() == [LATCHED, LATCHED]
    assert synced == inodes == [(disk.folder / name).stat().st_ino for name in COPIES]


def test_last_record_is_written_at_the_end(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.store()
    store.save(LATCHED)
    disk.worker.start()
    store.save(Memory((), True))
    store.close()
    assert disk.worker.closed
    assert disk.copies() == [Memory((), True)] * 2
    store = disk.saved(Memory())
    with monkeypatch.context() as patch:
        patch.setattr(latch_store, "_write_through", _full)
        store.save(LATCHED)
        disk.worker.step()
    store.close()
    assert disk.copies() == [LATCHED, LATCHED], "a failed write is tried again"
    store = disk.saved(LATCHED)
    monkeypatch.setattr(latch_store, "_write_through", lambda *_: pytest.fail("written again"))
    store.close()
