"""The safety state in the supervisor."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Safety:
    """The last status of the safety monitor, ``age_s`` ago; ``received`` counts its messages."""

    state: str
    emergency: bool
    faults: tuple[str, ...]
    age_s: float
    received: int
