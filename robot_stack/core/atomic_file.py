"""Files that a reader or a restarted process sees whole: the old content or the new one."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path


def replace_file(path: Path, content: str | bytes, *, durable: bool = True, mode: int = 0o666) -> None:
    """Replaces a file's content atomically, text as UTF-8. The file keeps its old content if this fails.

    durable: the new content is on the disk on return, also after a loss of power. mode: of the new file, less the
    umask. Raises OSError.
    """
    _put(path, content, os.replace, durable, mode)


def create_file(path: Path, content: str | bytes) -> None:
    """Writes a new file as ``replace_file`` does. Raises FileExistsError, and OSError."""
    _put(path, content, os.link, durable=True, mode=0o666)  # unlike a rename, this never replaces another file


def _put(path: Path, content: str | bytes, place: Callable[[Path, Path], None], durable: bool, mode: int) -> None:
    draft = path.with_name(f".{path.name}.new")
    try:
        with open(draft, "wb", opener=partial(os.open, mode=mode)) as file:
            file.write(content.encode() if isinstance(content, str) else content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        place(draft, path)
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()  # also on a full disk, which needs its space
    if durable:
        sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Writes the names in a folder to the disk: without this, a new file may be missing after a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with contextlib.suppress(OSError):  # some file systems cannot sync folders
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
