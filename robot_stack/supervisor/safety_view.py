"""What the supervisor knows of the safety state."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Safety:
    """What the safety monitor said last, ``age_s`` ago; ``received`` counts its messages."""

    state: str
    emergency: bool
    faults: tuple[str, ...]
    age_s: float
    received: int
