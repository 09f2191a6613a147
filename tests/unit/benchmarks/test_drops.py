"""The benchmark ``drops``: its runs depend on perception and the safety monitor, and its figures on the ground."""

from __future__ import annotations

import json
import math

import pytest

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from sim.lidar.params import load_lidar_params
from sim.worldfile import Pit, Ramp, WorldFile, load_world
from tests.benchmarks import drops
from tests.benchmarks.support import drops_cases
from tests.benchmarks.support.drops_cases import Case, Leg
from tests.benchmarks.support.drops_run import Outcome, play
from tests.benchmarks.support.people_terrain import terrain_of

AHEAD = Twist2(1.0, 0.0, 0.0)


def world(depth_m: float, width_m: float = 12.0, at_m: float = 4.0) -> WorldFile:
    pit = Pit(name="drop", x_m=at_m + 2.0, y_m=0.0, length_m=4.0, width_m=width_m, depth_m=depth_m)
    return load_world("flat").model_copy(update={"pits": [pit]})


def case(depth_m: float, *, run_s: float = 6.0, to_m: float = math.inf) -> Case:
    return Case(7, "a drop ahead", True, world(depth_m), IDENTITY, (Leg(AHEAD, math.inf),), run_s, to_m)


@pytest.mark.parametrize("depth_m", [0.05, 0.5])
def test_with_the_chair_the_robot_stops_before_a_drop_ahead(depth_m: float) -> None:
    outcome = play(case(depth_m))
    assert not outcome.over
    assert 1.0 < outcome.distance_m < 4.0 - 1.31
    assert outcome.stops


def test_without_a_safety_monitor_its_castors_get_over_the_edge() -> None:
    outcome = play(case(0.5, run_s=7.0), guarded=False)
    assert outcome.over
    assert outcome.at_mps > 0.8
    assert outcome.distance_m == pytest.approx(4.0 - 1.31, abs=0.1)


def test_with_the_chair_a_kerb_down_of_3_cm_is_driven() -> None:
    assert play(case(0.03, run_s=7.0, to_m=3.6)).passed


def test_over_a_crest_the_passenger_who_leans_ahead_stops_nothing() -> None:
    """The chair turns about the latch: on top of a ramp of 10 deg the head is 0.2 m farther ahead of the robot."""
    ramp = Ramp(name="r", x_m=0.0, y_m=0.0, slope_deg=9.9, height_m=0.6, width_m=3.0, top_length_m=6.0)
    place = load_world("flat").model_copy(update={"ramps": [ramp]})
    start, to_m = Pose2(ramp.run_m - 0.6, 0.0, 0.0), 0.9
    legs = (Leg(Twist2(0.3, 0.0, 0.0), to_m), Leg(Twist2(0.0, 0.0, 0.0), math.inf))
    assert play(Case(7, "a crest", True, place, start, legs, 6.0, to_m)).passed


def test_a_robot_that_stands_on_a_ramp_is_tilted_as_it_is() -> None:
    ramp = Ramp(name="r", x_m=1.0, y_m=0.0, slope_deg=10.0, height_m=0.6, width_m=3.0, top_length_m=2.0)
    place = load_world("flat").model_copy(update={"ramps": [ramp], "pits": world(0.03, at_m=20.0).pits})
    terrain = terrain_of(place, load_lidar_params(), (0.001, 0.002))
    base = terrain.standing(Pose2(2.0, 0.0, 0.0), drops_cases.contacts(chair=False))
    assert base[2, 3] == pytest.approx(math.tan(math.radians(10.0)))
    attitude = terrain.attitude(base)
    assert attitude.pitch_rad == pytest.approx(-math.radians(10.0) + 0.002)
    assert attitude.roll_rad == pytest.approx(0.001)
    assert terrain.height_m(3.0 + ramp.run_m, 0.0) == pytest.approx(0.6)
    assert terrain.height_m(22.0, 0.0) == -0.03
    assert terrain.height_m(-3.0, 0.0) == 0.0


def test_a_round_has_each_direction_and_depth_with_and_without_the_chair() -> None:
    drawn = [drops_cases.drop(number, 500 + number) for number in range(drops_cases.ROUND)]
    found = {(one.what.split(",")[0], one.world.pits[0].depth_m, one.chair) for one in drawn}
    assert len(found) == len(set(drops_cases.DIRECTIONS)) * len(drops_cases.DEPTHS_M) * 2
    assert {one.world.pits[0].width_m for one in drawn if one.what.startswith("ahead")} == set(drops_cases.WIDTHS_M)
    assert any(one.world.ramps for one in drawn)
    ways = [drops_cases.passable(number, 900 + number) for number in range(2 * len(drops_cases.PASSABLE))]
    assert {(one.what.split(",")[0], one.chair) for one in ways} == {
        (kind, chair) for kind in drops_cases.PASSABLE for chair in (True, False)
    }


def test_every_fall_and_every_false_stop_is_counted() -> None:
    fell = Outcome(case(0.5), True, 0.9, 2.7, (), "1.00 m/s")
    stood = Outcome(case(0.5), False, 0.0, 2.0, ("2.0 m: 0.00 m/s",), "0.00 m/s")
    passed, short = (Outcome(case(0.03, to_m=5.0), False, 0.0, way_m, (), "1.00 m/s") for way_m in (5.0, 4.0))
    stopped = Outcome(case(0.03, to_m=5.0), False, 0.0, 5.0, ("2.0 m: 0.00 m/s",), "1.00 m/s")
    figures = drops._figures([fell, stood], [passed, short, stopped])
    assert (figures["drops"], figures["over_the_edge"], figures["over_the_edge_with_chair"]) == (2, 1, 1)
    assert (figures["speed_at_the_edge_max_mps"], figures["ways"], figures["false_stops"]) == (0.9, 3, 2)
    assert "7" in json.dumps(drops._conditions([fell, stood], [passed, short, stopped], 7))
