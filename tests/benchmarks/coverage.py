"""Share of the 2 m band around the footprint where a thing 0.2 m wide is seen by the robot's range sensors, and of the
outline where its safety edge senses that thing's first touch."""

from __future__ import annotations

from robot_stack.core.docks import load_docks
from robot_stack.core.robot import load_robot
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.coverage.params import load_coverage_params
from robot_stack.coverage.report import bodies, figures, look_around
from tests.benchmarks.support.framework import Aim, Result

AIMS = {
    "seen_pct_06_empty": Aim(">", 99.0),
    "seen_pct_06_chair": Aim(">", 98.0),
    "seen_pct_03_empty": Aim(">", 95.0),
    "seen_pct_03_chair": Aim(">", 90.0),
    "contact_pct_03_empty": Aim(">", 99.0),
}


def run() -> Result:
    """(figures in percent, conditions): geometry alone, no noise and no weather."""
    robot, params = load_robot(), load_coverage_params()
    standing = bodies(robot, load_robot_shape(), load_docks())
    found = figures(look_around(robot.range_sensors, standing, params), params)
    conditions: dict[str, object] = {
        "sensors": {name: sensor.device for name, sensor in robot.range_sensors.items()},
        "band_m": params.band_m,
        "thing_width_m": params.thing_width_m,
        "points_min": params.points_min,
        "lowest_point_m": params.lowest_point_m,
    }
    return Result(found, conditions)
