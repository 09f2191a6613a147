"""Waiting for the drives without blocking: generators that read the status at every step."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable

from robot_stack.wmx.api import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.general.device import SETTLED_CYCLES, Device

Clock = Callable[[], float]
Decided = Callable[[StatusSnapshot, int], int | None]
"""The result code of an axis, 0 for success; None while it is moving."""


class Waits:
    """Waits of one device on one steady clock."""

    def __init__(self, device: Device, clock: Clock) -> None:
        self._device, self._clock = device, clock

    def until(
        self,
        axes: Iterable[int],
        decided: Decided,
        timeout_s: float,
        late: int = CoreMotionErrorCode.WaitTimeout,
    ) -> Generator[None, None, dict[int, int]]:
        """The code per axis, ``late`` for an undecided one. First waits some cycles, so that earlier requests show."""
        pending, codes = list(axes), dict[int, int]()
        deadline_s = self._clock() + timeout_s
        since: int | None = None
        while pending:
            code, snapshot = self._device.read()
            if snapshot is not None and not snapshot.communicating:
                code = ErrorCode.CommNotStarted
            if code:
                return codes | dict.fromkeys(pending, code)
            assert snapshot is not None
            since = snapshot.cycle_counter if since is None else since
            if snapshot.cycle_counter > since + SETTLED_CYCLES:
                for axis in list(pending):
                    result = decided(snapshot, axis)
                    if result is not None:
                        codes[axis] = result
                        pending.remove(axis)
            if pending and self._clock() >= deadline_s:
                return codes | dict.fromkeys(pending, int(late))
            if pending:
                yield
        return codes

    def engine(
        self, reached: Callable[[StatusSnapshot], bool], timeout_s: float, late: int
    ) -> Generator[None, None, int]:
        """0 once the engine's state is ``reached``, ``late`` on a timeout, or the code of a read error."""
        deadline_s = self._clock() + timeout_s
        while True:
            code, snapshot = self._device.read()
            if snapshot is None:
                return code
            if reached(snapshot):
                return ErrorCode.PyNone
            if self._clock() >= deadline_s:
                return late
            yield
