"""Compiles every loop of the stack and its simulation for later starts: ``python -m sim.compile``.

A package with compiled functions has a module ``warm_up`` with a function of that name, which runs each of them with
arguments as in use. Its nodes call it while they are constructed; here all are called, found by walking the packages. A
compiled function not reached by any of them is an error: a node would compile it during operation.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import pkgutil
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from types import ModuleType
from typing import Any

from numba.core.dispatcher import Dispatcher

PACKAGES = ("robot_stack", "sim")
_WARM_UP = "warm_up"


def modules() -> Iterator[ModuleType]:
    """All of the packages, imported."""
    for package in PACKAGES:
        path = importlib.import_module(package).__path__
        for item in pkgutil.walk_packages(path, f"{package}."):
            if not item.name.endswith(".__main__"):
                yield importlib.import_module(item.name)


def loops() -> dict[str, Any]:
    """numba's dispatchers by their full names, without those that exist only inside their callers."""
    return {
        f"{module.__name__}.{name}": item
        for module in modules()
        for name, item in vars(module).items()
        if isinstance(item, Dispatcher)
        and item.py_func.__module__ == module.__name__
        and item.targetoptions.get("inline") != "always"
    }


def is_compiled(loop: Any) -> bool:
    """True if a version of its present source is on disk. numba has no public call for this."""
    return bool(loop._cache._cache_file._load_index())


def warm_ups() -> list[str]:
    """Names of the modules."""
    return [module.__name__ for module in modules() if module.__name__.rpartition(".")[2] == _WARM_UP]


def run(name: str) -> str:
    """Calls one of them; returns its name."""
    importlib.import_module(name).warm_up()
    return name


def missing(all_loops: dict[str, Any]) -> list[str]:
    """Names of the loops that are not compiled."""
    return [name for name, loop in all_loops.items() if not is_compiled(loop)]


def main() -> int:
    """Compiles on all cores, reports the progress, and returns the exit code."""
    all_loops = loops()
    shown = len(all_loops) - len(missing(all_loops))
    # Forked: everything is imported already.
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("fork")) as pool:
        for done in as_completed([pool.submit(run, name) for name in warm_ups()]):
            package = done.result().rpartition(".")[0]
            count = len(all_loops) - len(missing(all_loops))
            if count > shown:
                print(f"    {count} of {len(all_loops)} loops: {package}", flush=True)
            shown = count
    left = missing(all_loops)
    if left:
        print(f"compiled functions that no warm_up() reaches: {', '.join(left)}", file=sys.stderr)
    return 1 if left else 0


if __name__ == "__main__":
    raise SystemExit(main())
