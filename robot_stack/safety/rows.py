"""One row of the fault list over time: raised at once, cleared after a delay, or latched until a reset."""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.contract.model import Clears, Fault, SafetyAction, SafetyState
from robot_stack.core.limits import SpeedLimit
from robot_stack.safety.inputs import CLEAR, Finding, Level
from robot_stack.safety.timing import Hold


@dataclass(frozen=True, slots=True)
class ActiveRow:
    """A row in force. limit: the speed limit of a LIMIT action."""

    code: str
    action: SafetyAction
    state: SafetyState
    limit: SpeedLimit | None
    detail: str


class Row:
    """The state of one row. ``latched`` True: it was latched before a restart of the monitor."""

    def __init__(self, fault: Fault, latched: bool = False) -> None:
        self._fault = fault
        self._latched = latched
        # _found is the newest finding that raised the row, _newest the newest of all.
        self._found = Finding(Level.PRESENT, detail="latched before a restart") if latched else CLEAR
        self._newest = self._found
        self._gone_for = Hold()

    @property
    def code(self) -> str:
        return self._fault.code

    @property
    def latched(self) -> bool:
        return self._latched

    @property
    def action(self) -> SafetyAction:
        """The action in force, NONE while the row is not raised."""
        return self._fault.action if self._latched else self._found.action

    def update(self, finding: Finding, now_s: float) -> None:
        """Processes the present finding of the row's condition."""
        self._newest = finding
        gone_for_s = self._gone_for.update(finding.level is Level.CLEAR, now_s)
        if finding.level >= Level.WAITING:
            self._found = finding
            self._latched |= finding.level is Level.PRESENT and self._fault.clears is Clears.ON_RESET
        elif gone_for_s is not None and gone_for_s >= self._fault.clear_after_s and not self._latched:
            self._found = CLEAR

    def active(self) -> ActiveRow | None:
        """The row as it is in force, None while it is not raised."""
        if self.action is SafetyAction.NONE:
            return None
        waiting = self._found.level is Level.WAITING and not self._latched
        state = SafetyState.DEGRADED if waiting else self._fault.state
        return ActiveRow(self.code, self.action, state, self._found.limit, self._found.detail)

    def blocks_release(self) -> str:
        """Why a reset cannot release this row, empty if it can or need not."""
        if not self._latched or self._newest.level is Level.CLEAR:
            return ""
        return f"{self.code}: {'cannot be evaluated' if self._newest.level is Level.UNKNOWN else self._found.detail}"

    def release(self) -> None:
        """Ends the latch. Only after ``blocks_release`` was empty."""
        self._latched, self._found = False, CLEAR
