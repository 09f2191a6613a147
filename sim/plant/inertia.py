"""Masses and inertias of the bodies, from ``config/robot.yaml`` and ``config/sim.yaml``.

Inertias are diagonal, kg m2, about the body's centre of gravity, axes parallel to base_link.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.core.robot import Robot
from sim.params import SimParams, Wheelchair

Vector = tuple[float, float, float]

PASSENGER_SIZE_M: Vector = (0.55, 0.45, 0.90)  # a seated person as a box
CHAIR_HEIGHT_M = 0.90


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass in kg, centre of gravity in the body frame in m, diagonal inertia in kg m2."""

    mass_kg: float
    centre_m: Vector
    diagonal_kgm2: Vector


def box_diagonal(mass_kg: float, size_m: Vector) -> Vector:
    """Inertia of a solid box of the given edge lengths."""
    x, y, z = size_m
    return mass_kg / 12.0 * (y * y + z * z), mass_kg / 12.0 * (x * x + z * z), mass_kg / 12.0 * (x * x + y * y)


def wheel_inertial(robot: Robot) -> Inertial:
    """A solid disc that turns about y; origin at its centre."""
    m, r, w = robot.wheel_mass_kg, robot.wheel_radius_m, robot.wheel_width_m
    across = m * (3.0 * r * r + w * w) / 12.0
    return Inertial(m, (0.0, 0.0, 0.0), (across, 0.5 * m * r * r, across))


def steering_inertial(robot: Robot, params: SimParams) -> Inertial:
    """Fork, gear and motor as a cylinder about the steering axis; origin at the wheel centre."""
    m, r, h = robot.steer_mass_kg, 0.06, 0.15
    across = m * (3.0 * r * r + h * h) / 12.0
    return Inertial(m, (0.0, 0.0, params.steering.mass_above_axle_m), (across, across, 0.5 * m * r * r))


def chassis_inertial(robot: Robot, params: SimParams) -> Inertial:
    """The rest of the robot's mass, placed so that the whole robot has the configured centre of gravity.

    Raises ValueError if the configured masses or heights leave no sensible chassis.
    """
    wheels, modules = 4.0 * robot.wheel_mass_kg, 4.0 * robot.steer_mass_kg
    mass = robot.mass_kg - wheels - modules
    if mass <= 0.0:
        raise ValueError(f"mass_kg {robot.mass_kg} leaves nothing for the chassis beside wheels and steering")
    moment = robot.mass_kg * robot.centre_of_gravity_height_m
    module_m = robot.wheel_radius_m + params.steering.mass_above_axle_m
    height = (moment - wheels * robot.wheel_radius_m - modules * module_m) / mass
    box = robot.chassis
    if not box.bottom_m < height < box.top_m:
        raise ValueError(f"the chassis' centre of gravity would be at {height:.3f} m, outside its box")
    size = (box.length_m, box.width_m, box.top_m - box.bottom_m)
    return Inertial(mass, (0.0, 0.0, height), box_diagonal(mass, size))


def wheelchair_inertial(robot: Robot, chair: Wheelchair, passenger_mass_kg: float) -> Inertial:
    """The chair with a passenger on it; origin on the ground below the chair's board.

    Raises ValueError for a passenger above the robot's limit.
    """
    if not 0.0 <= passenger_mass_kg <= robot.passenger_max_mass_kg:
        limit = robot.passenger_max_mass_kg
        raise ValueError(f"passenger_mass_kg must be in 0..{limit}, is {passenger_mass_kg}")
    m1, z1 = robot.chair_mass_kg, chair.centre_of_gravity_height_m
    m2, z2 = passenger_mass_kg, chair.passenger_centre_of_gravity_height_m
    mass = m1 + m2
    height = (m1 * z1 + m2 * z2) / mass
    lever = m1 * (z1 - height) ** 2 + m2 * (z2 - height) ** 2  # parallel axes, about x and y only
    size = (chair.rail_length_m + chair.seat_length_m, 2.0 * chair.rail_outer_m, CHAIR_HEIGHT_M)
    own = box_diagonal(m1, size)
    seated = box_diagonal(m2, PASSENGER_SIZE_M)
    return Inertial(
        mass,
        (chair.centre_of_gravity_x_m, 0.0, height),
        (own[0] + seated[0] + lever, own[1] + seated[1] + lever, own[2] + seated[2]),
    )
