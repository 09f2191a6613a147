"""Where the safety edge senses a contact: simple bodies with known results, and the robot's own edge."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.docks import load_docks
from robot_stack.core.robot import Footprint, Robot, load_robot
from robot_stack.core.robot_shape import Placed, Solid, load_robot_shape
from robot_stack.coverage.contact import sensed, strips_of
from robot_stack.coverage.params import load_coverage_params
from robot_stack.coverage.report import bodies

PARAMS = load_coverage_params()
ROBOT = load_robot()
FOOTPRINT = Footprint(front_m=0.5, rear_m=-0.5, width_m=1.0)


def box(size_m: tuple[float, float, float], at_m: tuple[float, float, float]) -> Placed:
    solid = Solid(kind="box", size_m=size_m, at_m=at_m, turn_deg=(0.0, 0.0, 0.0), colour="#000000")
    return Placed("box", solid, solid.pose())


BODY = box((0.9, 0.9, 0.4), (0.0, 0.0, 0.4))
FRONT_STRIP = box((0.1, 1.0, 0.2), (0.45, 0.0, 0.4))  # from 0.3 to 0.5 m above the ground


def share(strips: list[Placed], solids: list[Placed], top_m: float) -> float:
    return float(sensed(strips, solids, FOOTPRINT, 0.1, top_m, 0.02).mean())


def test_one_strip_senses_its_side_and_what_passes_its_ends() -> None:
    """A quarter of the outline is the front; on the sides the strip's ends are 0.1 m and a cylinder's radius long."""
    assert share([FRONT_STRIP], [BODY], 0.6) == pytest.approx(0.25 + 2.0 * 0.15 / 4.0, abs=0.02)
    assert share([], [BODY], 0.6) == 0.0


def test_an_object_below_the_strip_or_stopped_by_another_part_is_not_sensed() -> None:
    assert share([FRONT_STRIP], [BODY], 0.28) == 0.0
    bumper = box((0.3, 1.04, 0.1), (0.4, 0.0, 0.1))
    assert share([FRONT_STRIP], [BODY, bumper], 0.6) == 0.0


def test_the_robots_edge_senses_the_whole_outline_and_with_a_chair_rear_and_deck() -> None:
    standing = bodies(ROBOT, load_robot_shape(), load_docks())
    for name, expected in (("empty", 1.0), ("chair", (2.0 * 1.0 + 0.8) / 5.4)):
        body = standing[name]
        for top_m, share_expected in ((0.15, 0.0), (0.3, expected)):
            found = sensed(body.strips, body.solids, body.footprint, PARAMS.thing_width_m, top_m, PARAMS.cell_m)
            assert found.mean() == pytest.approx(share_expected, abs=0.02), (name, top_m)


def test_a_robot_without_an_edge_senses_nothing() -> None:
    bare: Robot = ROBOT.model_copy(update={"safety_edge": None})
    assert strips_of(bare) == []
    body = bodies(bare, load_robot_shape(), load_docks())["empty"]
    assert not np.any(sensed(body.strips, body.solids, body.footprint, 0.2, 0.6, 0.1))
