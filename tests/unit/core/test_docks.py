"""The docks of the site, for nodes that do not dock."""

from __future__ import annotations

from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY


def test_latched_wheelchair_pose_is_inverse_of_dock_pose() -> None:
    docks = load_docks()
    chair = docks.latched_wheelchair()
    assert chair is not None
    assert chair.compose(docks.docks["chair_1"].dock_pose.pose()).distance_to(IDENTITY) < 1e-9


def test_docks_without_wheelchair_have_no_latched_wheelchair() -> None:
    docks = load_docks()
    stations = {name: dock for name, dock in docks.docks.items() if dock.kind == "station"}
    assert docks.model_copy(update={"docks": stations}).latched_wheelchair() is None
