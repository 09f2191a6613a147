"""The docks of the site, for nodes that do not dock."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.config import load
from robot_stack.core.docks import DocksFile, StagingAlternative, load_docks
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.robot import load_robot


def test_latched_wheelchair_pose_is_inverse_of_dock_pose() -> None:
    docks = load_docks()
    chair = docks.latched_wheelchair()
    assert chair is not None
    assert chair.compose(docks.docks["chair_1"].dock_pose.pose()).distance_to(IDENTITY) < 1e-9


def test_docks_without_wheelchair_have_no_latched_wheelchair() -> None:
    docks = load_docks()
    stations = {name: dock for name, dock in docks.docks.items() if dock.kind == "station"}
    assert docks.model_copy(update={"docks": stations}).latched_wheelchair() is None


@pytest.mark.parametrize("name", ["chair_1", "charger"])
def test_robot_at_an_alternative_staging_pose_faces_the_board(name: str) -> None:
    file = load(DocksFile, "docks")
    row = file.docks[name].model_copy(update={"staging_alternatives": (StagingAlternative(along_m=1.8, across_m=0.4),)})
    dock = row.of_robot(load_robot(), file.staging_m)
    (other,) = (place.pose() for place in dock.staging_alternatives)
    board = row.place.pose().relative_to(other)
    assert abs(math.atan2(board.y, board.x if name == "chair_1" else -board.x)) < 1e-9
    off = other.relative_to(row.place.pose().compose(Pose2(dock.dock_pose.x_m, dock.dock_pose.y_m, 0.0)))
    assert (off.x, off.y) == pytest.approx((-1.8, 0.4))
