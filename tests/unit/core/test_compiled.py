"""Compiled loops run the code of the present sources, whichever file changed."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from robot_stack.core import compiled as module

FILES = {
    "loops_constants.py": """
from enum import IntEnum
from typing import NamedTuple
GAIN = 2.0
class Row(IntEnum):
    FIRST = 3
class Pair(NamedTuple):
    one: float
    two: float
""",
    "loops_numbers.py": "OFFSET = 10.0\n",
    "loops_callee.py": """
from loops_constants import GAIN, Pair, Row
from robot_stack.core.compiled import compiled
@compiled(inline="always")
def scaled(x):
    return GAIN * Pair(x, 0.0).one + (3.0 if Row.FIRST == 3 else 5.0)
""",
    "loops_caller.py": """
import loops_numbers
from loops_callee import scaled
from robot_stack.core.compiled import compiled
@compiled(error_model="numpy")
def total(x):
    return scaled(x) + loops_numbers.OFFSET
""",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # two changes within a second look the same to Python's cache
    yield tmp_path
    _forget(tmp_path)


def _forget(folder: Path) -> None:
    module._content.cache_clear()
    for name in FILES:
        module._stamps.pop(str(folder / name), None)
        sys.modules.pop(name.removesuffix(".py"), None)
    importlib.invalidate_caches()


def start(folder: Path) -> Any:
    """Returns the loop as a new process imports it."""
    _forget(folder)
    return importlib.import_module("loops_caller").total


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_second_process_loads_the_code_of_the_first(folder: Path) -> None:
    first = start(folder)
    assert first(3.0) == 19.0
    second = start(folder)
    assert second(3.0) == 19.0
    assert (sum(first.stats.cache_misses.values()), sum(second.stats.cache_hits.values())) == (1, 1)


@pytest.mark.parametrize(
    ("name", "old", "new", "result"),
    [
        ("loops_callee.py", "GAIN *", "GAIN * x *", 31.0),
        ("loops_constants.py", "GAIN = 2.0", "GAIN = 7.0", 34.0),
        ("loops_constants.py", "FIRST = 3", "FIRST = 5", 21.0),
        ("loops_constants.py", "one: float\n    two", "two: float\n    one", 13.0),
        ("loops_numbers.py", "OFFSET = 10.0", "OFFSET = 20.0", 29.0),
        ("loops_caller.py", "+ loops_numbers", "- loops_numbers", -1.0),
    ],
)
def test_change_in_any_of_the_files_compiles_the_caller_again(
    folder: Path, name: str, old: str, new: str, result: float
) -> None:
    assert start(folder)(3.0) == 19.0
    change(folder / name, old, new)
    loop = start(folder)
    assert loop(3.0) == result
    assert sum(loop.stats.cache_misses.values()) == 1


def test_touched_or_copied_sources_are_not_compiled_again(folder: Path) -> None:
    assert start(folder)(3.0) == 19.0
    for name in FILES:
        (folder / name).touch()
    loop = start(folder)
    assert loop(3.0) == 19.0
    assert sum(loop.stats.cache_hits.values()) == 1


def test_without_a_writable_folder_each_process_compiles(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none_found(*_: object) -> None:
        raise RuntimeError("cannot cache function")

    monkeypatch.setattr(numba.core.dispatcher, "FunctionCache", none_found)
    loop = start(folder)
    assert loop(3.0) == 19.0
    assert not any(folder.rglob("*.nbi"))


def test_arrays_and_tuples_of_constants_count() -> None:
    one, other = np.array([1, 2]), np.array([1, 3])
    assert module._identity(one) != module._identity(other)
    assert module._identity((1, (2.0, "a"))) != module._identity((1, (2.0, "b")))
    assert module._identity(1) != module._identity(1.0)
    assert module._identity(print) == ""
