"""The diagnostics tree, with the conventions of diagnostic_aggregator."""

from __future__ import annotations

import pytest

from robot_stack.contract.model import System
from robot_stack.contract.processes import PROCESSES
from robot_stack.core.config import load
from robot_stack.system_monitor.diagnostics_tree import DiagnosticsTree, Entry, Level
from robot_stack.system_monitor.params import SystemMonitorParams

GROUPS = {"Drive": ("swerve_controller", "hardware"), "Safety": ("safety_monitor",)}
OK, WARN, ERROR, STALE = Level


def tree(*expected: str) -> DiagnosticsTree:
    return DiagnosticsTree("/Robot", GROUPS, expected, 5.0)


def shown(entries: list[Entry]) -> dict[str, tuple[Level, str]]:
    return {entry.path: (entry.level, entry.message) for entry in entries}


def test_groups_come_before_their_children_in_the_configured_order() -> None:
    made = tree()
    for name in ("safety_monitor", "somebody", "swerve_controller: odometry /odom", "swerve_controller"):
        made.update(name, 0, f"{name} is well", name, 1.0)
    entries = made.entries(1.0)
    assert [entry.path for entry in entries] == [
        "/Robot",
        "/Robot/Drive",
        "/Robot/Drive/swerve_controller",
        "/Robot/Drive/swerve_controller: odometry  odom",
        "/Robot/Safety",
        "/Robot/Safety/safety_monitor",
        "/Robot/Other",
        "/Robot/Other/somebody",
    ]
    assert entries[0].children == (("Drive", "OK"), ("Safety", "OK"), ("Other", "OK"))
    assert entries[1].children[0] == ("swerve_controller", "swerve_controller is well")
    assert [entry.payload for entry in entries[2:4]] == ["swerve_controller", "swerve_controller: odometry /odom"]


@pytest.mark.parametrize(
    ("levels", "group", "text"),
    [
        ((OK, OK), OK, "OK"),
        ((OK, WARN), WARN, "Warning"),
        ((ERROR, WARN), ERROR, "Error"),
        ((STALE, STALE), STALE, "Stale"),
        ((STALE, OK), ERROR, "Error"),
        ((STALE, ERROR), ERROR, "Error"),
    ],
)
def test_a_group_is_as_bad_as_its_worst_child(levels: tuple[Level, Level], group: Level, text: str) -> None:
    made = tree()
    for name, level in zip(GROUPS["Drive"], levels, strict=True):
        made.update(name, level, "said", None, 1.0)
    found = shown(made.entries(1.0))
    assert found["/Robot/Drive"] == (group, text)
    assert found["/Robot"] == (group, text)


def test_silent_entries_become_stale_and_come_back() -> None:
    made = tree()
    made.update("swerve_controller", 0, "driving", None, 1.0)
    made.update("hardware", 0, "well", None, 6.0)
    assert shown(made.entries(6.0))["/Robot/Drive"] == (OK, "OK")
    entries = made.entries(6.1)
    assert shown(entries)["/Robot/Drive/swerve_controller"] == (STALE, "driving")
    assert shown(entries)["/Robot/Drive"] == (ERROR, "Error")
    assert ("swerve_controller", "Stale") in entries[1].children
    made.update("swerve_controller", 1, "driving again", None, 6.2)
    assert shown(made.entries(6.2))["/Robot/Drive/swerve_controller"] == (WARN, "driving again")


def test_expected_nodes_are_missing_until_first_diagnostics() -> None:
    made = tree("swerve_controller", "safety_monitor")
    made.update("safety_monitor", 0, "NORMAL", None, 1.0)
    entries = made.entries(1.0)
    assert shown(entries)["/Robot/Drive/swerve_controller"] == (STALE, "Missing")
    assert entries[1].children == (("swerve_controller", "Missing"),)
    assert shown(entries)["/Robot"] == (ERROR, "Error")


def test_a_level_that_does_not_exist_is_an_error() -> None:
    made = tree()
    made.update("hardware", 77, "odd", None, 1.0)
    assert shown(made.entries(1.0))["/Robot/Drive/hardware"] == (ERROR, "odd")


def test_diagnostics_tree_without_reports_is_ok() -> None:
    assert tree().entries(1.0) == [Entry("/Robot", OK, "OK")]


def test_every_node_of_the_robot_has_its_group() -> None:
    groups = load(SystemMonitorParams, "system_monitor").groups
    grouped = {node for nodes in groups.values() for node in nodes}
    # These two belong to the machines of the motion-engine layer.
    machines = {"wmx_engine", "sim_manipulator"}
    nodes = {node for row in PROCESSES if row.system is not System.WMX for node in row.nodes}
    assert grouped == nodes - machines | {"supervisor"}
