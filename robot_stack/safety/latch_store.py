"""The latched emergency stop on file, so that it outlives a crash of the monitor.

One small JSON file in the runtime folder (in memory: no disk to wait for), replaced in one step. A file that cannot
be understood means that nobody knows what was latched: the monitor then comes up in emergency stop with a passenger.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from robot_stack.contract import faults
from robot_stack.safety.monitor import ESTOP_PRESSED, Memory

UNKNOWN_PAST = Memory((ESTOP_PRESSED,), passenger=True)


class LatchStore:
    """Reads and writes the memory of the safety monitor."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> Memory:
        """What was stored; an empty memory if there is no file, ``UNKNOWN_PAST`` if it makes no sense. Never raises."""
        try:
            return _decode(self._path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return Memory()
        except (OSError, ValueError):
            return UNKNOWN_PAST

    def save(self, memory: Memory) -> None:
        """Replaces the file. Raises OSError."""
        text = json.dumps({"latched": list(memory.latched), "passenger": memory.passenger})
        beside = self._path.with_name(f"{self._path.name}.new")
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, self._path)


def _decode(text: str) -> Memory:
    data = json.loads(text)
    if not isinstance(data, dict) or set(data) != {"latched", "passenger"}:
        raise ValueError("not a latch file")
    latched, passenger = data["latched"], data["passenger"]
    if not isinstance(passenger, bool) or not isinstance(latched, list):
        raise ValueError("wrong types")
    if not all(isinstance(code, str) and code in faults.BY_CODE for code in latched):
        raise ValueError("unknown fault code")
    return Memory(tuple(latched), passenger)
