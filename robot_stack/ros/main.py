"""Starts one process of the contract's table: ``python -m robot_stack.ros.main <node> [--ros-args ...]``."""

from __future__ import annotations

import importlib
import sys

from robot_stack.contract.model import Process
from robot_stack.contract.processes import BY_NAME, available


def main(name: str) -> None:
    """Runs the process ``name`` with the command line that follows it. Exits 2 for a name that cannot run."""
    process = BY_NAME.get(name)
    if process is None or process.module is None:
        why = "is not built yet" if process else "is not a node of this stack"
        known = ", ".join(item.name for item in available())
        print(f"error: {name} {why}; nodes that can run: {known}", file=sys.stderr)
        raise SystemExit(2)
    run(process)


def run(process: Process) -> None:
    """Runs a process until a signal, by the ``main`` of its module or, without one, its node; exits with its code."""
    host = getattr(importlib.import_module(str(process.module)), "main", None)
    if host is None:
        node = importlib.import_module("robot_stack.middleware.node").node_class(process)
        raise SystemExit(importlib.import_module("robot_stack.ros.process").run_nodes(node, bulk=node.bulk))
    host()


if __name__ == "__main__":
    if len(sys.argv) < 2:
        print("usage: python -m robot_stack.ros.main <node> [--ros-args ...]", file=sys.stderr)
        raise SystemExit(2)
    node_name = sys.argv.pop(1)
    main(node_name)
