"""The ground model around the robot alone: how the floors of looks change it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.robot import load_robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.space.footing import Footing

PARAMS = load(PerceptionParams, "perception_pipeline")
OWN = load_robot().footprint
LEVEL = (0.0, 0.0)
Surface = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def floor(surface: Surface, *, within_m: float = 2.8, noise_m: float = 0.0, returns: int = 10) -> NDArray[np.float32]:
    """Returns ground whose height depends on x alone, seen in every cell around."""
    at = np.arange(-within_m, within_m, 0.05) + 0.012
    x, y = (grid.ravel() for grid in np.meshgrid(at, at))
    z = surface(x) + noise_m * np.random.default_rng(1).standard_normal(len(x)) / math.sqrt(returns)
    return np.stack([x, y, z, np.full_like(x, returns)], axis=1).astype(np.float32)


def footing(points: NDArray[np.float32], pose: Pose2 = IDENTITY, tilt: tuple[float, float] = LEVEL) -> Footing:
    found = Footing(PARAMS.footing, PARAMS.space)
    found.observe(points, tilt, pose, OWN)
    return found


def step_down(depth_m: float, at_m: float = 1.5) -> Surface:
    return lambda x: np.where(x > at_m, -depth_m, 0.0)


def slope_down(deg: float, begin_m: float = -9.0, end_m: float = 9.0) -> Surface:
    return lambda x: -math.tan(math.radians(deg)) * (np.clip(x, begin_m, end_m) - max(begin_m, 0.0))


def between(points: NDArray[np.float32], low_m: float, high_m: float) -> NDArray[np.float32]:
    """Returns the points (n, 3) or (n, 4) outside of an interval of distances ahead."""
    return points[(points[:, 0] < low_m) | (points[:, 0] > high_m)]


@pytest.mark.parametrize("depth_m", [0.05, 0.08, 0.3, 3.0])
def test_ground_that_falls_is_an_edge(depth_m: float) -> None:
    edges = footing(floor(step_down(depth_m), noise_m=0.014)).edges(IDENTITY)
    assert len(np.unique(np.round(edges[:, 1], 2))) > 90  # along the whole edge
    assert edges[:, 0].min() > 1.3
    assert edges[:, 0].max() < 1.6
    assert not edges[:, 2].any()


@pytest.mark.parametrize(
    "surface",
    [
        step_down(0.0),
        step_down(0.03),
        slope_down(10.0),
        slope_down(10.0, 1.0, 2.0),
        slope_down(-10.0, 1.0, 2.0),
        slope_down(18.0),  # even, but too steep to climb
    ],
    ids=["level", "kerb down of 3 cm", "slope", "crest and foot", "ramp up", "steep slope"],
)
def test_ground_that_may_be_driven_has_no_edge(surface: Surface) -> None:
    assert len(footing(floor(surface, noise_m=0.014)).edges(IDENTITY)) == 0


def test_a_steeper_fall_is_an_edge_however_even_it_is() -> None:
    assert len(footing(floor(slope_down(35.0))).edges(IDENTITY)) > 0


@pytest.mark.parametrize(("low_m", "high_m", "found"), [(1.5, 2.1, True), (1.5, 2.75, False)])
def test_occluded_area_does_not_hide_the_edge(low_m: float, high_m: float, found: bool) -> None:
    points = between(floor(step_down(0.5)), low_m, high_m)
    assert (len(footing(points).edges(IDENTITY)) > 0) == found


def test_ramp_explains_a_drop_across_an_occluded_area() -> None:
    points = between(floor(slope_down(11.0)), 1.5, 2.1)
    assert len(footing(points).edges(IDENTITY)) == 0


def test_the_direction_of_the_fall_does_not_matter() -> None:
    """Behind, to the side and at an angle."""
    points = floor(step_down(0.10))
    for yaw in (math.pi, 0.5 * math.pi, 0.25 * math.pi, -0.75 * math.pi):
        c, s = math.cos(yaw), math.sin(yaw)
        turned = points.copy()
        turned[:, 0], turned[:, 1] = c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]
        edges = footing(turned).edges(IDENTITY)
        along = c * edges[:, 0] + s * edges[:, 1]
        assert len(edges) > 50
        assert along.min() > 1.25
        assert along.max() < 1.65


def test_single_raised_cell_is_not_an_edge() -> None:
    points = floor(step_down(0.0))
    points[np.hypot(points[:, 0] - 1.5, points[:, 1]) < 0.03, 2] = 0.3
    assert len(footing(points).edges(IDENTITY)) == 0


def test_few_cells_and_few_returns_are_ignored() -> None:
    for points in (floor(step_down(0.3))[::3], floor(step_down(0.3), returns=1)[:0]):
        assert len(footing(points).edges(IDENTITY)) == 0
    few = floor(step_down(0.3))
    few[:, 3] = 0.5
    assert len(footing(few).edges(IDENTITY)) == 0


def test_an_edge_stays_until_ground_is_measured_in_its_place() -> None:
    found = footing(floor(step_down(0.3)))
    for _ in range(5):
        found.observe(floor(step_down(0.3), within_m=1.0), LEVEL, IDENTITY, OWN)
    before = len(found.edges(IDENTITY))
    assert before > 0
    assert found.drop.sum() == before
    for _ in range(30):
        found.observe(floor(step_down(0.0)), LEVEL, IDENTITY, OWN)
    assert len(found.edges(IDENTITY)) == 0


def test_edges_stay_in_place_while_the_robot_moves_and_leave_with_the_grid() -> None:
    found, nothing = footing(floor(step_down(0.3))), np.empty((0, 4), np.float32)
    pose = Pose2(0.40, 0.10, 0.3)
    found.observe(nothing, LEVEL, pose, OWN)
    edges = found.edges(pose)
    x = pose.x + math.cos(pose.yaw) * edges[:, 0] - math.sin(pose.yaw) * edges[:, 1]
    assert x.min() > 1.3
    assert x.max() < 1.6
    for away in np.arange(0.0, -6.0, -0.4):
        found.observe(nothing, LEVEL, Pose2(float(away), 0.0, 0.0), OWN)
    assert len(found.edges(Pose2(-5.6, 0.0, 0.0))) == 0


def test_ground_is_forgotten() -> None:
    found = footing(floor(step_down(0.3)))
    found.forget()
    assert len(found.edges(IDENTITY)) == 0


def test_heights_are_those_of_one_plane_however_the_robot_climbs() -> None:
    """Up a slope of 10 deg: in base_link the ground seen before becomes lower."""
    found, tilt = Footing(PARAMS.footing, PARAMS.space), (math.tan(math.radians(10.0)), 0.0)
    for x in np.arange(0.0, 1.5, 0.1):
        seen = floor(lambda ahead: tilt[0] * ahead, within_m=1.2 + 0.1 * round(x) % 3)
        found.observe(seen, tilt, Pose2(float(x), 0.0, 0.0), OWN)
        assert len(found.edges(Pose2(float(x), 0.0, 0.0))) == 0


# --- how the ground beneath the chair bends ---------------------------------------------------------------------------

FROM_M, UP_10_DEG = OWN.front_m, math.tan(math.radians(10.0))


def bends(surface: Surface, tilt: float = 0.0, at: Pose2 = IDENTITY, low_m: float = 9.0) -> float:
    """With a chair, after its ground was measured by the robot alone; not between ``low_m`` and the front."""
    robot = load_robot()
    found = Footing(PARAMS.footing, PARAMS.space)
    points = between(floor(surface, noise_m=0.014), low_m, 9.0)
    points[:, :2] = points[:, :2] @ np.array(
        [[math.cos(at.yaw), math.sin(at.yaw)], [-math.sin(at.yaw), math.cos(at.yaw)]]
    )
    found.observe(points, (tilt, 0.0), Pose2(at.x, at.y, 0.0), robot.footprint_with_chair)
    found.observe(points[:0], (tilt, 0.0), at, robot.footprint_with_chair)
    return found.bends(at, FROM_M)


@pytest.mark.parametrize("at", [IDENTITY, Pose2(3.0, -2.0, 0.8), Pose2(-7.0, 1.0, -2.5)])
def test_a_chair_beyond_a_crest_leans_by_the_slope(at: Pose2) -> None:
    assert bends(lambda x: UP_10_DEG * np.minimum(x, FROM_M), UP_10_DEG, at) == pytest.approx(UP_10_DEG, abs=0.01)


def test_a_chair_half_beyond_a_crest_leans_by_less() -> None:
    assert 0.03 < bends(lambda x: UP_10_DEG * np.minimum(x, 0.95), UP_10_DEG) < 0.14


@pytest.mark.parametrize(
    ("surface", "tilt"),
    [
        (step_down(0.0), 0.0),
        (lambda x: UP_10_DEG * x, UP_10_DEG),
        (slope_down(10.0), -UP_10_DEG),
        (lambda x: UP_10_DEG * np.maximum(x - FROM_M, 0.0), 0.0),
    ],
    ids=["level", "up", "down", "foot"],
)
def test_a_chair_on_even_ground_or_at_a_foot_does_not_lean(surface: Surface, tilt: float) -> None:
    assert bends(surface, tilt) == pytest.approx(0.0, abs=0.01)


def test_a_chair_leans_no_more_than_a_ramp() -> None:
    assert bends(slope_down(30.0), 0.0) == pytest.approx(math.tan(math.radians(PARAMS.footing.slope_deg)))


def test_a_chair_on_ground_that_was_not_measured_does_not_lean() -> None:
    crest = lambda x: UP_10_DEG * np.minimum(x, FROM_M)  # noqa: E731
    assert bends(crest, UP_10_DEG, low_m=0.9) == 0.0
    assert Footing(PARAMS.footing, PARAMS.space).bends(IDENTITY, FROM_M) == 0.0
    found = Footing(PARAMS.footing, PARAMS.space)
    found.observe(np.empty((0, 4), np.float32), (UP_10_DEG, 0.0), IDENTITY, OWN)
    assert found.bends(IDENTITY, OWN.rear_m) == 0.0


# --- where known ground ends -----------------------------------------------------------------------------------------


def test_known_ground_is_seen_or_under_the_robot() -> None:
    found = footing(np.empty((0, 4), np.float32))
    ends = found.ends(IDENTITY)
    assert np.abs(ends[:, 0]).max() < 0.5 + 0.25
    assert np.abs(ends[:, 1]).max() < 0.35 + 0.25
    assert (np.maximum(np.abs(ends[:, 0]) - 0.5, np.abs(ends[:, 1]) - 0.35) > 0.0).all()
    between_rings = floor(step_down(0.0))
    between_rings[:, 3] = 0.0
    ends = footing(between_rings).ends(IDENTITY)
    assert np.abs(ends[:, :2]).max(axis=1).min() > 2.7


@pytest.mark.parametrize(("hole_m", "found"), [(0.15, False), (0.40, True)])
def test_hole_is_found_only_if_larger_than_castor(hole_m: float, found: bool) -> None:
    points = floor(step_down(0.0))
    hole = (np.abs(points[:, 0] - 1.5) < 0.5 * hole_m) & (np.abs(points[:, 1]) < 0.5 * hole_m)
    ends = footing(points[~hole]).ends(IDENTITY)
    assert (np.hypot(ends[:, 0] - 1.5, ends[:, 1]) < 0.3).any() == found


def test_no_drop_below_the_robot_and_chair_cells_are_cleared() -> None:
    robot = load_robot()
    found = footing(floor(step_down(0.3, at_m=0.9)))
    assert len(found.edges(IDENTITY)) > 0
    nothing = np.empty((0, 4), np.float32)
    found.observe(nothing, LEVEL, IDENTITY, robot.footprint_with_chair)
    edges = found.edges(IDENTITY)
    assert (np.abs(edges[:, 1]) > 0.5 * robot.footprint_with_chair.width_m + 0.15).all()
    found.observe(nothing, LEVEL, IDENTITY, robot.footprint)
    assert not (np.abs(found.edges(IDENTITY)[:, 1]) < 0.5).any()
    beneath = footing(floor(step_down(0.3, at_m=0.3)))
    assert (np.abs(beneath.edges(IDENTITY)[:, 1]) > 0.35).all()
