"""Runs of the whole stack on the scheduler with faults requested by tests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sim.run.scenario import Scenario
from sim.stack.run import RunOptions, ScheduledRun
from tests.simulated.shared import shareable

OPEN_GROUND = {"x_m": -0.3, "y_m": 8.8, "yaw_deg": 0.0}
STAGING = {"x_m": -2.05, "y_m": 11.0, "yaw_deg": 180.0}
AHEAD = {"x_m": 5.0, "y_m": 8.8, "yaw_deg": 0.0}


def scenario(start: dict[str, float], **content: Any) -> Scenario:
    fixed = {"description": "test", "world": "yard", "seed": 1, "limit_s": 120.0}
    return Scenario.model_validate({**fixed, "start": start, **content})


@shareable
@contextmanager
def ride(*, mission: str | None = None) -> Iterator[ScheduledRun]:
    """A started run: to a goal straight ahead over open ground, or a mission from the chair's staging pose."""
    content: dict[str, Any] = {"goals": [AHEAD]} if mission is None else {"mission": mission}
    start = OPEN_GROUND if mission is None else STAGING
    with ScheduledRun(scenario(start, **content), 1, RunOptions(light=True, parallel=False, digest=False)) as run:
        run.start()
        yield run


@shareable
@contextmanager
def riding() -> Iterator[ScheduledRun]:
    """The ride to the goal, at nearly full speed."""
    with ride() as run:
        assert run.stack.scheduler.run_for(8.0, lambda: speed_mps(run) > 0.7), f"only {speed_mps(run):.2f} m/s"
        yield run


def go_on(run: ScheduledRun, duration_s: float) -> None:
    run.stack.scheduler.run_for(duration_s)


def wait_for_row(run: ScheduledRun, code: str, within_s: float) -> None:
    """Runs until /safety/status contains the row."""
    assert run.stack.scheduler.run_for(within_s, lambda: code in rows(run)), f"{code} is missing: {rows(run)}"


def rows(run: ScheduledRun) -> list[str]:
    return list(run.safety.active_faults) if run.safety is not None else []


def speed_mps(run: ScheduledRun) -> float:
    """True speed."""
    vx, vy, _ = run.world.sim.world.truth().linear_mps
    return float((vx * vx + vy * vy) ** 0.5)


def broken(run: ScheduledRun) -> list[str]:
    return [item.describe() for item in run.invariants.broken]
