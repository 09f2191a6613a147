"""Rain, snow, dust and sun are no obstacles. Thin, small, half-hidden or new objects are obstacles at once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.contract import frames
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST
from robot_stack.core.robot import Robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.weather_filter import Crowd, crowd_of
from sim.lidar.sensor import Conditions
from tests.benchmarks.support.weather_scenes import Bystander, Shower, shower, with_bystander

HALF_S = 0.05


@pytest.fixture
def crowd(robot: Robot, params: PerceptionParams) -> Crowd:
    return crowd_of(robot.range_sensors[frames.LIDAR], params.obstacles, params.obstacles.range_m)


def patch(at_m: float, size_m: float, robot: Robot) -> np.ndarray:
    """Returns the (n, 3) points of a square ``at_m`` ahead of the sensor and at its height."""
    sensor = robot.range_sensors[frames.LIDAR]
    across = np.arange(-0.5 * size_m, 0.5 * size_m, at_m * math.radians(sensor.span_deg) / sensor.columns)
    up = np.arange(-0.5 * size_m, 0.5 * size_m, at_m * sensor.ring_spacing_rad)
    y, z = np.meshgrid(across, up)
    x = np.full(y.size, sensor.xyz_m[0] + at_m)
    return np.stack([x, y.ravel(), sensor.xyz_m[2] + z.ravel()], axis=1).astype(np.float32)


@pytest.mark.parametrize("at_m", [1.0, 2.0, 3.0])
def test_objects_are_accepted_by_size_at_any_distance(at_m: float, crowd: Crowd, robot: Robot) -> None:
    large, small = patch(at_m, 0.08, robot), patch(at_m, 0.03, robot)
    assert len(crowd.split(large)[0]) == len(large)
    things, doubtful = crowd.split(small)
    assert len(things) == 0
    np.testing.assert_array_equal(doubtful, small)
    assert len(crowd.split(small[:2])[1]) == 0


def test_required_number_of_points_has_limits(crowd: Crowd, params: PerceptionParams) -> None:
    few, many = params.obstacles.neighbours_min, params.obstacles.neighbours_max
    far, close = np.array([[20.0, 0.0, 0.7]], np.float32), np.array([[0.8, 0.0, 0.7]], np.float32)
    assert len(crowd.split(np.repeat(far, few, axis=0))[0]) == few
    assert len(crowd.split(np.repeat(far, few - 1, axis=0))[0]) == 0
    assert len(crowd.split(np.repeat(close, many, axis=0))[0]) == many
    assert len(crowd.split(np.repeat(close, many - 1, axis=0))[0]) == 0


def test_returns_scattered_over_height_are_no_obstacle(crowd: Crowd, robot: Robot, params: PerceptionParams) -> None:
    """Both columns have as many returns as an object at 6 m. Only those in adjacent rings are one."""
    count, ring_m = params.obstacles.neighbours_min, 6.0 * robot.range_sensors[frames.LIDAR].ring_spacing_rad
    column = np.full((count, 3), [6.2, 0.0, 0.3], np.float32)
    low, strewn = column.copy(), column.copy()
    low[:, 2] += np.arange(count, dtype=np.float32) * ring_m
    strewn[:, 2] += np.arange(count, dtype=np.float32) * 5.0 * ring_m
    things, doubtful = crowd.split(low)
    assert len(things) >= 2
    assert len(things) + len(doubtful) == count
    things, doubtful = crowd.split(strewn)
    assert len(things) == 0
    assert len(doubtful) == count


def test_non_finite_and_out_of_range_points_are_dropped(crowd: Crowd) -> None:
    points = np.array([[100.0, 0.0, 1.0], [np.nan, 0.0, 1.0]], np.float32)
    assert [len(part) for part in crowd.split(points)] == [0, 0]
    assert [len(part) for part in crowd.split(points[:0])] == [0, 0]


def run(pipeline: Pipeline, weather: Shower, halves: int, begin_s: float = 0.0) -> list[np.ndarray]:
    """Returns the obstacles after each half sweep."""
    found = []
    for step in range(halves):
        stamp_s = begin_s + HALF_S * step
        pipeline.motion.on_odometry(stamp_s, IDENTITY, ZERO_TWIST)
        found.append(pipeline.scene(weather.half_sweep(stamp_s, step % 2).points, stamp_s).obstacles)
    return found


@pytest.mark.parametrize("kind", ["rain", "snow", "dust", "sun"])
@pytest.mark.parametrize("returns", [100, 300, 1000])
def test_airborne_returns_are_no_obstacle(kind: str, returns: int, pipeline: Pipeline) -> None:
    """On an empty plain every published obstacle is a phantom."""
    weather = shower(kind, returns, seed=41)
    counts = [len(obstacles) for obstacles in run(pipeline, weather, 20)]
    assert 0.8 * returns < weather.mean_airborne() < 1.2 * returns
    assert np.mean(counts) < 1.0


BYSTANDERS = [
    Bystander("pole", 0.025, 1.0),
    Bystander("leg", 0.025, 0.45),
    Bystander("person", 0.20, 1.70, light=0.05),
]


@pytest.mark.parametrize("who", BYSTANDERS, ids=lambda who: who.name)
@pytest.mark.parametrize("place", [(0.8, 0.0), (2.0, 0.0), (4.0, 0.0), (6.0, 0.0), (8.0, 1.0)])
@pytest.mark.parametrize("kind", ["clear", "snow", "sun"])
def test_who_enters_is_seen_in_the_first_turn_and_never_lost(
    who: Bystander, place: tuple[float, float], kind: str, pipeline: Pipeline
) -> None:
    """place: in base_link, whose footprint ends at 0.5 m. Half sweeps meet dead ahead: each sees one side."""
    x_m, y_m = place
    weather = with_bystander(shower(kind, 1000, seed=42), who, x_m, y_m)
    weather.absent = True
    run(pipeline, weather, 6)
    weather.absent = False
    for obstacles in run(pipeline, weather, 14, 6 * HALF_S)[2:]:
        assert (np.hypot(obstacles[:, 0] - x_m, obstacles[:, 1] - y_m) < who.radius_m + 0.1).any()


def test_occupied_cell_with_few_returns_stays_occupied(pipeline: Pipeline) -> None:
    """A pole stays in place but yields only stray returns from some step on."""
    who, at_m = Bystander("pole", 0.025, 1.0), 2.0
    weather = with_bystander(shower("clear", 0, seed=43), who, at_m)
    run(pipeline, weather, 6)
    weather.fewer_of_bystander = 0.1
    for step in range(6, 26):
        obstacles = run(pipeline, weather, 1, step * HALF_S)[0]
        occupied = pipeline.space.remembered(IDENTITY, math.inf)
        assert (np.hypot(occupied[:, 0] - at_m, occupied[:, 1]) < 0.15).any()
        if step > 9:  # after 0.15 s without a hit the obstacle comes from memory
            assert (np.hypot(obstacles[:, 0] - at_m, obstacles[:, 1]) < 0.15).any()


def test_thin_chain_across_the_path_is_detected_and_kept(pipeline: Pipeline) -> None:
    """8 mm thick, 0.5 m high: with too few returns for a new obstacle, the existing one stays."""
    across = Bystander("chain", 0.004, 1.0)
    weather = with_bystander(shower("clear", 0, seed=45), across, 2.0, lying_m=0.5)
    for obstacles in run(pipeline, weather, 12)[4:]:
        assert (np.abs(obstacles[:, 0] - 2.0) < 0.15).any()
    weather.fewer_of_bystander = 0.4
    run(pipeline, weather, 12, 12 * HALF_S)
    occupied = pipeline.space.remembered(IDENTITY, math.inf)
    assert (np.abs(occupied[:, 0] - 2.0) < 0.15).any()


def test_the_ground_under_a_shower_does_not_fall_away(pipeline: Pipeline) -> None:
    weather = shower("snow", 1000, seed=44)
    for step in range(12):
        seen = pipeline.segment(pipeline.points(weather.half_sweep(0.0, step % 2).points, 0.0)[0])
        assert not seen.profile.drop_m.any()


def test_weather_is_drawn_by_its_seed() -> None:
    first, again, other = (shower("rain", 300, seed).half_sweep(0.0, 0) for seed in (7, 7, 8))
    assert np.array_equal(first.points, again.points)
    assert not np.array_equal(first.points, other.points)
    assert shower("clear", 300, 7).conditions == Conditions()
