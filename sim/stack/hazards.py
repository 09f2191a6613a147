"""Where faults, invariants and the shrinking of a fault list join a run of ``robot-stack simulate``.

PLUG: sim/stack/faults.py, invariants.py and campaign.py are connected here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from robot_stack.core.config import ConfigError
from sim.stack.run import ScheduledRun

RANDOM = "random"


@dataclass(slots=True)
class Hazards:
    """The faults of one run, and the invariants that it broke, one line each, in order."""

    faults: tuple[Any, ...] = ()
    broken: list[str] = field(default_factory=list)

    def attach(self, run: ScheduledRun) -> None:
        """Called inside the run's context, before its start. An invariant that breaks appends to ``broken``.

        PLUG: inject ``faults`` into ``run.stack``, and add the observer of the invariants to its scheduler.
        """

    def fresh(self) -> Hazards:
        """The same faults for another run."""
        return replace(self, broken=[])


def choose_hazards(option: str | None, seed: int, duration_s: float) -> Hazards:
    """The faults of ``--faults``: None for none, ``random`` for those of the seed, or a file. Raises ConfigError.

    PLUG: ``random_faults(seed, duration_s)`` and ``load_faults(path)`` of sim.stack.faults.
    """
    if option is None:
        return Hazards()
    if option != RANDOM and not Path(option).is_file():
        raise ConfigError(f"--faults: must be {RANDOM} or a file, and there is no file {option}")
    raise ConfigError("--faults: the table of faults is not part of this version")
