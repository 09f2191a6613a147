"""Which nodes are replayed, and the reasons of the others."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_stack.contract.processes import PROCESSES
from sim.replay.nodes import NOT_REPLAYED, REPLAYED, reason_not_replayed
from sim.replay.recorded import NODES

DOCS = Path(__file__).parents[4] / "docs" / "recording.md"
# Nodes that stand for a device, beside the drivers of the robot's profiles.
DEVICES = {"ehmi_display", "sim_computer", "sim_manipulator", "sim_world", "wmx_engine"}


@pytest.mark.parametrize("node", [*REPLAYED, *NOT_REPLAYED])
def test_the_documentation_names_each_node(node: str) -> None:
    assert f"`{node}`" in DOCS.read_text(encoding="utf-8")
    assert node in NODES


def test_only_drivers_are_called_drivers() -> None:
    called = {node for node in NODES - REPLAYED.keys() if reason_not_replayed(node).startswith("a driver")}
    drivers = {node for process in PROCESSES for node in process.nodes if node.endswith(("_driver", "_adapter"))}
    assert called == drivers | (DEVICES & NODES)
