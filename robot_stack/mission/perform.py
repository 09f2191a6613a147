"""Executes the kernel's effects through ports, in their order."""

from __future__ import annotations

from typing import Protocol

from robot_stack.core.goals import SendGoal
from robot_stack.core.mission import Kind
from robot_stack.mission.events import (
    CancelDocking,
    CancelGoal,
    Effect,
    Event,
    Inputs,
    JournalFailed,
    PublishEmergencyStop,
    ReportQueue,
    ReportStatus,
    SaveRecord,
    StartDocking,
    Status,
    WarnOfDeparture,
)
from robot_stack.mission.kernel import MissionKernel
from robot_stack.mission.orders import QueueReport
from robot_stack.mission.record import Record


class JournalError(Exception):
    """The journal cannot be read or written now. The message is one line for people."""


class JournalDamaged(Exception):
    """The journal's content is invalid. It has been moved aside; the message names the new place."""


class Journal(Protocol):
    """Keeps one record across a power cut."""

    def load(self) -> Record:
        """The record saved last, an empty one if none was. Raises JournalError or JournalDamaged."""
        ...

    def save(self, record: Record) -> None:
        """Returns once the record is safe on the disk. Raises JournalError; then the record before is still there."""
        ...


class Outputs(Protocol):
    """Outputs of the mission manager. None of these fails."""

    def send_goal(self, goal: SendGoal) -> None: ...
    def cancel_goal(self, everything: bool) -> None: ...
    def start_docking(self, call: int, kind: Kind, dock_id: str) -> None: ...
    def cancel_docking(self, everything: bool) -> None: ...
    def publish_emergency_stop(self, active: bool) -> None: ...
    def warn_of_departure(self, remaining_s: float) -> None: ...
    def publish_status(self, status: Status) -> None: ...
    def publish_queue(self, report: QueueReport) -> None: ...


class Performer:
    """Passes events to a kernel and executes the effects in their order."""

    def __init__(self, kernel: MissionKernel, journal: Journal, outputs: Outputs) -> None:
        self._kernel = kernel
        self._journal = journal
        self._outputs = outputs

    def start_up(self, inputs: Inputs, now_s: float) -> None:
        self._perform(self._kernel.start_up(inputs), inputs, now_s)

    def handle(self, event: Event, inputs: Inputs, now_s: float) -> None:
        self._perform(self._kernel.step(event, inputs, now_s), inputs, now_s)

    def _perform(self, effects: tuple[Effect, ...], inputs: Inputs, now_s: float) -> None:
        for effect in effects:
            match effect:
                case SaveRecord(record):
                    try:
                        self._journal.save(record)
                    except JournalError as error:
                        self.handle(JournalFailed(str(error)), inputs, now_s)
                        return
                case SendGoal():
                    self._outputs.send_goal(effect)
                case CancelGoal(everything):
                    self._outputs.cancel_goal(everything)
                case StartDocking(call, kind, dock_id):
                    self._outputs.start_docking(call, kind, dock_id)
                case CancelDocking(everything):
                    self._outputs.cancel_docking(everything)
                case PublishEmergencyStop(active):
                    self._outputs.publish_emergency_stop(active)
                case WarnOfDeparture(remaining_s):
                    self._outputs.warn_of_departure(remaining_s)
                case ReportStatus(status):
                    self._outputs.publish_status(status)
                case ReportQueue(report):
                    self._outputs.publish_queue(report)


def load_record(journal: Journal) -> tuple[Record, str]:
    """The journal's record, or an empty one with the problem for people."""
    try:
        return journal.load(), ""
    except JournalDamaged as error:
        return Record(), f"{error}; a mission may have been under way"
    except JournalError as error:
        return Record(), f"the journal cannot be read: {error}"
