"""Imported by the forkserver, before the first fork: everything that all node processes share.

What is imported here costs its time once and its memory once. Only imports without side effects may be here: no thread,
no rclpy context. A module that cannot be imported is left to the process that needs it, whose log then tells why.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import inspect
import os
import sys
from collections.abc import Iterable

MODULES_VARIABLE = "ROBOT_STACK_PRELOAD"  # node modules, joined by commas; set by the supervisor for its forkserver
_LIBRARIES = (
    "robot_stack.supervisor.child",
    "numpy",
    "rclpy",
    "robot_stack.middleware.node",
    "robot_stack.ros.process",
)


def preload(modules: Iterable[str]) -> None:
    for name in (*_LIBRARIES, *modules):
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    with contextlib.suppress(Exception):
        importlib.import_module("robot_stack.supervisor.node").load_type_supports()
    with contextlib.suppress(Exception):
        _prepare_numba()
    # rclpy looks up the module of a log line; the first time this goes through all modules: 0.04 s in each process.
    inspect.getmodule(sys._getframe())
    # The collector would write into every shared page; what is here lives as long as the processes anyway.
    gc.collect()
    gc.freeze()


def _prepare_numba() -> None:
    """Numba learns the types and functions it knows at its first use: half a second in each process with loops."""
    if "numba" not in sys.modules:
        return
    target = importlib.import_module("numba.core.registry").cpu_target
    target.typing_context.refresh()
    target.target_context.refresh()


if MODULES_VARIABLE in os.environ:
    preload(filter(None, os.environ[MODULES_VARIABLE].split(",")))
