"""The table of ``robot-stack status``."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable
from typing import Any

import psutil
from rich.console import Console
from rich.live import Live
from rich.table import Table

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
        # A pipe has no width; wrapped reasons there would be hard to search.
        self._console = Console() if sys.stdout.isatty() else Console(width=160)

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
        self._console.print(self._table(status))

    def follow(self, ask: Callable[[], dict[str, Any]], period_s: float = 1.0) -> None:
        """Until Ctrl-C, or until the stack is gone."""
        with contextlib.suppress(KeyboardInterrupt), Live(console=self._console, auto_refresh=False) as live:
            while True:
                live.update(self._table(self.measure(ask())), refresh=True)
                time.sleep(period_s)

    def _table(self, status: dict[str, Any]) -> Table:
        state = "stopping" if status["stopping"] else "ready" if status["ready"] else "not ready"
        table = Table(
            title=f"profile {status['profile']}, ROS domain {status['domain']}: {state}{_safety(status['safety'])}",
            caption=_caption(status),
            caption_justify="left",
        )
        for name, justify in _COLUMNS:
            table.add_column(name, justify=justify, no_wrap=bool(name))  # type: ignore[arg-type]
        for item in status["processes"]:
            table.add_row(*_cells(item))
        return table


_COLUMNS = (
    ("process", "left"),
    ("pid", "right"),
    ("state", "left"),
    ("restarts", "right"),
    ("heartbeat", "right"),
    ("cpu", "right"),
    ("memory", "right"),
    ("", "left"),
)


def _safety(safety: dict[str, Any] | None) -> str:
    if safety is None:
        return ""
    if safety["age_s"] > _SAFETY_STALE_S:
        return f"; the safety monitor is silent for {safety['age_s']:.0f} s"
    return f"; {safety['state']}{' (' + ', '.join(safety['faults']) + ')' if safety['faults'] else ''}"


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
        item["reason"],
    ]


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def _caption(status: dict[str, Any]) -> str:
    cpu_pct = sum(item["cpu_pct"] or 0.0 for item in status["processes"])
    memory_mb = sum(item["pss_mb"] or 0.0 for item in status["processes"])
    lines = [f"together {cpu_pct / 100.0:.2f} cores, {memory_mb:.0f} MB; logs {status['log_dir']}"]
    if status["missing"]:
        lines.append(f"not built: {', '.join(status['missing'])}")
    if status["deaf"]:
        lines.append(f"[red]{status['deaf']}[/]")
    return "\n".join(lines)
