"""Tolerances of a replay, ``config/replay.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.contract import topics
from robot_stack.core.config import Config

_Share = Annotated[float, Field(ge=0.0, le=1.0)]
_NotNegative = Annotated[float, Field(ge=0.0)]


class Tolerance(Config):
    """absolute, relative: of a number. time_s: of a message's departure and of times in it. elements: share of an
    array's elements that may differ. unmatched: share of the messages that need no counterpart. count: by which the
    numbers of messages may differ.
    """

    absolute: _NotNegative
    relative: _NotNegative
    time_s: Annotated[float, Field(ge=0.0, le=10.0)]
    elements: _Share
    unmatched: _Share
    count: Annotated[int, Field(ge=0)]


class RowTolerance(Config):
    """Fields that differ from the default."""

    absolute: _NotNegative | None = None
    relative: _NotNegative | None = None
    time_s: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    elements: _Share | None = None
    unmatched: _Share | None = None
    count: Annotated[int, Field(ge=0)] | None = None


class ReplayParams(Config):
    """settle_s: outputs are compared from this long after the start of a node or of the recording. rows: by topic."""

    settle_s: Annotated[float, Field(ge=0.0, le=600.0)]
    default: Tolerance
    rows: dict[str, RowTolerance]

    @model_validator(mode="after")
    def _known_rows(self) -> ReplayParams:
        if unknown := sorted(set(self.rows) - {row.name for row in topics.TOPICS}):
            raise ValueError(f"rows: {', '.join(unknown)}: no topic of the contract")
        return self

    def of(self, topic: str) -> Tolerance:
        own = self.rows.get(topic)
        return self.default if own is None else self.default.model_copy(update=own.model_dump(exclude_none=True))
