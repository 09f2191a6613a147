"""The wheelchair as an MJCF body, and the latch that holds it.

Body frame: origin on the ground under the middle of the marker board, x the way a robot approaches, z up.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from robot_stack.core.robot import Robot
from sim.params import SimParams, Wheelchair
from sim.plant.inertia import CHAIR_HEIGHT_M, wheelchair_inertial
from sim.plant.mjcf import CHAIR_BITS, CHAIR_GROUP, add_geom, add_inertial, vector

SIDES = ("left", "right")
CASTORS = tuple(f"chair_castor_{end}_{side}" for end in ("front", "rear") for side in SIDES)
_BOARD_THICKNESS_M = 0.02
_SEAT_THICKNESS_M = 0.06
_BACK_THICKNESS_M = 0.04
_CLOTH, _STEEL, _RUBBER, _WHITE = "0.20 0.30 0.45 1", "0.62 0.64 0.67 1", "0.15 0.15 0.15 1", "0.92 0.92 0.92 1"


def add_wheelchair(body: Element, robot: Robot, params: SimParams) -> None:
    """Adds the wheelchair, weightless and invisible until it is placed."""
    chair = params.wheelchair
    frame = SubElement(body, "body", name="wheelchair", gravcomp="1")
    SubElement(frame, "freejoint", name="wheelchair")
    add_inertial(frame, wheelchair_inertial(robot, chair, 0.0))
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        end = (-chair.rail_length_m, sign * 0.5 * (chair.rail_inner_m + chair.rail_outer_m), robot.latch.height_m)
        SubElement(frame, "site", name=f"chair_latch_{side}", pos=vector(end))
    _shape(frame, chair)
    _castors(frame, chair)


def add_latch(root: Element) -> None:
    """Two ball joints side by side: the chair is led in every direction and free to pitch on uneven ground."""
    equality = SubElement(root, "equality")
    for side in SIDES:
        SubElement(
            equality,
            "connect",
            name=f"latch_{side}",
            site1=f"latch_{side}",
            site2=f"chair_latch_{side}",
            active="false",
            solref="0.005 1",
        )


def _shape(frame: Element, chair: Wheelchair) -> None:
    _box(
        frame,
        "chair_board",
        (0.0, _BOARD_THICKNESS_M),
        (-0.5 * chair.board_width_m, 0.5 * chair.board_width_m),
        (chair.board_middle_m - 0.5 * chair.board_height_m, chair.board_middle_m + 0.5 * chair.board_height_m),
        _WHITE,
    )
    half = 0.5 * chair.seat_width_m
    back = (_BOARD_THICKNESS_M, _BOARD_THICKNESS_M + _BACK_THICKNESS_M)
    _box(frame, "chair_back", back, (-half, half), (chair.seat_top_m, CHAIR_HEIGHT_M), _CLOTH)
    seat = (chair.seat_top_m - _SEAT_THICKNESS_M, chair.seat_top_m)
    _box(frame, "chair_seat", (_BOARD_THICKNESS_M, chair.seat_length_m), (-half, half), seat, _CLOTH)
    height = (chair.rail_bottom_m, chair.rail_top_m)
    for side, (inner, outer) in zip(
        SIDES,
        ((chair.rail_inner_m, chair.rail_outer_m), (-chair.rail_outer_m, -chair.rail_inner_m)),
        strict=True,
    ):
        _box(frame, f"chair_rail_{side}", (-chair.rail_length_m, 0.0), (inner, outer), height, _STEEL)
        # The joint between rail and seat.
        legs = (chair.rail_bottom_m, chair.seat_top_m - _SEAT_THICKNESS_M)
        edge = (half - 0.03, half) if side == "left" else (-half, -half + 0.03)
        _box(frame, f"chair_frame_{side}", (_BOARD_THICKNESS_M, chair.castor_front_x_m), edge, legs, _STEEL)


def _box(
    frame: Element, name: str, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], color: str
) -> None:
    """A box from edge to edge, m."""
    half = tuple(0.5 * (high - low) for low, high in (x, y, z))
    centre = tuple(0.5 * (high + low) for low, high in (x, y, z))
    add_geom(frame, name, "box", half, CHAIR_BITS, CHAIR_GROUP, pos=vector(centre), rgba=color)


def _castors(frame: Element, chair: Wheelchair) -> None:
    """Spheres that slide with the drag of a castor that rolls and swivels: four points of support, no direction."""
    places = [
        (x, y)
        for x in (chair.castor_front_x_m, chair.castor_rear_x_m)
        for y in (0.5 * chair.castor_track_m, -0.5 * chair.castor_track_m)
    ]
    for name, (x, y) in zip(CASTORS, places, strict=True):
        add_geom(
            frame,
            name,
            "sphere",
            (chair.castor_radius_m,),
            CHAIR_BITS,
            CHAIR_GROUP,
            pos=vector((x, y, chair.castor_radius_m)),
            priority="2",
            condim="3",
            friction=vector((chair.brake_friction, 0.0, 0.0)),
            rgba=_RUBBER,
        )
