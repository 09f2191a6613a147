"""Runs of one scenario with random faults over many seeds, and the smallest list of faults that still breaks one.

``python -m sim.stack.campaign SCENARIO.yaml --seeds 1-20`` prints one line per run, and for a run that breaks an
invariant the command that repeats it.
"""

from __future__ import annotations

import argparse
import itertools
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from sim.plant.world import SimulationDiverged
from sim.run.scenario import Scenario, load_scenario
from sim.stack.faults import PlannedFault, load_faults, plan_text, random_faults
from sim.stack.invariants import Broken
from sim.stack.run import RunFailed, RunOptions, ScheduledRun

RANDOM = "random"
RANDOM_COUNT = 4
# Random faults come within so long: a scenario's limit may be far behind its end.
RANDOM_WITHIN_S = 60.0
# Names of what is no broken invariant, but ends a run all the same.
NOT_READY, DIVERGED = "run_failed", "physics_diverged"

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run. command: repeats it. digest: empty for a run that did not come to its end."""

    seed: int
    faults: tuple[PlannedFault, ...]
    broken: tuple[Broken, ...]
    remarks: tuple[str, ...]
    simulated_s: float
    mission_state: str
    digest: str
    command: str

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
    """The command line that repeats a run. scenario, faults: as they are given there."""
    parts = ["robot-stack", "simulate", scenario, "--seed", str(seed)]
    parts += ["--faults", faults] if faults else []
    parts += ["--light"] if options.light else []
    parts += ["--until", f"{options.until_s:g}"] if options.until_s < float("inf") else []
    return shlex.join(parts)


def run_once(scenario: Scenario, seed: int, options: RunOptions, command: str) -> Outcome:
    """Runs ``scenario`` with the faults of ``options``; its own failure is an outcome too."""
    with ScheduledRun(scenario, seed, options) as run:
        try:
            result = run.run()
        except (RunFailed, SimulationDiverged) as error:
            name = DIVERGED if isinstance(error, SimulationDiverged) else NOT_READY
            broken = (*run.invariants.broken, Broken(name, run.now_s, str(error), ""))
            return Outcome(seed, options.faults, broken, tuple(run.invariants.remarks), run.now_s, "", "", command)
        return Outcome(
            seed,
            options.faults,
            tuple(result.broken),
            tuple(run.invariants.remarks),
            result.simulated_s,
            str(result.figures["mission_state"]),
            result.digest,
            command,
        )


def campaign(path: Path, seeds: Iterable[int], options: RunOptions, count: int = RANDOM_COUNT) -> Iterator[Outcome]:
    """One run with random faults for each seed. Raises ConfigError."""
    scenario = load_scenario(path)
    choice = RANDOM if count == RANDOM_COUNT else f"{RANDOM}:{count}"
    for seed in seeds:
        chosen = replace(options, faults=planned_faults(choice, seed, scenario, options.until_s))
        yield run_once(scenario, seed, chosen, command_of(str(path), seed, choice, options))


def shrink(items: Sequence[T], fails: Callable[[tuple[T, ...]], bool]) -> tuple[T, ...]:
    """The items without those that may be left out, so that ``fails`` still holds (ddmin, Zeller and Hildebrandt 2002).

    fails: is asked once for each list; it must hold for all items. Of the result no single item can be left out.
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", type=Path)
    parser.add_argument("--seeds", default="1-10", help="FIRST-LAST")
    parser.add_argument("--count", type=int, default=RANDOM_COUNT, help="faults in each run")
    parser.add_argument("--until", type=float, default=float("inf"), help="simulated s")
    parser.add_argument("--full", action="store_true", help="all LiDAR beams and all pictures")
    parser.add_argument("--shrink", type=Path, help="folder for the smallest list of faults of each broken run")
    chosen = parser.parse_args()
    first, _, last = chosen.seeds.partition("-")
    options = RunOptions(light=not chosen.full, until_s=chosen.until)
    totals: Counter[str] = Counter()
    for outcome in campaign(chosen.scenario, range(int(first), int(last or first) + 1), options, chosen.count):
        print(describe(outcome), flush=True)
        totals.update(outcome.names)
        if outcome.broken and chosen.shrink:
            full = replace(options, faults=outcome.faults)
            fewer = shrunk(load_scenario(chosen.scenario), outcome.seed, full, outcome.names)
            file = chosen.shrink / f"{chosen.scenario.stem}-{outcome.seed}.yaml"
            file.write_text(plan_text(fewer), encoding="utf-8")
            print(f"  shrunk: {command_of(str(chosen.scenario), outcome.seed, str(file), options)}", flush=True)
    print("runs that broke", ", ".join(f"{name}: {number}" for name, number in totals.most_common()) or "nothing")


if __name__ == "__main__":
    main()
