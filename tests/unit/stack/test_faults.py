"""Fault plans, random faults, and the smallest list that still fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_stack.core.config import ConfigError
from sim.plant.faults import BY_NAME
from sim.run.scenario import Scenario
from sim.stack.campaign import command_of, planned_faults, shrink
from sim.stack.faults import CHANCES, PlannedFault, _problem, kinds, load_faults, plan_text, random_faults
from sim.stack.run import RunOptions


def test_a_plan_is_read_as_it_is_written(tmp_path: Path) -> None:
    faults = random_faults(3, 30.0, 12)
    path = tmp_path / "faults.yaml"
    path.write_text(plan_text(faults))
    assert load_faults(path) == faults
    path.write_text(plan_text(()))
    assert load_faults(path) == ()


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("{at_s: 1, kind: nonsense}", "faults.0: no fault 'nonsense'"),
        ("{at_s: -1, kind: imu_silent}", "at_s"),
        ("{at_s: 1, kind: slip, value: 9}", "must be in 0.01..2"),
        ("{at_s: 1, kind: slip, target: nose}", "target must be one of"),
        ("{at_s: 1, kind: messages_lost, target: /nowhere}", "no topic '/nowhere'"),
    ],
)
def test_a_wrong_plan_names_file_and_field(tmp_path: Path, line: str, problem: str) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text(f"faults:\n  - {line}\n")
    with pytest.raises(ConfigError, match=r"faults\.yaml") as caught:
        load_faults(path)
    assert problem in str(caught.value)


def test_more_random_faults_begin_with_the_same_ones() -> None:
    few, many = random_faults(7, 60.0, 3), random_faults(7, 60.0, 6)
    assert set(few) < set(many)
    assert random_faults(7, 60.0, 3) == few != random_faults(8, 60.0, 3)
    assert [item.at_s for item in many] == sorted(item.at_s for item in many)


def test_every_chance_is_a_fault_that_can_be_raised() -> None:
    known = kinds()
    for chance in CHANCES:
        for target in chance.targets:
            for value in (chance.low, chance.high):
                fault = PlannedFault(at_s=0.0, kind=chance.kind, target=target, value=value)
                assert not _problem(fault, known), fault
    drawn = {fault.kind for seed in range(40) for fault in random_faults(seed, 60.0, 30)}
    assert drawn == {chance.kind for chance in CHANCES}
    assert {"lidar.rain", "overhead_lidar.silent", "camera.glare", "display.cable", "computer.overheat"} <= set(known)
    # The other faults of the world are what people do.
    doors = {"door_dead", "door_stuck", "door_closes"}
    assert set(BY_NAME) - drawn == {"chair_moved", "robot_moved", "charger", "charger_dead", "wheelchair", *doors}
    assert set(BY_NAME) <= set(known)
    targets = {target for chance in CHANCES if chance.kind.startswith("edge_") for target in chance.targets}
    assert targets == {"front", "rear", "left", "right", "relay"}


def test_shrinking_keeps_required_items_and_tests_each_subset_once() -> None:
    asked = []

    def fails(items: tuple[int, ...]) -> bool:
        asked.append(items)
        return {3, 6} <= set(items)

    assert shrink(range(9), fails) == (3, 6)
    assert len(asked) == len(set(asked))
    assert shrink((1, 2), lambda _: True) == ()
    assert shrink((5,), lambda items: bool(items)) == (5,)


def test_the_command_repeats_the_run() -> None:
    options = RunOptions(light=True, until_s=14.0)
    line = command_of("goal.yaml", 5, "random", options)
    assert line == "robot-stack simulate goal.yaml --seed 5 --faults random --light --until 14"
    ride = Scenario(description="x", world="yard", seed=1, limit_s=40.0)
    assert planned_faults("random", 5, ride, 14.0) == random_faults(5, 14.0, 4)
    assert planned_faults("random:9", 5, ride, 14.0) == random_faults(5, 14.0, 9)
    assert planned_faults("", 5, ride, 14.0) == ()
