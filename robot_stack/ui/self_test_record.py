"""Results of the guided self test, and whether the next one is due. Times are seconds of the system clock (UTC)."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from robot_stack.ui.self_test import End, Reason, Verdict

Text = Annotated[str, StringConstraints(max_length=200)]


class Record(BaseModel):
    """at_s: when the test ended; at: the same in ISO 8601. who: page, its address and role.

    step, reason: where and why it ended early.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    at_s: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    at: Text
    who: Text
    verdict: Verdict
    duration_s: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    step: Text = ""
    reason: Reason | None = None


class Memory(BaseModel):
    """The last test, and the last one that passed."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    last: Record | None = None
    passed: Record | None = None


def new_record(end: End, who: str, at_s: float, at: str) -> Record:
    return Record(
        at_s=at_s,
        at=at,
        who=who[:200],
        verdict=end.verdict,
        duration_s=round(end.duration_s, 1),
        step=end.step,
        reason=end.reason,
    )


def after(memory: Memory, record: Record) -> Memory:
    """The memory with one more test."""
    return Memory(last=record, passed=record if record.verdict is Verdict.PASSED else memory.passed)


def parse_memory(text: str) -> Memory:
    """Empty if the text is no memory: then a test is due."""
    try:
        return Memory.model_validate_json(text)
    except ValidationError:
        return Memory()


def age_h(memory: Memory, now_s: float) -> float:
    """Hours since the last test that passed; infinite without one, or if its time is in the future."""
    if memory.passed is None:
        return math.inf
    hours = (now_s - memory.passed.at_s) / 3600.0
    return hours if hours >= 0.0 else math.inf


def failed(memory: Memory) -> bool:
    """True if the last test failed."""
    return memory.last is not None and memory.last.verdict is Verdict.FAILED


def is_due(memory: Memory, now_s: float, due_h: float) -> bool:
    """True if the last test failed, or the last pass is older than ``due_h``; never if that is 0."""
    return due_h > 0.0 and (failed(memory) or age_h(memory, now_s) > due_h)
