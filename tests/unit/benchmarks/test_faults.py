"""The figures of ``bench faults``, computed from recorded runs."""

from __future__ import annotations

import pytest

from sim.stack.campaign import Outcome
from sim.stack.faults import PlannedFault
from sim.stack.invariants import Broken
from tests.benchmarks import faults


def outcome(seed: int, kinds: tuple[str, ...], broken: tuple[str, ...] = (), overrun_s: float = -0.05) -> Outcome:
    raised = tuple(PlannedFault(at_s=1.0, kind=kind) for kind in kinds)
    found = tuple(Broken(name, 2.0, "text", "state") for name in broken)
    return Outcome(seed, raised, found, (), 40.0, "", "", "command", frozenset({"IMU_TIMEOUT"}), overrun_s)


def test_runs_kinds_pairs_and_the_worst_overrun_are_counted() -> None:
    runs = [
        outcome(1, ("imu_silent",)),
        outcome(2, ("slip", "bus_loss"), ("contact",)),
        outcome(3, ("bus_loss", "slip"), ("row_not_raised", "contact"), 0.02),
        outcome(4, ("slip", "slip")),
    ]
    figures = faults._figures(runs)
    assert figures == pytest.approx(
        {
            "runs": 4,
            "kinds": 3,
            "rows": 1,
            "pairs": 2,  # the same fault twice is a pair too
            "ended_as_declared_pct": 75.0,
            "worst_overrun_ms": 20.0,
            "invariants_broken": 3,
            "simulated_h": 160.0 / 3600.0,
        }
    )


def test_a_case_repeats_by_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = {}

    def note(scenario: object, seed: int, options: object, command: str) -> None:
        seen.update(seed=seed, options=options, command=command)

    monkeypatch.setattr(faults, "run_once", note)
    faults._play(faults._Case("random", 7, 2, 12.0))
    assert seen["command"] == "robot-stack simulate random --seed 7 --faults random:2 --light --until 12"
    assert len(seen["options"].faults) == 2
    assert all(fault.at_s <= 12.0 for fault in seen["options"].faults)
