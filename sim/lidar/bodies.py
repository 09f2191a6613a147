"""Shapes of moving bodies for the LiDAR: a person, the wheelchair and its passenger."""

from __future__ import annotations

from robot_stack.core.robot import Robot
from robot_stack.core.robot_shape import RobotShape, robot_solids
from sim.lidar import labels
from sim.lidar.shapes import BOX, CYLINDER, Shape
from sim.params import Wheelchair

# A person of 1.75 m, frame: on the ground between the feet, x ahead. Radius, foot and top of each cylinder, m.
_LEG_APART_M, _LEG_AHEAD_M = 0.10, 0.12
_LEG, _TRUNK, _HEAD = (0.08, 0.0, 0.85), (0.21, 0.80, 1.48), (0.10, 1.48, 1.75)
PERSON_RADIUS_M = 0.25

_PAINT = 0.5  # reflectivity of the robot's own parts

_BOARD_M, _SEAT_M, _BACK_M, _FRAME_M = 0.02, 0.06, 0.04, 0.03
_BACK_TOP_M = 0.90
# A passenger above the seat, in the wheelchair's frame: facing away from the robot.
_PASSENGER_X_M, _PASSENGER_TOP_M, _PASSENGER_HEAD_TOP_M = 0.20, 1.10, 1.36
_LAP_HALF_M, _LAP_TOP_M = (0.22, 0.18), 0.66


def robot_shapes(robot: Robot, shape: RobotShape) -> list[Shape]:
    """Of the robot itself what stands still in base_link and upright; its wheels hide nothing from a sensor above."""
    kinds = {"box": BOX, "cylinder": CYLINDER}
    return [
        Shape(
            kinds[solid.kind],
            solid.at_m,
            (0.5 * solid.size_m[0], 0.5 * solid.size_m[1], 0.5 * solid.size_m[2]),
            labels.ROBOT,
            _PAINT,
        )
        for part, solid, _ in robot_solids(robot, shape, {})
        if part == "base" and solid.kind in kinds and not any(solid.turn_deg)
    ]


def person_shapes(reflectivity: float) -> list[Shape]:
    """A person in mid-stride."""
    legs = [
        _upright(x, y, *_LEG, labels.PERSON, reflectivity)
        for x, y in ((_LEG_AHEAD_M, _LEG_APART_M), (-_LEG_AHEAD_M, -_LEG_APART_M))
    ]
    return [*legs, *(_upright(0.0, 0.0, *part, labels.PERSON, reflectivity) for part in (_TRUNK, _HEAD))]


def chair_shapes(chair: Wheelchair, reflectivity: float, *, passenger: bool) -> list[Shape]:
    """As the physics has it: board, back, seat, rails, frame, castors."""
    half = 0.5 * chair.seat_width_m
    board = (chair.board_middle_m - 0.5 * chair.board_height_m, chair.board_middle_m + 0.5 * chair.board_height_m)
    legs = (chair.rail_bottom_m, chair.seat_top_m - _SEAT_M)
    parts = [
        ((0.0, _BOARD_M), (-0.5 * chair.board_width_m, 0.5 * chair.board_width_m), board),
        ((_BOARD_M, _BOARD_M + _BACK_M), (-half, half), (chair.seat_top_m, _BACK_TOP_M)),
        ((_BOARD_M, chair.seat_length_m), (-half, half), (chair.seat_top_m - _SEAT_M, chair.seat_top_m)),
    ]
    for sign in (1.0, -1.0):
        rail = sorted((sign * chair.rail_inner_m, sign * chair.rail_outer_m))
        edge = sorted((sign * (half - _FRAME_M), sign * half))
        parts.append(((-chair.rail_length_m, 0.0), (rail[0], rail[1]), (chair.rail_bottom_m, chair.rail_top_m)))
        parts.append(((_BOARD_M, chair.castor_front_x_m), (edge[0], edge[1]), legs))
    shapes = [_edges(x, y, z, reflectivity) for x, y, z in parts]
    for x in (chair.castor_front_x_m, chair.castor_rear_x_m):
        for y in (0.5 * chair.castor_track_m, -0.5 * chair.castor_track_m):
            shapes.append(
                _upright(x, y, chair.castor_radius_m, 0.0, 2.0 * chair.castor_radius_m, labels.CHAIR, reflectivity)
            )
    return shapes + (_passenger(chair, reflectivity) if passenger else [])


def _passenger(chair: Wheelchair, reflectivity: float) -> list[Shape]:
    x, seat = _PASSENGER_X_M, chair.seat_top_m
    ahead = x + _LAP_HALF_M[0]
    return [
        _upright(x, 0.0, 0.19, seat, _PASSENGER_TOP_M, labels.CHAIR, reflectivity),
        _upright(x, 0.0, 0.10, _PASSENGER_TOP_M, _PASSENGER_HEAD_TOP_M, labels.CHAIR, reflectivity),
        _edges((x, ahead + 0.05), (-_LAP_HALF_M[1], _LAP_HALF_M[1]), (seat, _LAP_TOP_M), reflectivity),
    ]


def _edges(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], reflectivity: float) -> Shape:
    """A box from edge to edge, m."""
    (x0, x1), (y0, y1), (z0, z1) = x, y, z
    centre = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1))
    return Shape(BOX, centre, (0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * (z1 - z0)), labels.CHAIR, reflectivity)


def _upright(x: float, y: float, radius: float, foot: float, top: float, label: int, reflectivity: float) -> Shape:
    centre = (x, y, 0.5 * (foot + top))
    return Shape(CYLINDER, centre, (radius, radius, 0.5 * (top - foot)), label, reflectivity)
