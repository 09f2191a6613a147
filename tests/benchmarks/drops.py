"""Edges in the robot's way, and ways that may be driven, with and without a wheelchair: over the edge, false stops."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from tests.benchmarks.support import drops_cases as cases
from tests.benchmarks.support.drops_run import Outcome, play
from tests.benchmarks.support.framework import Aim, Result

AIMS = {"over_the_edge": Aim("<=", 0.0), "false_stops": Aim("<=", 0.0)}
# Not used for tuning.
_FIRST_SEED = 41_001


def run(drops: int = cases.ROUND, passable: int = 24, first: int = _FIRST_SEED, workers: int = 1) -> Result:
    """Runs perception, safety monitor and drive in simulated time behind the simulated LiDARs, without ROS.

    drops: 70 cover each direction and depth, with and without the chair. passable: number of routes. first: seed of the
    first run. workers: processes; the figures do not depend on it.
    """
    drawn = [cases.drop(number, first + number) for number in range(drops)]
    open_ways = [cases.passable(number, first + drops + number) for number in range(passable)]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        played = list(pool.map(play, [*drawn, *open_ways]))
    fell, driven = played[:drops], played[drops:]
    return Result(_figures(fell, driven), _conditions(fell, driven, first))


def _figures(fell: Sequence[Outcome], driven: Sequence[Outcome]) -> dict[str, float]:
    over = [outcome for outcome in fell if outcome.over]
    figures = {
        "drops": len(fell),
        "over_the_edge": len(over),
        "over_the_edge_with_chair": sum(outcome.case.chair for outcome in over),
        "speed_at_the_edge_max_mps": max((outcome.at_mps for outcome in over), default=0.0),
        "ways": len(driven),
        "false_stops": sum(not outcome.passed for outcome in driven),
    }
    return {name: float(value) for name, value in figures.items()}


def _conditions(fell: Sequence[Outcome], driven: Sequence[Outcome], first: int) -> dict[str, object]:
    return {
        "seeds": f"{first} to {first + len(fell) + len(driven) - 1}",
        "drops": f"{cases.DEPTHS_M} m deep, {cases.WIDTHS_M} m wide, {', '.join(dict.fromkeys(cases.DIRECTIONS))}; "
        "some with a ramp beside; upright sides, dry ground",
        "ways": f"{', '.join(cases.PASSABLE)}: ramps of 4 to 10 deg, a kerb down of 3 cm; every second six with chair",
        "over_the_edge": "runs in which a wheel or castor was over an edge, by ground truth",
        "false_stops": "paths on which the limit became 0, or whose end was not reached",
        "robot": "kinematic on four wheels, the chair on its castors; with the chair it has come from 3 m behind",
        "over_cases": [_reported(outcome) for outcome in fell if outcome.over],
        "false_stop_cases": [_reported(outcome) for outcome in driven if not outcome.passed],
        "peer": "none",
    }


def _reported(outcome: Outcome) -> str:
    case = outcome.case
    return (
        f"seed {case.seed}: {case.what}{' with chair' if case.chair else ''}: {outcome.at_mps:.2f} m/s after "
        f"{outcome.distance_m:.1f} m, {outcome.reason}; {' | '.join(outcome.stops)}"
    )
