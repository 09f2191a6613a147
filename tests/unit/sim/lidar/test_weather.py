"""Rain, snow and dust: airborne returns are near and weak, and weaken the returns behind them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.camera.motion import still
from sim.lidar import labels
from sim.lidar.sensor import CLEAR, Conditions, Lidar, Sweep
from sim.lidar.weather import Weather, particles

from .scenes import changed, lidar, world

WALL = {"name": "wall", "x_m": 20.5, "y_m": 0.0, "length_m": 1.0, "width_m": 60.0, "height_m": 20.0}
HERE = still(np.eye(4))
RAIN, SNOW, DUST = Weather("rain", 25.0), Weather("snow", 1.0), Weather("dust", 100.0)


def far_of(sweep: Sweep) -> np.ndarray:
    points = sweep.points
    return np.linalg.norm(np.c_[points["x"], points["y"], points["z"]].astype(float), axis=1)


def sensor(seed: int = 3, walls: bool = False) -> Lidar:
    return lidar(world(walls=[WALL] if walls else []), changed(1200), seed)


def airborne(weather: Weather, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Returns the ranges and intensities of airborne returns."""
    sweep = sensor(seed).sweep(HERE, 0.0, conditions=Conditions(weather=weather))
    mine = sweep.labels == labels.AIRBORNE
    return far_of(sweep)[mine], sweep.points["intensity"][mine]


@pytest.mark.parametrize("weather", [RAIN, SNOW, DUST])
def test_airborne_returns_are_near_and_of_low_intensity(weather: Weather) -> None:
    far, intensity = airborne(weather)
    assert len(far) > 100
    assert np.median(far) < 6.0
    assert far.max() < 30.0
    assert np.median(intensity) < 10.0, "of 255: the ground has 40"


def test_harder_rain_has_more_and_farther_drops_and_extinction_as_measured() -> None:
    counts = [len(airborne(Weather("rain", rate))[0]) for rate in (1.0, 10.0, 50.0)]
    assert counts[0] < counts[1] < counts[2]
    heavy = particles(RAIN, changed()).extinction_per_m
    assert 1.5e-3 < heavy < 4.0e-3, "published fits for 25 mm/h give 2 to 3 per km"
    hundred = particles(DUST, changed()).extinction_per_m
    assert math.exp(-100.0 * hundred) == pytest.approx(0.05), "5 % of contrast at the visibility"


def test_the_mean_number_is_that_of_the_table() -> None:
    """Beams towards the sky detect every particle that they hit."""
    device = sensor()
    sky = int((np.linspace(-30.0, 15.0, 64) > 0.5).sum()) * 1200
    counts = []
    for _ in range(10):
        sweep = device.sweep(HERE, 0.0, conditions=Conditions(weather=RAIN))
        counts.append(int(((sweep.labels == labels.AIRBORNE) & (sweep.points["ring"] > 43)).sum()))
    mean = particles(RAIN, device.params).below[-1] * sky
    assert np.mean(counts) == pytest.approx(mean, rel=0.1)


def test_a_seed_is_a_shower_and_leaves_the_sensor_s_own_noise_alone() -> None:
    first, again, other = (airborne(SNOW, seed)[0] for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    dry, wet = sensor(), sensor()
    dry.sweep(HERE, 0.0, conditions=CLEAR)
    wet.sweep(HERE, 0.0, conditions=Conditions(weather=RAIN))
    assert np.array_equal(dry.sweep(HERE, 0.1).points, wet.sweep(HERE, 0.1).points)


def test_surfaces_are_darker_or_lost_and_never_seen_nearer_than_they_are() -> None:
    device = sensor(walls=True)

    def wall(conditions: Conditions) -> tuple[int, float]:
        sweep = device.sweep(HERE, 0.0, conditions=conditions)
        mine = sweep.labels == labels.WALL
        assert np.abs(sweep.points["x"][mine] - 19.8).max() < 0.2
        return int(mine.sum()), float(np.median(sweep.points["intensity"][mine]))

    clear, rain, dust = (wall(Conditions(weather=weather)) for weather in (None, RAIN, Weather("dust", 15.0)))
    assert rain[1] == pytest.approx(0.8 * clear[1] * math.exp(-2.0 * 2.77e-3 * 21.0), rel=0.08)
    assert 0.9 * clear[0] < rain[0] <= clear[0]
    assert dust[0] < 0.5 * clear[0], "at 20 m, where one sees 15 m"
