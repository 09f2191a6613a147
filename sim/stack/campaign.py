"""Runs of scenarios with random faults, and the smallest list of faults that still breaks an invariant."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from sim.plant.world import SimulationDiverged
from sim.run.scenario import Scenario
from sim.stack.faults import PlannedFault, load_faults, random_faults
from sim.stack.invariants import Broken
from sim.stack.run import RunFailed, RunOptions, ScheduledRun

RANDOM = "random"
RANDOM_COUNT = 4
# Random faults occur within this time: a scenario's limit may be far behind its end.
RANDOM_WITHIN_S = 60.0
# Names of events that break no invariant but end a run.
NOT_READY, DIVERGED = "run_failed", "physics_diverged"

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run. command: repeats it. digest: empty for an incomplete run.

    rows: codes that /safety/status has shown. overrun_s: see ``Invariants``.
    """

    seed: int
    faults: tuple[PlannedFault, ...]
    broken: tuple[Broken, ...]
    remarks: tuple[str, ...]
    simulated_s: float
    mission_state: str
    digest: str
    command: str
    rows: frozenset[str]
    overrun_s: float

    @property
    def names(self) -> set[str]:
        return {item.name for item in self.broken}


def planned_faults(choice: str, seed: int, scenario: Scenario, until_s: float) -> tuple[PlannedFault, ...]:
    """Those of ``--faults``: empty for none, ``random``, ``random:COUNT``, or a file. Raises ConfigError."""
    if not choice:
        return ()
    kind, _, count = choice.partition(":")
    if kind == RANDOM and (count.isdigit() or not count):
        within_s = min(scenario.limit_s, until_s, RANDOM_WITHIN_S)
        return random_faults(seed, within_s, int(count) if count else RANDOM_COUNT)
    return load_faults(Path(choice))


def command_of(scenario: str, seed: int, faults: str, options: RunOptions) -> str:
    """The command line that repeats a run. scenario, faults: as on the command line."""
    parts = ["robot-stack", "simulate", scenario, "--seed", str(seed)]
    parts += ["--faults", faults] if faults else []
    parts += ["--light"] if options.light else []
    parts += ["--until", f"{options.until_s:g}"] if options.until_s < float("inf") else []
    return shlex.join(parts)


def run_once(scenario: Scenario, seed: int, options: RunOptions, command: str) -> Outcome:
    """Runs ``scenario`` with the faults of ``options``; a failure of the run is an outcome, too."""
    with ScheduledRun(scenario, seed, options) as run:
        failed: tuple[Broken, ...] = ()
        state = digest = ""
        try:
            result = run.run()
            state, digest = str(result.figures["mission_state"]), result.digest
        except (RunFailed, SimulationDiverged) as error:
            name = DIVERGED if isinstance(error, SimulationDiverged) else NOT_READY
            failed = (Broken(name, run.now_s, str(error), ""),)
        seen = run.invariants
        broken, remarks, rows = (*seen.broken, *failed), tuple(seen.remarks), frozenset(seen.rows)
        return Outcome(seed, options.faults, broken, remarks, run.now_s, state, digest, command, rows, seen.overrun_s)


def shrink(items: Sequence[T], fails: Callable[[tuple[T, ...]], bool]) -> tuple[T, ...]:
    """A minimal list of items for which ``fails`` still holds (ddmin, Zeller and Hildebrandt 2002).

    fails: called once for each list; it must hold for all items. No single item of the result can be removed.
    """
    asked: dict[tuple[int, ...], bool] = {}

    def still(chosen: tuple[int, ...]) -> bool:
        if chosen not in asked:
            asked[chosen] = fails(tuple(items[index] for index in chosen))
        return asked[chosen]

    kept, parts = tuple(range(len(items))), 2
    if kept and still(()):
        return ()
    while len(kept) >= 2:
        chunks = _split(kept, parts)
        without = [tuple(index for index in kept if index not in chunk) for chunk in chunks]
        smaller = next((rest for rest in (*chunks, *without) if len(rest) < len(kept) and still(rest)), None)
        if smaller is not None:
            parts = 2 if smaller in chunks else max(parts - 1, 2)
            kept = smaller
        elif parts >= len(kept):
            break
        else:
            parts = min(2 * parts, len(kept))
    return tuple(items[index] for index in kept)


def _split(items: tuple[int, ...], parts: int) -> list[tuple[int, ...]]:
    ends = [round(len(items) * part / parts) for part in range(parts + 1)]
    return [items[a:b] for a, b in itertools.pairwise(ends) if b > a]


def shrunk(
    scenario: Scenario, seed: int, options: RunOptions, names: set[str], log: Callable[[str], None] = lambda _: None
) -> tuple[PlannedFault, ...]:
    """The faults of ``options`` without those that are not needed to break one of the invariants ``names``."""

    def fails(chosen: tuple[PlannedFault, ...]) -> bool:
        outcome = run_once(scenario, seed, replace(options, faults=chosen), "")
        log(f"{len(chosen)} faults: {', '.join(sorted(outcome.names)) or 'nothing broken'}")
        return bool(outcome.names & names)

    return shrink(options.faults, fails)


def describe(outcome: Outcome) -> str:
    """One line for a run that keeps all invariants, several for one that does not."""
    head = f"seed {outcome.seed}: {outcome.simulated_s:.1f} s, mission {outcome.mission_state or 'none'}"
    if not outcome.broken:
        return f"{head}, all invariants hold"
    lines = [f"{head}, {len(outcome.broken)} broken", f"  {outcome.command}"]
    lines += [f"  fault {fault.describe()}" for fault in outcome.faults]
    lines += [f"  {item.describe()}" for item in outcome.broken]
    return "\n".join([*lines, *(f"  remark {text}" for text in outcome.remarks)])
