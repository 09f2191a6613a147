"""The docks of the site, for nodes that do not dock."""

from __future__ import annotations

from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY


def test_a_docked_wheelchair_is_where_its_dock_pose_says() -> None:
    docks = load_docks()
    chair = docks.latched_wheelchair()
    assert chair is not None
    assert chair.compose(docks.docks["chair_1"].dock_pose.pose()).distance_to(IDENTITY) < 1e-9


def test_without_a_wheelchair_there_is_none_at_the_latch() -> None:
    docks = load_docks()
    stations = {name: dock for name, dock in docks.docks.items() if dock.kind == "station"}
    assert docks.model_copy(update={"docks": stations}).latched_wheelchair() is None
