"""Checks that a running stack compiles nothing, because the set-up has compiled everything."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.processes import ROOT

_SET_UP = ROOT / ".venv/.setup/loops"
_ENTRY = re.compile(r"^\[cache\] data (loaded from|saved to) '(.*)'$", re.MULTILINE)


def tell_what_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes started from now on log every access to numba's cache."""
    monkeypatch.setenv("NUMBA_DEBUG_CACHE", "1")


def assert_set_up_compiled_everything(logs: Path) -> None:
    """logs: the folder of a stack's runs. Loops that another test compiled since the set-up do not count."""
    entries = [entry for log in logs.rglob("*.log") for entry in _ENTRY.findall(log.read_text(errors="replace"))]
    assert entries, f"no compiled loop was used, or {logs} has no logs"
    saved = {Path(path).name for what, path in entries if what == "saved to"}
    assert not saved, f"compiled while the stack ran: {sorted(saved)}"
    set_up_s = _SET_UP.stat().st_mtime
    late = {Path(path).name for _, path in entries if Path(path).stat().st_mtime > set_up_s}
    assert not late, f"compiled, but not by launch_scripts/setup: {sorted(late)}"
