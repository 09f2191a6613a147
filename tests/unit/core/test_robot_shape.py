"""The drawn robot: poses of its solids as functions of the joint positions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from robot_stack.core.robot_shape import (
    load_robot_shape,
    placed,
    planar,
    quaternion_of,
    robot_solids,
    transform,
)

ROBOT, SHAPE = load_robot(), load_robot_shape()


def wheel(joints: dict[str, float], module: str = "fl") -> np.ndarray:
    """Returns the pose of a module's spoke, which turns with fork and wheel."""
    return next(
        s.pose for s in robot_solids(ROBOT, SHAPE, joints) if s.part == f"{module}_wheel" and s.solid.kind == "box"
    )


def test_wheels_stand_where_robot_yaml_puts_them() -> None:
    for module, (x, y) in zip(("fl", "fr", "rl", "rr"), ROBOT.module_positions_m(), strict=True):
        assert wheel({}, module)[:3, 3] == pytest.approx((x, y, ROBOT.wheel_radius_m))
    tyre = next(s for s in robot_solids(ROBOT, SHAPE, {}) if s.part == "fl_wheel" and s.solid.kind == "cylinder")
    assert tyre.solid.size_m == (2 * ROBOT.wheel_radius_m, 2 * ROBOT.wheel_radius_m, ROBOT.wheel_width_m)
    assert abs(tyre.pose[:3, 2]) == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)  # its axis is the axle


def test_a_module_turns_with_its_steering_joint() -> None:
    """At +90 degrees the wheel faces base_link's left."""
    pose = wheel({"fl_steer": math.pi / 2})
    assert pose[:3, 0] == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert wheel({"fl_steer": math.pi / 2}, "fr")[:3, 0] == pytest.approx((1.0, 0.0, 0.0))


def test_a_wheel_that_rolls_ahead_goes_down_in_front() -> None:
    """After a quarter turn ahead, the direction that pointed forward points down."""
    assert wheel({"fl_drive": math.pi / 2})[:3, 0] == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)
    both = wheel({"fl_steer": math.pi / 2, "fl_drive": math.pi / 6})
    assert both[:3, 0] == pytest.approx((0.0, math.cos(math.pi / 6), -0.5), abs=1e-12)


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_non_finite_angles_count_as_zero(angle: float) -> None:
    assert wheel({"fl_steer": angle}) == pytest.approx(wheel({}))


def test_the_body_fits_the_footprint() -> None:
    """The drawn robot, chair and passenger lie within the footprints used for planning."""
    chair = planar(Pose2(0.95, 0.0, 0.0))
    both = [*placed("", SHAPE.wheelchair, chair), *placed("", SHAPE.passenger, chair)]
    for solids, footprint in ((robot_solids(ROBOT, SHAPE, {}), ROBOT.footprint), (both, ROBOT.footprint_with_chair)):
        for solid in solids:
            reach = np.abs(solid.pose[:3, :3]) @ (0.5 * np.array(solid.solid.size_m))
            low, high = solid.pose[:3, 3] - reach, solid.pose[:3, 3] + reach
            assert low[0] >= footprint.rear_m, solid
            assert high[0] <= footprint.front_m + 0.2, solid  # toes and foot rest, whose size is not specified
            assert max(-low[1], high[1]) <= 0.5 * footprint.width_m, solid
            assert low[2] > -1e-9, solid


def test_turns_are_about_the_parents_axes_in_order() -> None:
    pose = transform((1.0, 2.0, 3.0), (90.0, 0.0, 90.0))
    # First about x: y -> z; then about z: z is unchanged.
    assert pose @ (0.0, 1.0, 0.0, 0.0) == pytest.approx((0.0, 0.0, 1.0, 0.0), abs=1e-12)
    assert pose[:3, 3] == pytest.approx((1.0, 2.0, 3.0))
    half = math.radians(60.0)
    assert quaternion_of(transform((0, 0, 0), (0, 0, 120.0))) == pytest.approx((0, 0, math.sin(half), math.cos(half)))
