"""Nodes take no decisions: what follows from a value is computed by a kernel."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.setup.node_decisions import decisions

PACKAGE = Path(__file__).resolve().parents[2] / "robot_stack"
PERMITTED: dict[str, dict[str, str]] = yaml.safe_load(
    Path(__file__).with_name("node_decisions.yaml").read_text(encoding="utf-8")
)
_MARKS = ("StackNode", ".msg import", ".srv import", ".action import")  # of modules with endpoints or messages


def found() -> dict[str, dict[str, list[str]]]:
    """The decisions of every node module and of the modules with messages beside it, by file and function."""
    result: dict[str, dict[str, list[str]]] = {}
    files = {*PACKAGE.glob("*/nodes/*.py"), *(path for path in PACKAGE.glob("*/*.py") if path.name == "node.py")}
    for path in sorted(files):
        source = path.read_text(encoding="utf-8")
        for one in decisions(source) if any(mark in source for mark in _MARKS) else ():
            of_file = result.setdefault(path.relative_to(PACKAGE).as_posix(), {})
            of_file.setdefault(one.where, []).append(f"line {one.line}: {one.condition} ({one.kind})")
    return result


def test_nodes_take_no_decisions() -> None:
    """Move what it names into a kernel, or add the function to node_decisions.yaml with a reason."""
    assert {
        f"{file}, {where}": taken
        for file, functions in found().items()
        for where, taken in functions.items()
        if where not in PERMITTED.get(file, {})
    } == {}


def test_every_exception_is_needed() -> None:
    taken = {(file, where) for file, functions in found().items() for where in functions}
    assert sorted({(file, where) for file, functions in PERMITTED.items() for where in functions} - taken) == []


@pytest.mark.parametrize(
    ("condition", "kind"),
    [
        ("message.percentage < 0.2", "threshold"),
        ("ready and output.state is State.FAILED", "value"),
        ("message.state == 'DOCKED'", "value"),
        ("not self._status.latest.attached", "field"),
    ],
)
def test_a_planted_decision_is_found(condition: str, kind: str) -> None:
    source = f"class N(StackNode):\n    def _tick(self):\n        if {condition}:\n            self.stop()\n"
    assert [(one.where, one.line, one.kind) for one in decisions(source)] == [("N._tick", 3, kind)]


@pytest.mark.parametrize(
    "condition",
    [
        "pose is None",
        "self._odom.fresh() and not problem",
        "isinstance(message, Image)",
        "now_s - self._sent_s > self.params.silence_s",
        "message.header.frame_id != frames.MAP",
        "self.params.images == 'always'",
        "wanted != self._shown",
        "self.count_publishers(name) > 0",
    ],
)
def test_health_of_inputs_and_configuration_are_no_decisions(condition: str) -> None:
    assert decisions(f"if {condition}:\n    pass\n") == []
