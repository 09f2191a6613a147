"""The latched emergency stop on file, so that it survives the end of the monitor and of the computer.

Three copies of one record: two in the state folder, which survive a power cut, a logout or a reboot, and one
in the runtime folder, in memory. The one in memory is written before a verdict is published and survives a crash of the
monitor; the others are written beside the monitor's loop, one after the other, each through to the disk, because a
verdict must not wait for a disk. They are written in place, in blocks that they already own, so that a full disk does
no harm.

The newest record with a correct checksum is in force. If one is expected and there is none, the latch is unknown: the
monitor starts in emergency stop with a passenger. A damaged copy was being written when the power failed: its record
may have been a stop, so that it counts as one; so does a copy that another user owns or may write. A record
is expected if there is a state folder, or the witness beside it: the first start makes the folder and its copies in
one step, and then the witness, which remains if the folder is deleted.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from robot_stack.contract import faults
from robot_stack.core.atomic_file import replace_file, sync_folder
from robot_stack.core.runtime import only_own
from robot_stack.core.worker import Worker
from robot_stack.safety.monitor import ESTOP_PRESSED, Memory
from robot_stack.safety.stop_sources import Press

UNKNOWN_PAST = Memory((ESTOP_PRESSED,), passenger=True)
COPIES = ("latch.a", "latch.b")
_BLOCK = 4096
_RETRY_S = 1.0
_END_S = 2.0


@dataclass(frozen=True, slots=True)
class Record:
    """One stored memory. generation: a counter of records."""

    generation: int
    memory: Memory


def encode(record: Record) -> bytes:
    """A line of JSON and a line with its checksum, filled up to whole blocks."""
    memory = record.memory
    body = json.dumps(
        {
            "generation": record.generation,
            "latched": memory.latched,
            "passenger": memory.passenger,
            "presses": [press.instance for press in memory.presses],
        }
    ).encode()
    data = body + b"\n%08x\n" % zlib.crc32(body)
    return data.ljust(-(-len(data) // _BLOCK) * _BLOCK)


def decode(data: bytes) -> Record:
    """Inverse of ``encode``. Raises ValueError for other or incomplete data."""
    body, checksum, _ = data.split(b"\n", 2)
    if int(checksum, 16) != zlib.crc32(body):
        raise ValueError("the checksum is wrong")
    try:
        return _record(json.loads(body))
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"it is inconsistent: {error!r}") from error


def _record(data: Any) -> Record:
    generation, latched, passenger = data["generation"], tuple(data["latched"]), data["passenger"]
    presses = tuple(Press(*instance) for instance in data["presses"])
    numbers: list[Any] = [generation, *(number for press in presses for number in (press.pid, press.begun_ns))]
    names: list[Any] = [press.name for press in presses]
    if not all(isinstance(number, int) for number in numbers) or not all(isinstance(name, str) for name in names):
        raise ValueError("wrong types")
    if not isinstance(passenger, bool) or not all(code in faults.BY_CODE for code in latched):
        raise ValueError("wrong values")
    return Record(generation, Memory(latched, passenger, presses))


class LatchStore:
    """Keeps the memory of the safety monitor in ``folder``, and in ``shadow``, a file in memory.

    witness: an empty file outside ``folder``, which shows that a record existed. Belongs to the node's loop; the
    files on disk are written by ``worker``. now_s: a monotonic clock.
    """

    def __init__(
        self, folder: Path, shadow: Path, witness: Path, slow_s: float, worker: Worker, now_s: Callable[[], float]
    ) -> None:
        """slow_s: ``problem`` reports a record that is not on disk after this time."""
        self._folder, self._shadow, self._witness, self._slow_s = folder, shadow, witness, slow_s
        self._worker, self._now_s = worker, now_s
        self._saved: Memory | None = None
        self._newest = self._stored = Record(0, Memory())
        self._waiting_since_s = 0.0
        self._writing = False
        self._retry_at_s = self._retry_shadow_at_s = math.inf
        self._shadow_problem = self._disk_problem = ""

    def load(self) -> Memory:
        """The stored memory, by the rules of the module. Never raises."""
        first_start = not any(map(_there, (self._folder, self._shadow, self._witness)))
        records, damaged = [], False
        for path in (*self._copies(), self._shadow):
            try:
                records.append(decode(_read_own(path)))
            except FileNotFoundError:
                continue
            except (OSError, ValueError):
                damaged = True
        if not records:
            return Memory() if first_start else UNKNOWN_PAST
        newest = max(records, key=lambda record: record.generation)
        self._newest = self._stored = newest
        memory = newest.memory
        if damaged and ESTOP_PRESSED not in memory.latched:
            memory = replace(memory, latched=(*memory.latched, ESTOP_PRESSED))
        return memory

    def save(self, memory: Memory) -> None:
        """Keeps ``memory`` from now on. Never raises and never waits for a disk: ``problem`` reports errors."""
        self._saved = memory
        if self._newest is self._stored:
            self._waiting_since_s = self._now_s()
        self._newest = Record(self._newest.generation + 1, memory)
        self._write_shadow()
        if not self._writing:
            self._write_newest()

    def save_if_new(self, memory: Memory) -> None:
        """Saves ``memory`` unless it was the last one saved."""
        if memory != self._saved:
            self.save(memory)

    def problem(self) -> str:
        """Why the memory is not on disk in time, else an empty text. Retries a failed write after a pause."""
        now_s = self._now_s()
        if now_s >= self._retry_at_s:
            self._write_newest()
        if now_s >= self._retry_shadow_at_s:
            self._write_shadow()
        if self._disk_problem or self._shadow_problem:
            return self._disk_problem or self._shadow_problem
        waiting_s = now_s - self._waiting_since_s
        slow = self._newest is not self._stored and waiting_s > self._slow_s
        return f"not written for {waiting_s:.0f} s" if slow else ""

    def close(self) -> None:
        """Tries once more to write a pending record."""
        if self._newest is not self._stored:
            self._write_newest()
        self._worker.close(_END_S)

    def _write_shadow(self) -> None:
        try:
            replace_file(self._shadow, encode(self._newest), durable=False, mode=0o600)
            self._shadow_problem, self._retry_shadow_at_s = "", math.inf
        except OSError as error:
            self._shadow_problem, self._retry_shadow_at_s = str(error), self._now_s() + _RETRY_S

    def _write_newest(self) -> None:
        self._retry_at_s = math.inf
        self._writing = True
        self._worker.submit(partial(self._write, self._newest), partial(self._on_written, self._newest))

    def _on_written(self, record: Record, problem: str) -> None:
        self._writing, self._disk_problem = False, problem
        if not problem:
            self._stored = record
        if self._newest is not record:
            self._write_newest()
        elif problem:
            self._retry_at_s = self._now_s() + _RETRY_S

    def _write(self, record: Record) -> str:
        """Runs on the worker. Returns the error, empty if both copies are on disk."""
        try:
            data = encode(record)
            if not _there(self._folder):
                self._make_folder(data)
            else:
                for path in self._copies():
                    _write_through(path, data)
            if not _there(self._witness):
                _write_through(self._witness, b"")
        except OSError as error:
            return str(error)
        return ""

    def _make_folder(self, data: bytes) -> None:
        """Creates folder and copies atomically: a folder without its copies would be a lost latch."""
        beside = self._folder.with_name(f"{self._folder.name}.new")
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True, mode=0o700)
        for name in COPIES:
            _write_through(beside / name, data)
        os.replace(beside, self._folder)
        sync_folder(self._folder.parent)

    def _copies(self) -> list[Path]:
        return [self._folder / name for name in COPIES]


def _there(path: Path) -> bool:
    """False only if the path certainly does not exist."""
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return True


def _read_own(path: Path) -> bytes:
    """The content. Raises ValueError for a file that another user may have written, or may replace in its folder."""
    with open(os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW), "rb") as file:
        if not only_own(path.parent.lstat()) or not only_own(os.fstat(file.fileno())):
            raise ValueError("another user may have written it")
        return file.read()


def _write_through(path: Path, data: bytes) -> None:
    """Overwrites a file in place, to the disk."""
    made = not path.exists()
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        written = os.pwrite(descriptor, data, 0)
        if written != len(data):
            raise OSError(f"only {written} of {len(data)} bytes written")
        os.ftruncate(descriptor, len(data))
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    if made:
        sync_folder(path.parent)
