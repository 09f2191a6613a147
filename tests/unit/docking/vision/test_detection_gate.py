"""When the detection of markers is requested."""

from __future__ import annotations

import pytest

from robot_stack.contract.states import DOCKING, DockingState
from robot_stack.docking.vision.detection_gate import DetectionGate

LINGER_S = 4.0


@pytest.mark.parametrize("state", ["", *sorted(DockingState), "?"])
def test_marker_detection_is_enabled_while_docking(state: str) -> None:
    assert DetectionGate(LINGER_S).wanted(state, 10.0) is (state in {item.value for item in DOCKING})


def test_marker_detection_stays_enabled_for_linger_time_after_docked() -> None:
    demand = DetectionGate(LINGER_S)
    demand.wanted(DockingState.FINE_ALIGN.value, 10.0)
    assert demand.wanted(DockingState.DOCKED.value, 14.0)
    assert not demand.wanted(DockingState.DOCKED.value, 14.01)
    demand.wanted(DockingState.FINE_ALIGN.value, 20.0)
    assert not demand.wanted(DockingState.FAILED.value, 20.1)
    assert not demand.wanted("", 20.1)
