"""The latched emergency stop on file, so that it outlives a crash of the monitor.

One small JSON file in the runtime folder (in memory: no disk to wait for), replaced in one step. A file that cannot
be understood means that nobody knows what was latched: the monitor then comes up in emergency stop with a passenger.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

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
            return _decode(json.loads(self._path.read_bytes()))
        except FileNotFoundError:
            return Memory()
        except (OSError, ValueError):
            return UNKNOWN_PAST

    def save(self, memory: Memory) -> None:
        """Replaces the file. Raises OSError."""
        beside = self._path.with_name(f"{self._path.name}.new")
        beside.write_bytes(json.dumps({"latched": memory.latched, "passenger": memory.passenger}).encode())
        os.replace(beside, self._path)


def _decode(data: Any) -> Memory:
    if not isinstance(data, dict) or set(data) != {"latched", "passenger"}:
        return UNKNOWN_PAST
    latched, passenger = data["latched"], data["passenger"]
    if not isinstance(passenger, bool) or not isinstance(latched, list):
        return UNKNOWN_PAST
    if not all(isinstance(code, str) and code in faults.BY_CODE for code in latched):
        return UNKNOWN_PAST
    return Memory(tuple(latched), passenger)
