"""Imported by the forkserver before the first fork: modules shared by all node processes.

What is imported here costs its time once and its memory once. Only imports without side effects may be here: no thread,
no rclpy context. An import error is left to the process that needs the module; its log shows the error.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import inspect
import os
import sys
from collections.abc import Iterable

from robot_stack.supervisor.child import name_process

MODULES_VARIABLE = "ROBOT_STACK_PRELOAD"  # node modules, joined by commas; set by the supervisor for its forkserver
SERVER_NAME = "stack-forks"  # of the forkserver's process once it has imported everything
_LIBRARIES = (
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
    # The garbage collector would write into every shared page; these objects live as long as the processes anyway.
    gc.collect()
    gc.freeze()
    name_process(SERVER_NAME)


def _prepare_numba() -> None:
    """Initialises numba, which builds its type and function tables at first use: half a second per process."""
    if "numba" not in sys.modules:
        return
    target = importlib.import_module("numba.core.registry").cpu_target
    target.typing_context.refresh()
    target.target_context.refresh()


if MODULES_VARIABLE in os.environ:
    preload(filter(None, os.environ[MODULES_VARIABLE].split(",")))
