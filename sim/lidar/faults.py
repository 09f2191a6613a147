"""Faults of the simulated LiDAR, raised by ``/sim/inject_lidar_fault``."""

from __future__ import annotations

from sim.lidar.sensor import CLEAR, Conditions
from sim.lidar.sun import Sun
from sim.lidar.weather import DUST, RAIN, SNOW, Kind, Weather
from sim.plant.sensor_faults import SensorFaults, sensor_fault

SILENT, FROZEN, NOISY, RATE, COVERED, SUN = "silent", "frozen", "noisy", "rate", "covered", "sun"

WEATHERS: tuple[Kind, ...] = ("rain", "snow", "dust")

KINDS = (
    sensor_fault(SILENT, "the LiDAR sends nothing"),
    sensor_fault(FROZEN, "the LiDAR repeats its last points with new stamps"),
    sensor_fault(NOISY, "ranges are noisier", ("factor", 1.0, 100.0, 5.0)),
    sensor_fault(RATE, "the LiDAR turns slower", ("sweeps per second", 0.1, 10.0, 2.0)),
    sensor_fault(COVERED, "the lens is covered, from the front on", ("share of the circle", 0.01, 1.0, 1.0)),
    sensor_fault(RAIN, "it rains", ("mm/h", 0.1, 150.0, 25.0)),
    sensor_fault(SNOW, "it snows", ("mm/h of water", 0.1, 10.0, 1.0)),
    sensor_fault(DUST, "dust is in the air", ("visibility in m", 10.0, 2000.0, 100.0)),
    sensor_fault(SUN, "a low sun shines in", ("azimuth in map in deg, 360 along x", 0.1, 360.0, 360.0)),
)
BY_NAME = {kind.name: kind for kind in KINDS}


class LidarFaults(SensorFaults):
    """The faults in force, of one LiDAR; one weather at a time."""

    def __init__(self) -> None:
        super().__init__(BY_NAME, one_of=WEATHERS)

    def conditions(self, now_s: float) -> Conditions:
        """The present conditions of the sensor."""
        if not self.active(now_s):
            return CLEAR
        weather = [Weather(kind, amount) for kind in WEATHERS if (amount := self.value(kind, now_s)) is not None]
        covered = self.value(COVERED, now_s) or 0.0
        azimuth_deg = self.value(SUN, now_s)
        sun = None if azimuth_deg is None else Sun(azimuth_deg)
        return Conditions(self.value(NOISY, now_s) or 1.0, covered, weather[0] if weather else None, sun)
