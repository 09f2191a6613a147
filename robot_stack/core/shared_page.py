"""A few numbers and a text that one process writes and others read, in a file of the runtime folder.

Every word is eight bytes, aligned, so that a single word is read whole. What belongs together is written between two
changes of a version word (a sequence lock): a reader that meets a writer reads again. A reader never blocks a writer.
"""

from __future__ import annotations

import contextlib
import mmap
import os
from collections.abc import Iterator
from pathlib import Path

_WORD = 8
_TRIES = 100


class SharedPage:
    """words: number of signed 64-bit words beside the version. text_bytes: room for a text in UTF-8 behind them."""

    def __init__(self, path: Path, words: int, text_bytes: int = 0, *, create: bool) -> None:
        """Opens the file, in its present state if there is one. Raises FileNotFoundError if it may not be created."""
        size = _WORD * (1 + words) + text_bytes
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | (os.O_CREAT if create else 0), 0o600)
        try:
            if os.fstat(descriptor).st_size < size:
                if not create:
                    raise FileNotFoundError(f"{path} is being made")
                os.ftruncate(descriptor, size)
            self._map = mmap.mmap(descriptor, size)
        finally:
            os.close(descriptor)
        self._words = memoryview(self._map)[: _WORD * (1 + words)].cast("q")
        self._last: tuple[int, ...] | None = None
        self._text_at = _WORD * (1 + words)
        self._text_bytes = text_bytes

    @contextlib.contextmanager
    def writing(self) -> Iterator[memoryview]:
        """The words, to be changed together. One writer at a time."""
        version = self._words[0] | 1  # odd while being written, also after a writer that died in between
        self._words[0] = version
        try:
            yield self._words[1:]
        finally:
            self._words[0] = version + 1

    def read(self) -> tuple[int, ...]:
        """The words as they were at one moment.

        While a writer does not get on (the processor was taken from it, or it died), as they were when they were read
        last. As they are, if they never have been.
        """
        words: tuple[int, ...] = ()
        for _ in range(_TRIES):
            before, *rest = self._words
            words = tuple(rest)
            if before == self._words[0] and not before & 1:
                self._last = words
                return words
        return words if self._last is None else self._last

    def word(self, index: int) -> int:
        return self._words[1 + index]

    def set_word(self, index: int, value: int) -> None:
        """A single word that belongs to no other."""
        self._words[1 + index] = value

    @property
    def text(self) -> str:
        return self._map[self._text_at : self._text_at + self._text_bytes].split(b"\0", 1)[0].decode(errors="replace")

    @text.setter
    def text(self, value: str) -> None:
        data = value.encode()[: self._text_bytes]
        self._map[self._text_at : self._text_at + self._text_bytes] = data.ljust(self._text_bytes, b"\0")

    def close(self) -> None:
        self._words.release()
        self._map.close()
