"""A door's panel in the LiDAR's scene, where its body is."""

from __future__ import annotations

import numpy as np

from sim.camera.motion import still
from tests.unit.sim.lidar.scenes import exact, lidar, pose, world


def test_the_panel_is_seen_where_the_body_is() -> None:
    door = {"name": "hall", "x_m": 5.0, "y_m": 0.0, "length_m": 0.1, "width_m": 2.0, "height_m": 2.0}
    sensor = lidar(world(doors=[door]), exact())
    for x in (5.0, 7.0):
        points = sensor.sweep(still(pose(0.0, 0.0)), 0.0, {"door_hall": still(pose(x, 0.0))}).points
        ahead = points[(np.abs(points["y"]) < 0.5) & (points["z"] > -0.2) & (points["x"] > 1.0)]
        assert len(ahead)
        assert np.abs(ahead["x"] - (x - 0.05)).max() < 0.6  # the sensor is mounted beside base_link
