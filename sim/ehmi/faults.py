"""Faults of the simulated display, raised by ``/sim/inject_ehmi_fault``."""

from __future__ import annotations

import re
from collections.abc import Callable

from sim.ehmi.firmware import Firmware
from sim.ehmi.line import DisplayLine
from sim.plant.fault_table import FaultKind, FaultRefused, FaultTable

_ONLY = ("",)
_CODE = re.compile(r"[A-Z0-9_]{1,16}")


def _cable(line: DisplayLine, target: str, value: float | None) -> str:
    if value is None:
        line.plug()
    else:
        line.pull()
    return "the cable is pulled"


def _power(line: DisplayLine, target: str, value: float | None) -> str:
    line.with_firmware(lambda firmware, now_s: firmware.power_on(now_s))
    return "the display restarts"


def _silent(line: DisplayLine, target: str, value: float | None) -> str:
    _set(line, lambda firmware: setattr(firmware.troubles, "silent", value is not None))
    return "the firmware receives but does not answer"


def _garbage(line: DisplayLine, target: str, value: float | None) -> str:
    _set(line, lambda firmware: setattr(firmware.troubles, "garbage", value is not None))
    return "random bytes on the line"


def _half_lines(line: DisplayLine, target: str, value: float | None) -> str:
    _set(line, lambda firmware: setattr(firmware.troubles, "half_lines", value is not None))
    return "every answer breaks off in the middle"


def _noise(line: DisplayLine, target: str, value: float | None) -> str:
    _set(line, lambda firmware: setattr(firmware.troubles, "noise", value or 0.0))
    return f"share of bytes changed on the way: {value}"


def _late(line: DisplayLine, target: str, value: float | None) -> str:
    _set(line, lambda firmware: setattr(firmware.troubles, "late_s", value or 0.0))
    return f"answers come {value} s late"


def _fault_code(line: DisplayLine, target: str, value: float | None) -> str:
    if not _CODE.fullmatch(target):
        raise FaultRefused(f"fault_code: target must be a code of capitals, digits and _, is {target!r}")
    line.with_firmware(lambda firmware, now_s: firmware.set_fault("" if value is None else target, now_s))
    return f"the display reports {target}"


def _set(line: DisplayLine, change: Callable[[Firmware], None]) -> None:
    line.with_firmware(lambda firmware, _: change(firmware))


FAULT_KINDS: tuple[FaultKind, ...] = (
    FaultKind("cable", "the cable is pulled; cleared, it is put back", _ONLY, "none", _cable),
    FaultKind("power", "the display loses its power for a moment", _ONLY, "none", _power, lasts=False),
    FaultKind("silent", "the firmware receives but does not answer", _ONLY, "none", _silent),
    FaultKind("garbage", "random bytes among the answers", _ONLY, "none", _garbage),
    FaultKind("half_lines", "every answer breaks off in the middle", _ONLY, "none", _half_lines),
    FaultKind("noise", "bytes change on the way", _ONLY, "share of bytes", _noise, 0.0, 1.0, 0.02),
    FaultKind("late", "answers come late", _ONLY, "s", _late, 0.0, 10.0, 0.5),
    FaultKind("fault_code", "the display reports a fault with the target as its code", None, "none", _fault_code),
)
BY_NAME = {kind.name: kind for kind in FAULT_KINDS}


class DisplayFaults(FaultTable):
    """The faults in force on one line; their durations are real seconds."""

    def __init__(self, line: DisplayLine) -> None:
        super().__init__(line, BY_NAME)
