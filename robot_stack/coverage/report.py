"""The figures of a layout, with and without wheelchair and passenger."""

from __future__ import annotations

from collections.abc import Mapping

from robot_stack.core.docks import Docks
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.core.robot import Robot
from robot_stack.core.robot_shape import RobotShape, placed, planar, robot_solids
from robot_stack.coverage.contact import strips_of
from robot_stack.coverage.coverage import Body, Seen, look, seen_pct
from robot_stack.coverage.params import CoverageParams, Layout

EMPTY, CHAIR = "empty", "chair"


def bodies(robot: Robot, shape: RobotShape, docks: Docks) -> dict[str, Body]:
    """The robot alone, and with a wheelchair latched and a passenger in it. Raises ValueError without a wheelchair."""
    own = robot_solids(robot, shape, {})
    latched = docks.latched_wheelchair()
    if latched is None:
        raise ValueError("no dock is a wheelchair")
    chair = [*placed(CHAIR, shape.wheelchair, planar(latched)), *placed(CHAIR, shape.passenger, planar(latched))]
    strips = strips_of(robot)
    return {
        EMPTY: Body(own, robot.footprint, strips),
        CHAIR: Body([*own, *chair], robot.footprint_with_chair, strips),
    }


def sensors_of(layout: Layout, robot: Robot) -> dict[str, RangeSensor]:
    """Raises KeyError for a sensor that the robot does not have."""
    return {name: robot.range_sensors[name] for name in layout.robot} | dict(layout.own)


def look_around(
    sensors: Mapping[str, RangeSensor], standing: Mapping[str, Body], params: CoverageParams
) -> dict[str, Seen]:
    """Coverage around each of the bodies."""
    return {name: look(sensors, body, params) for name, body in standing.items()}


def figures(seen: Mapping[str, Seen], params: CoverageParams) -> dict[str, float]:
    """``seen_pct_06_chair``: share of the band where an object 0.6 m high is seen; ``map_pct_06_chair``: at 0.6 m.

    ``contact_pct_06_chair``: share of the outline where the safety edge senses the first touch of such an object.
    """
    found = {}
    for name, view in seen.items():
        for height, points in view.things.items():
            found[f"seen_pct_{_tag(height)}_{name}"] = seen_pct(points, params.points_min)
    for name, view in seen.items():
        for height, points in view.maps.items():
            found[f"map_pct_{_tag(height)}_{name}"] = seen_pct(points, params.points_min)
    for name, view in seen.items():
        for height, contacts in view.contacts.items():
            found[f"contact_pct_{_tag(height)}_{name}"] = 100.0 * float(contacts.mean())
    return found


def _tag(height_m: float) -> str:
    return f"{round(10.0 * height_m):02d}"
