"""Rides drawn from a seed: each is a valid scenario, and nothing can touch the robot at its start."""

from __future__ import annotations

import itertools
import math

import pytest

from robot_stack.core.config import ConfigError, validate
from robot_stack.core.geometry import Pose2
from sim.run.scenario import Scenario
from sim.stack.choice import choose_scenario
from sim.stack.random_ride import random_ride
from sim.worldfile import load_world

_DESCRIBED = {"description": "a ride", "world": "yard", "seed": 1}
WORLD = load_world("yard")
RIDES = [validate(Scenario, _DESCRIBED | random_ride(seed, WORLD), "random") for seed in range(60)]


def test_random_scenario_is_determined_by_seed() -> None:
    first, again, other = (choose_scenario("random", seed)[0] for seed in (5, 5, 6))
    assert first == again != other
    assert choose_scenario("random")[0] == choose_scenario("random", 1)[0]
    with pytest.raises(ConfigError, match="nowhere"):
        choose_scenario("random", 1, world="nowhere")


def test_missions_goals_and_driving_by_hand_with_and_without_a_chair() -> None:
    kinds = {(bool(ride.mission), bool(ride.goals), bool(ride.twists)) for ride in RIDES}
    assert kinds == {(True, False, False), (False, True, False), (False, False, True)}
    assert {ride.passenger_mass_kg is None for ride in RIDES if ride.goals} == {True, False}
    assert {ride.passenger_mass_kg is None for ride in RIDES if ride.twists} == {True, False}
    fastest = max(math.hypot(item.vx_mps, item.vy_mps) for ride in RIDES for item in ride.twists)
    assert 1.4 < fastest <= 1.5


@pytest.mark.parametrize("ride", [ride for ride in RIDES if ride.mission is None])
def test_a_start_is_clear_of_people_ramps_pits_and_corners(ride: Scenario) -> None:
    start = ride.start_pose()
    # The closest point of a path is at most half a step from one of these.
    paths = [
        (a[0] + share / 50 * (b[0] - a[0]), a[1] + share / 50 * (b[1] - a[1]))
        for person in WORLD.people
        for a, b in itertools.pairwise(person.points_m)
        for share in range(51)
    ]
    own = [route for route in WORLD.routes.values() if _on(route.points_m, (start.x, start.y))]
    assert own, "not on a route"
    assert min(math.dist((start.x, start.y), point) for point in paths) > 1.9
    for ramp in WORLD.ramps:
        ahead = Pose2(start.x, start.y, 0.0).relative_to(Pose2(ramp.x_m, ramp.y_m, ramp.yaw_rad))
        assert not (-1.9 < ahead.x < ramp.total_length_m + 1.9 and abs(ahead.y) < 0.5 * ramp.width_m)
    for pit in WORLD.pits:
        assert math.dist((start.x, start.y), (pit.x_m, pit.y_m)) > 0.5 * math.hypot(pit.length_m, pit.width_m) + 1.9
    assert any(min(math.dist((start.x, start.y), point) for point in route.points_m) > 2.0 for route in own)


def _on(points: list[tuple[float, float]], place: tuple[float, float]) -> bool:
    return any(
        math.dist(a, place) + math.dist(place, b) - math.dist(a, b) < 1e-9 for a, b in itertools.pairwise(points)
    )
