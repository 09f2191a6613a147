"""Named poses of a site that its keepout zones exclude: waypoints, homes, docks, safe places.

Navigation refuses a goal there when it is sent; these checks find it when the site or the mission is loaded.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from robot_stack.core.docks import DocksFile
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Kind, Mission
from robot_stack.core.robot import Footprint, Robot
from robot_stack.core.safe_places import SafePlaces
from robot_stack.core.zones import Zone, ZoneType, load_zones


@dataclass(frozen=True, slots=True)
class Keepout:
    """The keepout zones of a site, and the footprints of the robot that stays outside them."""

    zones: tuple[Zone, ...]
    footprint: Footprint
    footprint_with_chair: Footprint

    def zone_at(self, pose: Pose2, *, chair: bool = False) -> str:
        """Name of the first zone that the footprint at ``pose`` (base_link in map) overlaps; empty if there is none.

        chair: with a wheelchair at the latch.
        """
        f = self.footprint_with_chair if chair else self.footprint
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        outline = np.array(f.corners()) @ np.array([(c, s), (-s, c)]) + (pose.x, pose.y)
        return next((zone.name for zone in self.zones if zone.overlaps(outline)), "")


def load_keepout(map_name: str, robot: Robot) -> Keepout:
    """map_name: of ``config/maps``, a path, or empty: no map, no zones. Raises ConfigError."""
    zones = load_zones(map_name) if map_name else ()
    closed = tuple(zone for zone in zones if zone.type is ZoneType.KEEPOUT)
    return Keepout(closed, robot.footprint, robot.footprint_with_chair)


def keepout_problems(
    mission: Mission, docks: Mapping[str, str], keepout: Keepout, passenger_attached: bool
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Field, and a sentence for people, of each waypoint in a keepout zone, and of a home in one.

    docks: kind of each dock by its id. passenger_attached: at the start; the robot goes home without a passenger.
    """
    aboard = passenger_attached
    for index, waypoint in enumerate(mission.waypoints):
        zone = keepout.zone_at(waypoint.pose, chair=aboard)
        if zone:
            where = f"waypoint {waypoint.name!r} of {mission.id!r}"
            yield ("waypoints", index), f"{where}: {_lies_in(zone, chair=aboard)}"
        if waypoint.action.kind in (Kind.DOCK, Kind.UNDOCK):
            aboard = docks.get(waypoint.action.dock_id) == "wheelchair"
    zone = keepout.zone_at(mission.home.pose)
    if zone:
        yield ("home",), f"the home of {mission.id!r}: {_lies_in(zone)}"


def site_keepout_problems(
    docks: DocksFile, places: SafePlaces, keepout: Keepout, robot: Robot
) -> Iterator[tuple[str, str]]:
    """Name of the place, and what is wrong, for each docked pose, staging pose and safe place in a keepout zone.

    Safe places are for a robot with a passenger.
    """
    for name, place in docks.docks.items():
        dock = place.of_robot(robot, docks.staging_m)
        poses = {"docked pose": place.place.pose().compose(dock.dock_pose.pose())}
        poses |= {f"staging pose {i}": staging.pose() for i, staging in enumerate(dock.stagings, 1)}
        for what, pose in poses.items():
            zone = keepout.zone_at(pose)
            if zone:
                yield f"dock {name!r}, {what}", _lies_in(zone)
    for safe_place in places.places:
        zone = keepout.zone_at(safe_place.pose, chair=True)
        if zone:
            yield str(safe_place), _lies_in(zone, chair=True)


def _lies_in(zone: str, *, chair: bool = False) -> str:
    return f"the footprint{' with a wheelchair' if chair else ''} lies in the keepout zone {zone!r}"
