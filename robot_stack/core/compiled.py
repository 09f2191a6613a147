"""Compilation of inner loops with numba, cached on disk.

numba's own cache compares only the file of a function: after a change of a callee or a constant in another file, the
old machine code would run. Here the cached code is bound to the contents of the function's file and to the compiled
functions and constants that this file imports.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from enum import EnumMeta
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, overload

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

_stamps: dict[str, str] = {}  # by file


@overload
def compiled(function: FunctionT, /) -> FunctionT: ...
@overload
def compiled(
    *, error_model: str = "python", nogil: bool = False, inline: str = "never"
) -> Callable[[FunctionT], FunctionT]: ...
def compiled(function: Callable[..., Any] | None = None, /, **options: Any) -> Any:
    """Compiles a function at its first call, or loads the code that a process compiled from the same sources.

    The options are numba's. Where no folder can be written, each process compiles for itself.
    """
    if function is None:
        return partial(compiled, **options)
    loop = numba.njit(**options)(function)
    try:
        loop.enable_caching()
    except RuntimeError:
        return loop
    # numba has no public call for this.
    loop._cache._cache_file._source_stamp = _stamp(function.__code__.co_filename, function.__globals__)
    return loop


def _stamp(file: str, namespace: Mapping[str, Any]) -> str:
    """Digest of a file and of what its loops can use. Its imports are complete when its first loop is defined."""
    if file not in _stamps:
        used = [f"{name}={_identity(value)}" for name, value in namespace.items() if not name.startswith("__")]
        _stamps[file] = hashlib.sha256("\0".join([_content(file), *used]).encode()).hexdigest()
    return _stamps[file]


@cache
def _content(file: str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def _identity(value: object) -> str:
    """Equal for values with which numba generates equal code; empty for those that it cannot use."""
    match value:
        case Dispatcher():
            file = value.py_func.__code__.co_filename
            return _stamps.get(file) or _content(file)
        case ModuleType(__file__=str(file)):
            return _content(file)
        case EnumMeta():
            members: Mapping[str, Any] = value.__members__
            return repr({name: member.value for name, member in members.items()})
        case type():
            return repr(getattr(value, "_fields", ""))  # of a named tuple
        case np.ndarray():
            return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
        case bool() | int() | float() | str() | np.generic():
            return repr(value)
        case tuple():
            return repr([_identity(item) for item in value])
    return ""
