"""Localization on a map from a floor plan, with simulated sweeps of a hospital that has more in it than the plan."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.robot import load_robot
from robot_stack.core.site_map import load_map
from robot_stack.localization.ndt.gate import problem_of
from robot_stack.localization.ndt.matcher import Match, pose_of
from robot_stack.localization.ndt.search import Region
from robot_stack.localization.ndt.solver import MatchRequest, SweepSolver
from sim.lidar.views import sweep_at
from sim.worldfile import Box, WorldFile, load_world
from tests.unit.localization.courtyard import UP, yaw_between
from tests.unit.localization.stories import params

# In the main corridor, a door opening, the ward, the hall behind its glass front, the upper corridor, the lobby.
PLACES = (
    Pose2(1.0, 0.1, 0.1),
    Pose2(10.0, -1.6, -1.4),
    Pose2(13.0, -4.2, 0.2),
    Pose2(25.0, 3.0, 1.3),
    Pose2(13.0, 11.0, 3.0),
    Pose2(-2.0, 11.0, 3.1),
)
# A guess in another room or another part of the hall.
ELSEWHERE = Pose2(-3.5, 4.0, 0.6)
CLUTTERED_SHARE = 0.2
DEEP_M, HIGH_M = 0.45, 1.7


def cluttered(world: WorldFile) -> WorldFile:
    """With a cupboard before a fifth of each wall, on one side or the other, and none that blocks an opening."""
    random, boxes = np.random.default_rng(4), []
    for wall in world.walls:
        length_m = CLUTTERED_SHARE * wall.length_m
        along_m = random.uniform(-0.5, 0.5) * (wall.length_m - length_m)
        across_m = random.choice((-0.5, 0.5)) * (wall.width_m + DEEP_M)
        at = Pose2(wall.x_m, wall.y_m, wall.yaw_rad).compose(Pose2(along_m, across_m, 0.0))
        place = {"x_m": at.x, "y_m": at.y, "yaw_deg": wall.yaw_deg}
        boxes.append(Box(name=f"before_{wall.name}", **place, length_m=length_m, width_m=DEEP_M, height_m=HIGH_M))
    return world.model_copy(update={"boxes": [*world.boxes, *boxes]})


@cache
def site() -> tuple[WorldFile, SweepSolver]:
    robot = load_robot()
    return cluttered(load_world("hospital")), SweepSolver(load_map("hospital").cells, params().ndt, robot.lidar_xyz_m)


def matched(index: int, guess: Pose2, region: Region | None = None) -> Match | None:
    """Of a sweep at a place with two people beside the robot."""
    world, solver = site()
    people = [PLACES[index].compose(Pose2(1.6, 0.3, 0.0)), PLACES[index].compose(Pose2(-1.2, -0.6, 0.0))]
    sweep, _ = sweep_at(world, pose_of(PLACES[index], 0.0, UP), seed=index, people=people)
    request = MatchRequest(0.0, sweep, np.zeros((1, 4)), pose_of(guess, 0.0, UP), UP, 0.5, region, IDENTITY, 0)
    return solver.solve(request).match


def refusal(match: Match, guess: Pose2) -> str:
    return problem_of(match, guess, 0.1, 0.02, params().ndt.gate)


def test_sweeps_between_furniture_and_people_match_the_walls_of_the_plan() -> None:
    for index, truth in enumerate(PLACES):
        guess = truth.compose(Pose2(0.25, -0.2, 0.05))
        match = matched(index, guess)
        assert match is not None
        assert refusal(match, guess) == "", f"{truth}: {refusal(match, guess)}"
        assert match.planar.distance_to(truth) < 0.05, truth
        assert yaw_between(match.planar, truth) < math.radians(0.3)


def test_a_sweep_in_the_cabin_of_a_lift_with_an_open_door_matches() -> None:
    """Its near walls fill few voxels."""
    world = load_world("hospital").model_copy(update={"doors": [], "lifts": []})
    _, solver = site()
    for y_m in (2.2, 2.85, 42.85):
        truth = Pose2(-1.0, y_m, math.pi / 2)
        guess = truth.compose(Pose2(0.1, -0.1, 0.03))
        sweep, _ = sweep_at(world, pose_of(truth, 0.0, UP), seed=1, people=[])
        request = MatchRequest(0.0, sweep, np.zeros((1, 4)), pose_of(guess, 0.0, UP), UP, 0.5, None, IDENTITY, 0)
        result = solver.solve(request)
        assert result.match is not None, result.problem
        assert refusal(result.match, guess) == ""
        assert result.match.planar.distance_to(truth) < 0.03


def test_the_plan_refuses_a_guess_in_another_room() -> None:
    for index, truth in enumerate(PLACES):
        guess = truth.compose(ELSEWHERE)
        match = matched(index, guess)
        assert match is not None
        assert refusal(match, guess), truth


def test_a_search_of_the_whole_plan_finds_no_wrong_place() -> None:
    found = [(matched(index, IDENTITY, Region(0.0, 0.0, math.inf)), truth) for index, truth in enumerate(PLACES)]
    right = [match.planar.distance_to(truth) < 0.1 for match, truth in found if match is not None]
    assert all(right)
    assert len(right) >= 2
