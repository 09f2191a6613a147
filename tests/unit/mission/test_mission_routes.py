"""The wheelchair transport keeps its clearance in the yard, with and without the chair.

The footprint is swept along straight lines with the yaw turning in proportion, which is what navigation drives.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.core.config import config_dir, load
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.mission import Kind, Mission
from robot_stack.core.mission_library import MissionLibrary
from robot_stack.core.robot import Footprint, load_robot
from robot_stack.mission import route
from robot_stack.mission.params import MissionParams
from robot_stack.safety.collision import outline_of
from sim.plant.terrain import solids
from sim.settings import SHORT_MISSION, SHORT_START
from sim.worldfile import load_world

CLEARANCE_M = 0.25
# The edges of obstacles are points so far apart at most: no gap above 0.25 m is overestimated by more than 1 mm.
EDGE_M = 0.03
# Between two poses of a sweep no corner (at most 1.46 m from base_link) moves more than 0.12 m, so a gap is
# overestimated by at most 0.06 m, and by 0.001 m by its points, which is added to the required clearance.
STEP_M = 0.05
STEP_RAD = 0.05
UNSEEN_M = 0.061
START = Pose2(0.0, 0.0, 0.0)
# May be driven over; everything else, kerbs included, needs clearance.
FLAT = {"patch"}
PASSED_M = load(MissionParams, "mission_manager").pass_position_tolerance_m


def rectangle(pose: Pose2, front: float, rear: float, half: float) -> NDArray[np.float64]:
    """Returns the (4, 2) corners in map, m, anticlockwise."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    local = np.array([[rear, -half], [front, -half], [front, half], [rear, half]])
    return local @ np.array([[c, s], [-s, c]]) + [pose.x, pose.y]


def edge_points(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns (n, 2) points on the edges of a polygon, at most EDGE_M apart."""
    edges = zip(polygon, np.roll(polygon, -1, axis=0), strict=True)
    return np.concatenate(
        [np.linspace(a, b, math.ceil(float(np.linalg.norm(b - a)) / EDGE_M) + 1, endpoint=False) for a, b in edges]
    )


def gaps_m(footprint: Footprint, pose: Pose2, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the distance of each point, in map, from the footprint at a pose, m; 0 within it."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return outline_of(footprint).distances((points - [pose.x, pose.y]) @ np.array([[c, -s], [s, c]]))


def obstacles() -> dict[str, NDArray[np.float64]]:
    """Outlines of all solids of the yard, (n, 2) in map; a cylinder as a circumscribed polygon, ramps as on the map."""
    found = {}
    for solid in solids(load_world("yard")):
        if solid.kind in FLAT:
            continue
        x, y, _ = solid.centre_m
        if solid.shape == "cylinder":
            angles = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
            radius = solid.size_m[0] / math.cos(math.pi / 16)
            found[solid.name] = np.c_[x + radius * np.cos(angles), y + radius * np.sin(angles)]
        else:
            found[solid.name] = rectangle(
                Pose2(x, y, solid.yaw_rad), solid.size_m[0], -solid.size_m[0], solid.size_m[1]
            )
    return found


def sweep(a: Pose2, b: Pose2) -> Iterator[Pose2]:
    turn = wrap_angle(b.yaw - a.yaw)
    steps = max(1, math.ceil(max(a.distance_to(b) / STEP_M, abs(turn) / STEP_RAD)))
    for share in np.linspace(0.0, 1.0, steps + 1):
        yield Pose2(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), wrap_angle(a.yaw + share * turn))


def legs(
    mission: Mission, start: Pose2 = START
) -> Iterator[tuple[str, Pose2, Pose2, Footprint, NDArray[np.float64] | None]]:
    """Yields (name, from, to, footprint, parked chair) per leg; docking and undocking end at their final poses."""
    robot = load_robot()
    here, footprint, chair = start, robot.footprint, attached_chair(docked("chair_1"))
    passed: Pose2 | None = None
    for waypoint in mission.waypoints:
        yield waypoint.name, here, waypoint.pose, footprint, chair
        if passed is not None:  # a waypoint to pass counts as reached before it: the corner is cut
            yield f"{waypoint.name}, corner cut", passed, waypoint.pose, footprint, chair
        passed = short_of(here, waypoint.pose) if waypoint.action.kind is Kind.PASS else None
        here = waypoint.pose
        if waypoint.action.kind is Kind.DOCK:
            at = docked(waypoint.action.dock_id)
            yield f"docking at {waypoint.name}", here, at, footprint, None
            here, footprint, chair = at, robot.footprint_with_chair, None
        elif waypoint.action.kind is Kind.UNDOCK:
            yield f"undocking at {waypoint.name}", here, here, footprint, None
            chair = attached_chair(here)
            footprint = robot.footprint
            back = here.compose(Pose2(-0.5, 0.0, 0.0))
            yield f"backing off at {waypoint.name}", here, back, footprint, None
            here = back


def short_of(a: Pose2, b: Pose2) -> Pose2:
    """Returns the pose at which a waypoint to pass at ``b`` counts as reached on the way from ``a``."""
    share = max(0.0, 1.0 - PASSED_M / a.distance_to(b))
    turn = wrap_angle(b.yaw - a.yaw)
    return Pose2(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), wrap_angle(a.yaw + share * turn))


def docked(dock_id: str) -> Pose2:
    """Returns base_link in map when docked to the wheelchair at its place in the yard."""
    place = load_world("yard").wheelchair
    assert place is not None
    return place.pose().compose(load_docks().docks[dock_id].dock_pose.pose())


def attached_chair(base: Pose2) -> NDArray[np.float64]:
    """Outline of the chair attached to a robot at ``base``: from the robot's front to that of the pair."""
    robot = load_robot()
    with_chair = robot.footprint_with_chair
    return rectangle(base, with_chair.front_m, robot.footprint.front_m, 0.5 * with_chair.width_m)


@pytest.fixture(scope="module")
def transport() -> Mission:
    return MissionLibrary(config_dir() / "missions").find("wheelchair_transport")


def clearances(mission: Mission, start: Pose2 = START) -> dict[tuple[str, str], float]:
    """Smallest gap between the swept footprint and each obstacle, m, by (leg, obstacle)."""
    found: dict[tuple[str, str], float] = {}
    yard = {thing: edge_points(polygon) for thing, polygon in obstacles().items()}
    for name, a, b, footprint, chair in legs(mission, start):
        things = yard if chair is None else {**yard, "chair": edge_points(chair)}
        middle, reach_m = [0.5 * (a.x + b.x), 0.5 * (a.y + b.y)], 0.5 * a.distance_to(b) + 2.0
        near = {thing: p for thing, p in things.items() if np.linalg.norm(p - middle, axis=1).min() < reach_m}
        for pose in sweep(a, b):
            for thing, points in near.items():
                gap = float(gaps_m(footprint, pose, points).min())
                found[name, thing] = min(gap, found.get((name, thing), math.inf))
    return found


@pytest.mark.parametrize(("name", "start"), [("wheelchair_transport", START), (SHORT_MISSION, SHORT_START)])
def test_it_keeps_clear_of_everything(name: str, start: Pose2) -> None:
    mission = MissionLibrary(config_dir() / "missions").find(name)
    close = {key: round(gap, 3) for key, gap in clearances(mission, start).items() if gap <= CLEARANCE_M + UNSEEN_M}
    assert close == {}
    for leg, a, b, _, _ in legs(mission, start):  # the direction of rotation must not depend on the noise of the pose
        assert abs(wrap_angle(b.yaw - a.yaw)) < math.radians(150.0), leg


def test_it_begins_docking_at_the_staging_pose_and_ends_in_the_bay(transport):
    pick_up = next(waypoint for waypoint in transport.waypoints if waypoint.action.kind is Kind.DOCK)
    staging = load_docks().docks["chair_1"].staging.pose()
    assert pick_up.pose.distance_to(staging) < load(MissionParams, "mission_manager").position_tolerance_m
    assert abs(wrap_angle(pick_up.yaw - staging.yaw)) < 0.01
    assert transport.waypoints[-1].pose == Pose2(1.0, 1.0, 0.0)


def test_a_square_beside_a_robot() -> None:
    """By hand: a square of 1 m, rotated by 45 deg, reaches 0.7071 m from its centre, which is 3 m ahead."""
    robot = load_robot().footprint
    for x, yaw, gap_m in ((3.0, math.pi / 4, 3.0 - robot.front_m - math.sqrt(0.5)), (0.9, 0.0, 0.0)):
        square = edge_points(rectangle(Pose2(x, 0.0, yaw), 0.5, -0.5, 0.5))
        assert gaps_m(robot, Pose2(0.0, 0.0, 0.0), square).min() == pytest.approx(gap_m, abs=1e-9)


def test_clearance_check_detects_blocked_route(transport):
    """The straight line from the pick-up to the destination crosses planter_2."""
    shortcut = transport.model_copy(
        update={"waypoints": tuple(w for w in transport.waypoints if w.action.kind is not Kind.PASS)}
    )
    assert any(gap <= CLEARANCE_M for gap in clearances(shortcut).values())


def test_effort_is_the_length_of_the_plan_and_the_turn() -> None:
    params, goal = load(MissionParams, "mission_manager"), Pose2(3.0, 4.0, 1.0)
    turn_m = params.yaw_weight_m_per_rad
    assert route.effort_m(START, goal, math.nan, params) == pytest.approx(5.0 + turn_m), "without a plan, straight"
    assert route.effort_m(START, goal, 7.0, params) == pytest.approx(7.0 + turn_m)
    assert route.effort_m(START, goal, 4.0, params) == pytest.approx(5.0 + turn_m), "never less than straight"
