"""The MJCF elements used by the model."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, SubElement

from sim.plant.inertia import Inertial

# Collision classes (contype, conaffinity): the robot's own parts never collide with each other, everything else does.
NO_BITS, WORLD_BITS, ROBOT_BITS, CHAIR_BITS = (0, 0), (1, 6), (2, 5), (4, 3)
# Geom groups: rays of sensors hit the world and the chair, not the robot or paint on the ground.
WORLD_GROUP, ROBOT_GROUP, CHAIR_GROUP, PAINT_GROUP, PERSON_GROUP = 0, 1, 3, 4, 5


def add_geom(
    body: Element, name: str, kind: str, size_m: tuple[float, ...], bits: tuple[int, int], group: int, **more: str
) -> None:
    attributes = {
        "name": name,
        "type": kind,
        "size": vector(size_m),
        "contype": str(bits[0]),
        "conaffinity": str(bits[1]),
    }
    SubElement(body, "geom", {**attributes, "group": str(group), **more})


def add_inertial(body: Element, inertial: Inertial) -> None:
    SubElement(
        body,
        "inertial",
        pos=vector(inertial.centre_m),
        mass=number(inertial.mass_kg),
        diaginertia=vector(inertial.diagonal_kgm2),
    )


def quaternion(yaw_rad: float, pitch_rad: float) -> tuple[float, float, float, float]:
    """(w, x, y, z) of a rotation by yaw about z, then by pitch about the new y."""
    cz, sz = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    cy, sy = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    return cz * cy, -sz * sy, cz * sy, sz * cy


def number(value: float) -> str:
    return repr(float(value))


def vector(values: tuple[float, ...]) -> str:
    return " ".join(number(value) for value in values)
