"""The simulated engine on virtual drives that a test can break: ``engine_with_faults.py ORDERS_FILE``.

The file holds JSON, read again whenever it changes: {"alarms": {"0": 33}, "stubborn": true, "connected": false}.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import robot_stack.wmx.simulated.__main__ as engine_process
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from robot_stack.wmx.simulated.virtual_drives import VirtualDrives

ORDERS = Path(sys.argv.pop(1))
_LOOK_EVERY_CYCLES = 5


class BreakableDrives(VirtualDrives):
    _cycles = 0
    _seen_ns = 0

    def exchange(self, out: DriveCommands, inp: DriveFeedback) -> bool:
        self._cycles += 1
        if self._cycles % _LOOK_EVERY_CYCLES == 0 and ORDERS.exists():
            changed_ns = os.stat(ORDERS).st_mtime_ns
            if changed_ns != self._seen_ns:
                self._seen_ns = changed_ns
                self._obey(json.loads(ORDERS.read_text(encoding="ascii")))
        return super().exchange(out, inp)

    def _obey(self, orders: dict[str, object]) -> None:
        self.connected = bool(orders.get("connected", True))
        self.stubborn = bool(orders.get("stubborn", False))
        for axis, code in dict(orders.get("alarms", {})).items():  # type: ignore[call-overload]
            self.alarms[int(axis)] = code


engine_process.VirtualDrives = BreakableDrives  # type: ignore[misc]
sys.exit(engine_process.main())
