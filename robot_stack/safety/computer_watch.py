"""The robot's computer by ``/robot_status`` and ``/system/temperature``, and the links to displays and screens.

Numbers that are NaN (unknown) or out of range count as not received.
"""

from __future__ import annotations

import math

from robot_stack.safety.inputs import ComputerState
from robot_stack.safety.timing import Hold, age_s
from robot_stack.safety.watches import Latest

_PERCENT = (0.0, 100.0)
# Outside these bounds a thermal zone is a broken sensor.
_CELSIUS = (-60.0, 250.0)


class ComputerWatch:
    """All times are steady seconds.

    cpu_high_percent: above it the processor counts as busy. status_stale_s, temperature_stale_s: older is unknown.
    """

    def __init__(self, cpu_high_percent: float, status_stale_s: float, temperature_stale_s: float) -> None:
        self._cpu_high_percent = cpu_high_percent
        self._status_stale_s, self._temperature_stale_s = status_stale_s, temperature_stale_s
        self._temperature = Latest(*_CELSIUS)
        self._cpu, self._memory, self._disk = Latest(*_PERCENT), Latest(*_PERCENT), Latest(*_PERCENT)
        self._busy_for = Hold()

    def usage(self, cpu_percent: float, memory_percent: float, disk_percent: float, now_s: float) -> None:
        self._cpu.received(cpu_percent, now_s)
        self._memory.received(memory_percent, now_s)
        self._disk.received(disk_percent, now_s)

    def temperature(self, temperature_c: float, now_s: float) -> None:
        self._temperature.received(temperature_c, now_s)

    def state(self, now_s: float) -> ComputerState:
        """Call at every step: the processor's busy time is counted from step to step."""
        cpu_percent = _fresh(self._cpu, now_s, self._status_stale_s)
        return ComputerState(
            temperature_c=_fresh(self._temperature, now_s, self._temperature_stale_s),
            cpu_percent=cpu_percent,
            cpu_high_for_s=self._busy_for.update(cpu_percent > self._cpu_high_percent, now_s) or 0.0,
            memory_percent=_fresh(self._memory, now_s, self._status_stale_s),
            disk_percent=_fresh(self._disk, now_s, self._status_stale_s),
        )


def _fresh(latest: Latest, now_s: float, stale_s: float) -> float:
    return latest.value if latest.age_s(now_s) <= stale_s else math.nan


class LinkWatch:
    """Silence of a link that a process maintains.

    expected: the process is one of the expected ones; else the link is not monitored.
    required: the link must come up by itself, counted from the process's first heartbeat: before that NODE_DEAD
        reports the process. Else it is monitored only after it has been up.
    """

    def __init__(self, expected: bool, required: bool = True) -> None:
        self._expected, self._required = expected, required
        self._at_s: float | None = None

    def process_heard(self, now_s: float) -> None:
        """A heartbeat of the process."""
        if self._required and self._at_s is None:
            self._at_s = now_s

    def alive(self, now_s: float) -> None:
        """A heartbeat from the other end of the link."""
        self._at_s = now_s

    def status(self, linked: bool, now_s: float) -> None:
        """A status of the process: a link that is not up is silent."""
        if linked:
            self.alive(now_s)

    def silent_s(self, now_s: float) -> float | None:
        """Seconds of silence; None while the link is not monitored."""
        return age_s(now_s, self._at_s) if self._expected and self._at_s is not None else None
