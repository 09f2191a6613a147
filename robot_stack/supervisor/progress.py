"""The processes that a start still waits for, in one line for people."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from robot_stack.core.world_clock import slow_text

# Period of new lines if the output is not a terminal.
_SHOW_EVERY_S = 5.0


def waiting_for(status: dict[str, Any]) -> str:
    """Processes that are not ready, with their present step; empty if all are ready."""
    return ", ".join(
        f"{item['name']} ({item['reason']})" if item["reason"] else item["name"]
        for item in status["processes"]
        if item["state"] != "ready"
    )


def pace_text(status: dict[str, Any]) -> str:
    """``simulation at 0.7x`` if the simulated world is slower than it should be, and the nodes it waits for."""
    pace = status.get("sim_pace")
    slow = "" if pace is None else slow_text(pace, status["sim_speed"])
    waits_for = status.get("sim_waits_for")
    return f"simulation waits for {waits_for}" if waits_for else slow


@contextmanager
def shown() -> Iterator[Callable[[dict[str, Any]], None]]:
    """Shows each status it is given on stderr: on a terminal a line that changes, elsewhere a line now and then."""
    if not sys.stderr.isatty():
        yield _Lines().show
        return
    from rich.console import Console

    with Console(stderr=True).status("starting") as line:
        yield lambda status: line.update(_text(status))


class _Lines:
    def __init__(self) -> None:
        self._shown_s = time.monotonic()

    def show(self, status: dict[str, Any]) -> None:
        if time.monotonic() - self._shown_s >= _SHOW_EVERY_S:
            self._shown_s = time.monotonic()
            print(_text(status), file=sys.stderr, flush=True)


def _text(status: dict[str, Any]) -> str:
    ready = sum(item["state"] == "ready" for item in status["processes"])
    return f"{ready} of {len(status['processes'])} ready; waiting for {waiting_for(status)}"
