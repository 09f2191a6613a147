"""People and objects tracked by navigation as markers for RViz, Foxglove and the touch screen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from robot_stack.contract import frames
from robot_stack.core.people import Person, confirmed

WALKING, PERSON, OBJECT, VELOCITY = "walking", "person", "object", "velocity"
AHEAD_S = 1.0
_COLOURS = {WALKING: (0.76, 0.35, 0.0), PERSON: (0.76, 0.35, 0.0), OBJECT: (0.36, 0.1, 0.54)}
_HEIGHT_M = {WALKING: 1.7, PERSON: 1.7, OBJECT: 0.6}
_SHAFT = Vector3(x=0.08, y=0.2, z=0.2)
_LIFETIME = Duration(sec=1)


def kind_of(person: Person) -> str:
    """The namespace of its marker."""
    return WALKING if person.walks else PERSON if person.walked else OBJECT


def people_markers(people: Iterable[Person], stamp: Time, stamp_s: float, sightings: int) -> MarkerArray:
    """At stamp_s, in odom. sightings: people seen in fewer grids are left out."""
    markers = []
    for number, person in enumerate(confirmed(people, sightings)):
        markers.append(_cylinder(person, number, stamp, stamp_s))
        if person.walks:
            markers.append(_arrow(person, number, stamp, stamp_s))
    return MarkerArray(markers=markers)


def _marker(namespace: str, number: int, stamp: Time, kind: str, **fields: Any) -> Marker:
    red, green, blue = _COLOURS[kind]
    marker = Marker(ns=namespace, id=number, action=Marker.ADD, lifetime=_LIFETIME, **fields)
    marker.header.frame_id, marker.header.stamp = frames.ODOM, stamp
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=0.7)
    return marker


def _cylinder(person: Person, number: int, stamp: Time, stamp_s: float) -> Marker:
    kind = kind_of(person)
    across_m, height_m = 2.0 * person.radius_m, _HEIGHT_M[kind]
    marker = _marker(kind, number, stamp, kind, type=Marker.CYLINDER, scale=Vector3(x=across_m, y=across_m, z=height_m))
    marker.pose.position.x, marker.pose.position.y = person.at(stamp_s)
    marker.pose.position.z = 0.5 * height_m
    return marker


def _arrow(person: Person, number: int, stamp: Time, stamp_s: float) -> Marker:
    ends = [Point(x=x, y=y, z=0.1) for x, y in (person.at(stamp_s), person.at(stamp_s + AHEAD_S))]
    return _marker(VELOCITY, number, stamp, WALKING, type=Marker.ARROW, points=ends, scale=_SHAFT)
