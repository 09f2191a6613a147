"""Parameters that every node with a device of the motion engine has."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from robot_stack.core.config import Config
from robot_stack.wmx.session import Patience

Pause = Annotated[float, Field(gt=0.0, le=60.0)]


class LinkParams(Config):
    """See ``Patience``."""

    retry_s: Pause
    attempts: Annotated[int, Field(ge=1)]
    attempt_pause_s: Pause
    probe_period_s: Pause

    def patience(self, **other: Any) -> Patience:
        """other: fields of ``Patience`` that are no parameters."""
        return Patience(self.retry_s, self.attempts, self.attempt_pause_s, self.probe_period_s, **other)


class SessionParams(LinkParams):
    """communication_retry_s, request_pause_s: between repetitions of an unfulfilled request."""

    communication_retry_s: Pause
    request_pause_s: Pause
