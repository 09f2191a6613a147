"""A recording written by a thread of its own, so that a slow disk never holds up the node that receives."""

from __future__ import annotations

import os
import threading
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from mcap.exceptions import McapError


class Bag(Protocol):
    """What a thread may write into: ``BagWriter``, ``BlackBox``."""

    @property
    def path(self) -> Path: ...

    def write(self, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None: ...

    def flush(self) -> None: ...

    def close(self) -> None: ...

    def abandon(self) -> None: ...


@dataclass(frozen=True, slots=True)
class Counts:
    """Messages and bytes given to the writer, messages lost because the disk was too slow."""

    messages: int
    bytes: int
    lost: int


@dataclass(frozen=True, slots=True)
class _Item:
    topic: str
    log_ns: int
    publish_ns: int
    data: bytes


def disk_use(folder: Path) -> float:
    """Share of the disk under ``folder`` that is not free for ordinary users, [0, 1]. Raises OSError."""
    disk = os.statvfs(folder)
    return 1.0 - disk.f_bavail / disk.f_blocks if disk.f_blocks else 1.0


def bytes_over(folder: Path, max_disk_use: float) -> float:
    """Bytes by which the disk under ``folder`` is fuller than ``max_disk_use``, negative with room. Raises OSError."""
    disk = os.statvfs(folder)
    return (disk_use(folder) - max_disk_use) * disk.f_blocks * disk.f_frsize


class BackgroundWriter:
    """Accepts messages without blocking; one thread writes them, flushes, and monitors the disk.

    max_disk_use: share of the disk in use at which writing ends; the recording is completed and ``problem`` is set.
    """

    def __init__(self, bag: Bag, folder: Path, *, flush_period_s: float, max_disk_use: float, queue_bytes: int) -> None:
        self._bag = bag
        self._folder = folder
        self._flush_period_s = flush_period_s
        self._max_disk_use = max_disk_use
        self._queue_bytes = queue_bytes
        self._queue: deque[_Item] = deque()
        self._waiting_bytes = 0
        self._messages = self._bytes = self._lost = 0
        self._wake = threading.Condition()
        self._closing = False
        self._problem = ""
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    @property
    def problem(self) -> str:
        """Why writing has ended, empty while there is no problem."""
        return self._problem

    def counts(self) -> Counts:
        with self._wake:
            return Counts(self._messages, self._bytes, self._lost)

    def add(self, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None:
        """Queues a message; counts it as lost if the queue is full or nothing is written any more."""
        with self._wake:
            if self._problem or self._closing or self._waiting_bytes + len(data) > self._queue_bytes:
                self._lost += 1
                return
            self._queue.append(_Item(topic, log_ns, publish_ns, data))
            self._waiting_bytes += len(data)
            self._messages += 1
            self._bytes += len(data)

    def close(self) -> None:
        """Writes the queue and completes the recording."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join()

    def _run(self) -> None:
        try:
            while self._turn():
                pass
            self._write_queue()
            self._bag.close()
        except (OSError, McapError) as error:
            self._give_up(error)

    def _turn(self) -> bool:
        """One period: waits, writes, flushes and checks the disk. Returns False at the end."""
        with self._wake:
            self._wake.wait_for(lambda: self._closing, self._flush_period_s)
        self._write_queue()
        self._bag.flush()
        use = disk_use(self._folder)
        if use >= self._max_disk_use:
            self._stop(f"the disk of {self._folder} is {use:.0%} full, limit max_disk_use {self._max_disk_use:.0%}")
        return not (self._closing or self._problem)

    def _write_queue(self) -> None:
        while True:
            with self._wake:
                if not self._queue:
                    return
                item = self._queue.popleft()
                self._waiting_bytes -= len(item.data)
            self._bag.write(item.topic, item.log_ns, item.publish_ns, item.data)

    def _stop(self, problem: str) -> None:
        with self._wake:
            self._problem = problem

    def _give_up(self, error: Exception) -> None:
        self._stop(f"{self._bag.path} cannot be written: {error}")
        self._bag.abandon()
