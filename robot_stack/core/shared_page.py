"""A few numbers and a text, written by one process and read by others, in a file of the runtime folder.

Every word is eight bytes, aligned, so that a single word is read whole. Words that belong together are stored twice:
the version's lowest bit selects the valid copy while the writer changes the other one. So if a writer pauses or dies
in the middle, readers still get the previous values, and a reader never blocks a writer.
"""

from __future__ import annotations

import contextlib
import mmap
import os
from collections.abc import Iterator
from pathlib import Path

_WORD = 8


class SharedPage:
    """words: number of signed 64-bit words that are read together. singles: number of independent words behind them.
    text_bytes: room for a text in UTF-8 behind them.
    """

    def __init__(self, path: Path, words: int, singles: int = 0, text_bytes: int = 0, *, create: bool) -> None:
        """Opens the file, in its present state if there is one. Raises FileNotFoundError if it may not be created."""
        self._text_at = _WORD * (1 + 2 * words + singles)
        size = self._text_at + text_bytes
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | (os.O_CREAT if create else 0), 0o600)
        try:
            if os.fstat(descriptor).st_size < size:
                if not create:
                    raise FileNotFoundError(f"{path} is being created")
                os.ftruncate(descriptor, size)
            self._map = mmap.mmap(descriptor, size)
        finally:
            os.close(descriptor)
        self._words = memoryview(self._map)[: self._text_at].cast("q")
        self._slots = (self._words[1 : 1 + words], self._words[1 + words : 1 + 2 * words])
        self._singles = self._words[1 + 2 * words :]
        self._text_bytes = text_bytes

    @contextlib.contextmanager
    def writing(self) -> Iterator[memoryview]:
        """The current words, to be changed together. One writer at a time; an exception changes nothing."""
        version = self._words[0]
        slot = self._slots[(version + 1) & 1]
        slot[:] = self._slots[version & 1]
        yield slot
        self._words[0] = version + 1

    def read(self) -> tuple[int, ...]:
        """The words that belong together, as they were at one moment."""
        while True:
            version = self._words[0]
            words = tuple(self._slots[version & 1])
            if version == self._words[0]:  # else the writer may have reused this half
                return words

    @property
    def singles(self) -> memoryview:
        """The single words themselves; valid while the page is open."""
        return self._singles

    def single(self, index: int) -> int:
        return self._singles[index]

    def set_single(self, index: int, value: int) -> None:
        self._singles[index] = value

    @property
    def text(self) -> str:
        return self._map[self._text_at : self._text_at + self._text_bytes].split(b"\0", 1)[0].decode(errors="replace")

    @text.setter
    def text(self, value: str) -> None:
        data = value.encode()[: self._text_bytes]
        self._map[self._text_at : self._text_at + self._text_bytes] = data.ljust(self._text_bytes, b"\0")

    def close(self) -> None:
        for view in (*self._slots, self._singles, self._words):
            view.release()
        self._map.close()
