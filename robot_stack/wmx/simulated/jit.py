"""Compilation of the engine's inner loop, cached on disk.

numba's own cache tracks only the file of a function, not its callees or constants folded in from other
modules: after a change of a row number elsewhere the old machine code would run. So the cache folder is named after
the contents of all sources of compiled code, and any change makes a new one.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from numba.core import config

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parents[1]
SOURCES: Final = (
    "axes.py",
    "api/*.py",
    "simulated/jit.py",
    "simulated/kernel.py",
    "simulated/profile.py",
    "simulated/rows.py",
    "simulated/spline_kernel.py",
    "simulated/switch_kernel.py",
)
"""Sources of compiled code, relative to the package ``robot_stack.wmx``."""

_PREFIX = "numba-"
_numba_config: Any = config


@cache
def _cache_folder() -> str:
    digest = hashlib.sha256()
    for source in sorted(path for pattern in SOURCES for path in _PACKAGE.glob(pattern)):
        digest.update(source.read_bytes())
    root = _writable(Path(__file__).parent / "__pycache__") or _writable(
        Path(tempfile.gettempdir()) / f"robot_stack-numba-{os.getuid()}"
    )
    if root is None:
        return ""
    folder = root / f"{_PREFIX}{digest.hexdigest()[:16]}"
    if not folder.is_dir():
        for old in root.glob(f"{_PREFIX}*"):
            shutil.rmtree(old, ignore_errors=True)
        folder.mkdir(exist_ok=True, mode=0o700)
    return str(folder)


def _writable(folder: Path) -> Path | None:
    try:
        folder.mkdir(exist_ok=True, mode=0o700)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid() else None


def compiled(function: FunctionT) -> FunctionT:
    """Compiles ``function`` at its first call, or loads the code that a process compiled from the same sources."""
    before = _numba_config.CACHE_DIR
    _numba_config.CACHE_DIR = _cache_folder()
    try:
        return cast(FunctionT, numba.njit(cache=True)(function))
    finally:
        _numba_config.CACHE_DIR = before
