"""The hazard table of docs/safety.md names rows that are evaluated and tests that exist."""

from __future__ import annotations

import re

import pytest

from robot_stack.safety.conditions import CONDITIONS
from tests.mutation.safety_kernel import ROOT

FILES = {
    "U": "tests/unit/safety/test_stories.py",
    "N": "tests/simulated/nodes/test_safety_monitor.py",
    "B": "tests/simulated/nodes/test_emergency_stop_button.py",
    "C": "tests/simulated/nodes/test_system_monitor.py",
    "D": "tests/unit/docking/test_docking_jobs.py",
    "S": "tests/simulated/test_slopes.py",
    "W": "tests/unit/safety/test_slope.py",
    "R": "tests/unit/safety/test_release.py",
    "L": "tests/unit/safety/test_latch_store.py",
    "P": "tests/simulated/test_stops.py",
    "K": "tests/simulated/test_kills.py",
    "V": "tests/simulated/nodes/test_swerve_controller.py",
    "E": "tests/unit/drive/test_session.py",
    "M": "tests/simulated/nodes/test_docking_controller.py",
    "O": "tests/simulated/test_computer.py",
    "Y": "tests/unit/space/test_walk_in.py",
    "Q": "tests/scenarios/flat/test_kills.py",
    "H": "tests/nodes/test_swerve_hardware_interface.py",
    "G": "tests/unit/safety/test_chair_watch.py",
    "A": "tests/simulated/test_loose_chair.py",
    "J": "tests/unit/drive/test_permission.py",
    "I": "tests/unit/safety/test_losing_sight.py",
    "X": "tests/simulated/test_losing_sight.py",
}
TEXT = (ROOT / "docs" / "safety.md").read_text()
HAZARDS = TEXT.split("## Hazards")[1].split("## The two keys")[0]
CLAIMS = [
    (FILES[where], name)
    for where, names in re.findall(
        r"\b([UNBCDSWRLPKVEMOYHQGAJIX]) ((?:`[^`]+`(?:, )?)+)", HAZARDS.split("|---|---|---|---|---|")[1]
    )
    for name in re.findall(r"`([^`\[]+)[^`]*`", names)
]


@pytest.mark.parametrize("code", CONDITIONS)
def test_every_evaluated_row_is_in_the_table(code: str) -> None:
    assert code in HAZARDS


def test_the_table_was_found() -> None:
    assert len(CLAIMS) > 30


@pytest.mark.parametrize(("file", "name"), CLAIMS)
def test_every_named_test_exists(file: str, name: str) -> None:
    assert re.search(rf"def test_\w*{name}\w*\(", (ROOT / file).read_text()), f"{file} has no test with {name!r}"
