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


@pytest.mark.parametrize("memory", [Memory(), LATCHED, Memory(("DRIVE_FAULT",), False), Memory((), True)])
def test_round_trip(disk: Disk, memory: Memory) -> None:
    disk.saved(memory)
    assert disk.load() == memory


def test_first_start_has_an_empty_memory_and_writes_both_copies(disk: Disk) -> None:
    store = disk.store()
    assert store.load() == Memory()
    store.save(Memory())
    disk.worker.finish()
    assert disk.copies() == [Memory(), Memory()]
    assert not disk.folder.with_name("safety.new").exists()
    assert disk.witness.read_bytes() == b""


def test_only_changed_memory_is_saved(disk: Disk) -> None:
    store = disk.store()
    store.save(LATCHED)
    disk.shadow.unlink()
    store.save_if_new(LATCHED)
    assert not disk.shadow.exists()
    store.save_if_new(Memory())
    assert disk.load() == Memory()


def test_first_memory_is_always_saved(disk: Disk) -> None:
    disk.saved(LATCHED)
    disk.shadow.unlink()
    disk.store().save_if_new(LATCHED)
    assert disk.shadow.exists()


def test_an_unknown_past_is_an_emergency_with_a_passenger() -> None:
    assert Memory(("ESTOP_PRESSED",), True) == UNKNOWN_PAST


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


def test_store_continues_the_sequence_number(disk: Disk) -> None:
    disk.saved(LATCHED, Memory())
    disk.saved(Memory((), True))
    assert decode((disk.folder / COPIES[0]).read_bytes()).generation == 3


@pytest.mark.parametrize("broken", ["gone", "nonsense", "unreadable"])
def test_unreadable_copies_are_an_unknown_past(disk: Disk, broken: str) -> None:
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


def test_a_state_folder_that_was_deleted_is_no_first_start(disk: Disk) -> None:
    disk.saved(LATCHED)
    shutil.rmtree(disk.folder)
    disk.shadow.unlink()
    assert disk.load() == UNKNOWN_PAST
    disk.witness.unlink()
    assert disk.load() == Memory()


def test_a_record_of_before_the_witness_makes_it(disk: Disk) -> None:
    disk.saved(LATCHED)
    disk.witness.unlink()
    store = disk.store()
    store.save(store.load())
    disk.worker.finish()
    assert disk.witness.exists()


FORGED = encode(Record(99, Memory()))


@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_a_copy_that_another_user_may_write_is_damaged(disk: Disk, mode: int) -> None:
    disk.saved(Memory(("TILT",), True))
    disk.shadow.write_bytes(FORGED)
    disk.shadow.chmod(mode)
    assert disk.load() == Memory(("TILT", "ESTOP_PRESSED"), True)
    with pytest.raises(ValueError, match=r"^another user may have written it$"):
        latch_store._read_own(disk.shadow)


def test_a_copy_in_a_folder_where_another_user_may_replace_it_is_damaged(disk: Disk) -> None:
    disk.saved(Memory(("TILT",), True))
    disk.shadow.write_bytes(FORGED)
    disk.shadow.parent.chmod(0o777)
    assert disk.load() == Memory(("TILT", "ESTOP_PRESSED"), True)


@pytest.mark.parametrize("own", ["folder", "file"])
def test_a_copy_of_another_user_is_damaged(disk: Disk, monkeypatch: pytest.MonkeyPatch, own: str) -> None:
    disk.saved(Memory(("TILT",), True))
    disk.shadow.write_bytes(FORGED)
    wrong = (disk.shadow.parent if own == "folder" else disk.shadow).stat().st_ino
    monkeypatch.setattr(latch_store, "only_own", lambda status: status.st_ino != wrong)
    assert disk.load() == Memory(("TILT", "ESTOP_PRESSED"), True)


def test_a_link_is_no_copy(disk: Disk, tmp_path: Path) -> None:
    disk.saved(Memory(("TILT",), True))
    forged = tmp_path / "forged"
    forged.write_bytes(FORGED)
    disk.shadow.unlink()
    disk.shadow.symlink_to(forged)
    assert disk.load() == Memory(("TILT", "ESTOP_PRESSED"), True)


def test_unreadable_folder_is_no_first_start(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_inconsistent_record_is_rejected(changes: dict[str, Any]) -> None:
    assert decode(_signed(GOOD)).memory == Memory(("TILT",))
    with pytest.raises(ValueError, match="it is inconsistent"):
        decode(_signed({**GOOD, **changes}))


def test_problem_of_a_record_is_reported() -> None:
    body, checksum, _ = _signed(GOOD).split(b"\n", 2)
    with pytest.raises(ValueError, match=r"^the checksum is wrong$"):
        decode(body + b" \n" + checksum + b"\n")
    with pytest.raises(ValueError, match=r"\('wrong types'\)$"):
        decode(_signed({**GOOD, "generation": "1"}))
    with pytest.raises(ValueError, match=r"\('wrong values'\)$"):
        decode(_signed({**GOOD, "passenger": 0}))


def test_remains_of_a_longer_record_are_not_read() -> None:
    """Power fails after the write and before the file is truncated."""
    many = Memory(presses=tuple(Press(f"source {index}", index) for index in range(300)))
    short = encode(Record(2, LATCHED))
    left = encode(Record(1, many))[len(short) :]
    assert b"\n" in left
    assert decode(short + left) == Record(2, LATCHED)


def test_a_record_that_lacks_something_is_none() -> None:
    for name in GOOD:
        with pytest.raises(ValueError, match="it is inconsistent"):
            decode(_signed({key: value for key, value in GOOD.items() if key != name}))
    with pytest.raises(ValueError, match="it is inconsistent"):
        decode(_signed([]))


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


def test_copy_in_memory_is_written_again(disk: Disk) -> None:
    store = disk.saved(Memory())
    disk.shadow.parent.rename(disk.shadow.parent.with_name("full"))
    store.save(LATCHED)
    disk.worker.finish()
    assert "No such file" in store.problem()
    disk.now_s += latch_store._RETRY_S
    assert "No such file" in store.problem()
    disk.shadow.parent.with_name("full").rename(disk.shadow.parent)
    assert "No such file" in store.problem()
    disk.now_s += latch_store._RETRY_S
    assert store.problem() == ""
    assert _read(disk.shadow) == LATCHED


def test_hanging_disk_is_reported_since_the_first_pending_record(disk: Disk) -> None:
    store = disk.store(slow_s=30.0)
    assert store.problem() == ""
    store.save(LATCHED)
    disk.worker.start()
    assert store.problem() == ""
    disk.now_s = 1020.0
    store.save(Memory())
    disk.now_s = 1030.0
    assert store.problem() == ""
    disk.now_s = 1031.0
    assert store.problem() == "not written for 31 s"
    disk.worker.deliver()
    assert store.problem() == "not written for 31 s", "the second record waits"
    disk.worker.finish()
    assert store.problem() == ""
    disk.now_s = 5000.0
    assert store.problem() == ""


def test_each_record_has_its_own_time_to_get_to_the_disk(disk: Disk) -> None:
    store = disk.store(slow_s=30.0)
    store.load()
    for now_s in (1000.0, 2000.0):
        disk.now_s = now_s
        store.save(LATCHED)
        disk.now_s = now_s + 30.0
        assert store.problem() == ""
        disk.now_s = now_s + 31.0
        assert store.problem() == "not written for 31 s"
        disk.worker.finish()


def test_record_during_a_write_is_written_next(disk: Disk) -> None:
    store = disk.saved(Memory())
    store.save(Memory((), True))
    disk.worker.start()
    for _ in range(3):
        store.save(LATCHED)
    assert disk.copies() == [Memory((), True)] * 2
    disk.worker.deliver()
    disk.worker.step()
    assert disk.copies() == [LATCHED, LATCHED]
    assert not disk.worker.busy, "the newest record is written once"


def test_record_during_a_failing_write_is_written_next(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.saved(Memory())
    with monkeypatch.context() as patch:
        patch.setattr(latch_store, "_write_through", _full)
        store.save(Memory((), True))
        disk.worker.start()
        store.save(LATCHED)
        disk.worker.deliver()
        assert "No space left" in store.problem()
    disk.worker.step()
    assert store.problem() == ""
    assert disk.copies() == [LATCHED, LATCHED]


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


def test_last_record_is_written_at_the_end(disk: Disk) -> None:
    store = disk.store()
    store.save(LATCHED)
    disk.worker.start()
    store.save(Memory((), True))
    store.close()
    assert disk.worker.closed
    assert disk.copies() == [Memory((), True)] * 2


def test_failed_write_is_retried_at_the_end(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.store()
    with monkeypatch.context() as patch:
        patch.setattr(latch_store, "_write_through", _full)
        store.save(LATCHED)
        disk.worker.step()
    store.close()
    assert disk.copies() == [LATCHED, LATCHED]


def test_stored_record_is_not_rewritten_at_the_end(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = disk.saved(LATCHED)
    monkeypatch.setattr(latch_store, "_write_through", lambda *_: pytest.fail("written again"))
    store.close()
