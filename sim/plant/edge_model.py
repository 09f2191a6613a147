"""The safety edge as MJCF: soft strips around the deck and on the latch's plates.

Each strip is a geom whose contacts MuJoCo detects from the first touch on, but resolves only from ``travel_m`` of
overlap on (a negative margin with a gap of the same size). ``sim.plant.edge`` pushes until then. Without a touch,
nothing differs from a robot without an edge.
"""

from __future__ import annotations

from typing import Final
from xml.etree.ElementTree import Element

from robot_stack.core.robot import Robot, SafetyEdge
from sim.params import SimParams
from sim.plant.mjcf import ROBOT_BITS, ROBOT_GROUP, add_geom, number, vector

PREFIX: Final = "edge_"
PLATES: Final = ("latch_plate_left", "latch_plate_right")
_INVISIBLE = "0 0 0 0"


def core_size_m(robot: Robot, edge: SafetyEdge) -> tuple[float, float]:
    """Length and width of the part of the chassis that is rigid from the first touch on."""
    footprint, chassis = robot.footprint, robot.chassis
    length_m = 2.0 * (min(footprint.front_m, -footprint.rear_m) - edge.travel_m)
    return min(chassis.length_m, length_m), min(chassis.width_m, footprint.width_m - 2.0 * edge.travel_m)


def soft(travel_m: float) -> dict[str, str]:
    """Attributes of a geom that is detected from the first touch on and rigid from ``travel_m`` on."""
    return {"margin": number(-travel_m), "gap": number(travel_m)}


def plate_travel_m(edge: SafetyEdge, params: SimParams) -> float:
    """Travel of the strip on a latch plate: deeper overlaps have no clear direction in a plate of this length."""
    return min(edge.travel_m, 0.5 * params.latch.plate_length_m)


def add_edge(base: Element, robot: Robot, edge: SafetyEdge) -> None:
    """The two crossed boxes of ``Robot.edge_boxes``."""
    chassis = robot.chassis
    half_height_m, middle_m = 0.5 * (chassis.top_m - chassis.bottom_m), 0.5 * (chassis.top_m + chassis.bottom_m)
    for name, (front_m, rear_m, half_width_m) in zip(("along", "across"), robot.edge_boxes(), strict=True):
        add_geom(
            base,
            PREFIX + name,
            "box",
            (0.5 * (front_m - rear_m), half_width_m, half_height_m),
            ROBOT_BITS,
            ROBOT_GROUP,
            pos=vector((0.5 * (front_m + rear_m), 0.0, middle_m)),
            rgba=_INVISIBLE,
            **soft(edge.travel_m),
        )
