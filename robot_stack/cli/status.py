"""The table of ``robot-stack status``."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

import psutil
from rich.console import Group
from rich.live import Live

from robot_stack.cli.tables import Column, console, notes, table
from robot_stack.supervisor.progress import pace_text

_COLOURS = {
    "ready": "green",
    "waiting": "yellow",
    "starting": "yellow",
    "backoff": "red",
    "hung": "red",
    "failed": "red",
}
_MIB = 2**20
_SAFETY_STALE_S = 1.0


class StatusView:
    """Adds CPU and memory to the supervisor's answer, and shows it."""

    def __init__(self) -> None:
        self._processes: dict[int, psutil.Process] = {}
        self._console = console()

    def measure(self, status: dict[str, Any]) -> dict[str, Any]:
        """Adds to each process ``cpu_pct`` (of one core, since the last call; None at the first) and ``pss_mb``."""
        for item in status["processes"]:
            item["cpu_pct"], item["pss_mb"] = self._load(item["pid"])
        return status

    def _load(self, pid: int | None) -> tuple[float | None, float | None]:
        if pid is None:
            return None, None
        try:
            known = pid in self._processes
            process = self._processes.setdefault(pid, psutil.Process(pid))
            cpu_pct = process.cpu_percent()
            return (cpu_pct if known else None), process.memory_full_info().pss / _MIB
        except psutil.Error:
            self._processes.pop(pid, None)
            return None, None

    def print(self, status: dict[str, Any]) -> None:
        self._console.print(self.shown(status))

    def follow(self, ask: Callable[[], dict[str, Any]], period_s: float = 1.0) -> None:
        """Updates until Ctrl-C, or until the stack has ended."""
        with contextlib.suppress(KeyboardInterrupt), Live(console=self._console, auto_refresh=False) as live:
            while True:
                live.update(self.shown(self.measure(ask())), refresh=True)
                time.sleep(period_s)

    def shown(self, status: dict[str, Any]) -> Group:
        state = "stopping" if status["stopping"] else "ready" if status["ready"] else "not ready"
        shown = table(f"profile {status['profile']}, ROS domain {status['domain']}: {state}", _COLUMNS)
        for item in status["processes"]:
            shown.add_row(*_cells(item))
        reasons = [(item["name"], item["reason"]) for item in status["processes"] if item["reason"]]
        return Group(shown, notes(reasons, "yellow"), notes(_summary(status)))


_COLUMNS: tuple[Column, ...] = (
    ("process", "left"),
    ("pid", "right"),
    ("state", "left"),
    ("restarts", "right"),
    ("heartbeat", "right"),
    ("cpu", "right"),
    ("memory", "right"),
)


def _safety(safety: dict[str, Any]) -> str:
    if safety["age_s"] > _SAFETY_STALE_S:
        return f"no status of the safety monitor for {safety['age_s']:.0f} s"
    return f"{safety['state']}{': ' + ', '.join(safety['faults']) if safety['faults'] else ''}"


def _cells(item: dict[str, Any]) -> list[str]:
    colour = _COLOURS.get(item["state"], "white")
    return [
        item["name"],
        str(item["pid"] or "-"),
        f"[{colour}]{item['state']}[/]",
        str(item["restarts"]),
        _number(item["heartbeat_age_s"], "{:.1f} s"),
        _number(item["cpu_pct"], "{:.0f} %"),
        _number(item["pss_mb"], "{:.0f} MB"),
    ]


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def _summary(status: dict[str, Any]) -> list[tuple[str, str]]:
    cpu_pct = sum(item["cpu_pct"] or 0.0 for item in status["processes"])
    memory_mb = sum(item["pss_mb"] or 0.0 for item in status["processes"])
    lines = [("together", f"{cpu_pct / 100.0:.2f} cores, {memory_mb:.0f} MB"), ("logs", status["log_dir"])]
    if status["safety"]:
        lines.insert(0, ("safety", _safety(status["safety"])))
    if pace_text(status):
        lines.append(("world", f"{pace_text(status)}: the world waits for nodes that lack processor time"))
    if status["missing"]:
        lines.append(("not built", ", ".join(status["missing"])))
    if status["without_node"]:
        lines.append(("ROS", status["without_node"]))
    return lines
