"""Random faults, alone and in pairs, in random rides of the whole stack on the deterministic scheduler."""

from __future__ import annotations

import math
import secrets
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

from robot_stack.contract.faults import FAULTS
from sim.stack.campaign import Outcome, command_of, describe, planned_faults, run_once
from sim.stack.choice import RANDOM as RANDOM_RIDE
from sim.stack.choice import choose_scenario
from sim.stack.faults import CHANCES
from sim.stack.run import RunOptions
from tests.benchmarks.support.framework import Aim, Result

KINDS = frozenset(chance.kind for chance in CHANCES)
AIMS = {
    "runs": Aim(">=", 2000),
    "kinds": Aim(">=", len(KINDS)),
    "pairs": Aim(">=", 100),
    "ended_as_declared_pct": Aim(">=", 100.0),
    "worst_overrun_ms": Aim("<", 50.0),
    "invariants_broken": Aim("<=", 0),
}
# Invariants about the fault list; the other invariants concern the robot and its surroundings.
_DECLARED = {"row_not_raised", "action_missing"}
_SEEDS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class _Case:
    scenario: str
    seed: int
    faults: int
    until_s: float


def run(
    runs: int = 2000,
    first: int = 0,
    scenario: str = RANDOM_RIDE,
    count: int = 0,
    until_s: float = 40.0,
    workers: int = 2,
) -> Result:
    """Runs in simulated time with light sensors. Prints the command to repeat each run that breaks an invariant.

    first: seed of the first run, 0 to draw it. scenario: as for ``robot-stack simulate``. count: faults in each run; 0
    alternates one and two. until_s: length of each run. workers: processes; the figures do not depend on it.
    """
    first = first or 1 + secrets.randbelow(_SEEDS)
    cases = [_Case(scenario, seed, count or 1 + seed % 2, until_s) for seed in range(first, first + runs)]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        outcomes = list(_reported(pool.map(_play, cases), runs))
    return Result(_figures(outcomes), _conditions(cases, outcomes))


def _play(case: _Case) -> Outcome:
    scenario, _ = choose_scenario(case.scenario, case.seed)
    choice = f"random:{case.faults}"
    faults = planned_faults(choice, case.seed, scenario, case.until_s)
    options = RunOptions(light=True, parallel=False, until_s=case.until_s, faults=faults)
    return run_once(scenario, case.seed, options, command_of(case.scenario, case.seed, choice, options))


def _reported(outcomes: Iterable[Outcome], runs: int) -> Iterator[Outcome]:
    """Prints one line per run to stderr, and details of a run that breaks an invariant."""
    for number, outcome in enumerate(outcomes, 1):
        print(f"{number}/{runs} {describe(outcome)}", file=sys.stderr, flush=True)
        yield outcome


def _figures(outcomes: Sequence[Outcome]) -> dict[str, float]:
    declared = sum(not outcome.names & _DECLARED for outcome in outcomes)
    overrun_s = max((outcome.overrun_s for outcome in outcomes), default=-math.inf)
    return {
        "runs": len(outcomes),
        "kinds": len({fault.kind for outcome in outcomes for fault in outcome.faults}),
        "rows": len(_rows(outcomes)),
        "pairs": len({pair for outcome in outcomes if len(pair := _kinds(outcome)) == 2}),
        "ended_as_declared_pct": 100.0 * declared / len(outcomes) if outcomes else math.nan,
        "worst_overrun_ms": 1e3 * overrun_s if math.isfinite(overrun_s) else math.nan,
        "invariants_broken": sum(len(outcome.broken) for outcome in outcomes),
        "simulated_h": sum(outcome.simulated_s for outcome in outcomes) / 3600.0,
    }


def _kinds(outcome: Outcome) -> tuple[str, ...]:
    return tuple(sorted(fault.kind for fault in outcome.faults))


def _rows(outcomes: Iterable[Outcome]) -> set[str]:
    return {code for outcome in outcomes for code in outcome.rows}


def _conditions(cases: Sequence[_Case], outcomes: Sequence[Outcome]) -> dict[str, object]:
    codes = {row.code for row in FAULTS}
    return {
        "runs": f"seeds {cases[0].seed} to {cases[-1].seed}, scenario {cases[0].scenario}, light sensors, at most "
        f"{cases[0].until_s:g} simulated s each; {cases[0].faults} and {cases[-1].faults} faults",
        "kinds": f"of the {len(KINDS)} kinds of faults that are drawn",
        "rows": f"of the {len(codes)} rows of the fault list shown by /safety/status; "
        f"never: {' '.join(sorted(codes - _rows(outcomes)))}",
        "pairs": "different pairs of kinds raised in one run",
        "ended_as_declared_pct": "runs in which each row whose condition is known was raised in time and had its "
        "action",
        "worst_overrun_ms": "how much later than its limit a row was raised at worst; negative: all in time",
        "seeds_that_break": [outcome.seed for outcome in outcomes if outcome.broken],
        "broken": dict(Counter(name for outcome in outcomes for name in sorted(outcome.names))),
        "cases": [describe(outcome) for outcome in outcomes if outcome.broken],
        "peer": "none",
    }
