"""The robot as MJCF bodies.

Wheels are ellipsoids: one clean contact point on every surface, as a slightly crowned tyre has, plus a torsional
friction that represents the contact patch (turning a module on the spot needs torque). Cylinders touch with two edges
5 cm apart, which gives nearly three times that torque, and need the costlier general collision test on ramps.

Only a wheel's friction counts (contact priority), so that the ground under each wheel can be made slippery at run
time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from robot_stack.contract.frames import MODULES
from robot_stack.core.robot import Robot
from sim.params import SimParams
from sim.plant.edge_model import add_edge, core_size_m, plate_travel_m, soft
from sim.plant.inertia import chassis_inertial, steering_inertial, wheel_inertial
from sim.plant.mjcf import (
    NO_BITS,
    ROBOT_BITS,
    ROBOT_GROUP,
    add_geom,
    add_inertial,
    number,
    vector,
)

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Deviations of one machine from its drawing: true wheel radii, m, and steering zeros, rad, per module."""

    wheel_radii_m: tuple[float, float, float, float]
    steering_zeros_rad: tuple[float, float, float, float]


def nominal_tolerances(robot: Robot) -> Tolerances:
    """A machine exactly as drawn."""
    r = robot.wheel_radius_m
    return Tolerances((r, r, r, r), (0.0, 0.0, 0.0, 0.0))


def torsional_friction_m(friction: float, params: SimParams) -> float:
    """Torque over load of a wheel turning on the spot: a uniformly loaded disc of the contact patch's radius."""
    return 2.0 / 3.0 * params.wheel.contact_patch_radius_m * friction


def add_robot(body: Element, robot: Robot, params: SimParams, friction: float, tolerances: Tolerances) -> None:
    base = SubElement(body, "body", name="base")
    SubElement(base, "freejoint", name="base")
    add_inertial(base, chassis_inertial(robot, params))
    box = robot.chassis
    half = (0.5 * box.length_m, 0.5 * box.width_m, 0.5 * (box.top_m - box.bottom_m))
    centre = (0.0, 0.0, 0.5 * (box.top_m + box.bottom_m))
    bits = ROBOT_BITS if robot.safety_edge is None else NO_BITS
    add_geom(base, "chassis", "box", half, bits, ROBOT_GROUP, pos=vector(centre), rgba="0.93 0.93 0.95 1")
    if robot.safety_edge is not None:
        length_m, width_m = core_size_m(robot, robot.safety_edge)
        core = (0.5 * length_m, 0.5 * width_m, half[2])
        add_geom(base, "chassis_core", "box", core, ROBOT_BITS, ROBOT_GROUP, pos=vector(centre), rgba="0 0 0 0")
        add_edge(base, robot, robot.safety_edge)
    _decoration(base, robot)
    SubElement(base, "site", name="imu", pos=vector(robot.imu_xyz_m))
    _latch(base, robot, params)
    for index, name in enumerate(MODULES):
        _module(base, name, robot.module_positions_m()[index], tolerances.wheel_radii_m[index], robot, params, friction)


def _latch(base: Element, robot: Robot, params: SimParams) -> None:
    """The plates that carry the hooks, and the holding places of the hooks."""
    latch, plate, front_m, edge = robot.latch, params.latch, 0.5 * robot.chassis.length_m, robot.safety_edge
    inwards_m, outwards_m = plate.plate_inwards_m, plate.plate_outwards_m
    half = (0.5 * plate.plate_length_m, 0.5 * (inwards_m + outwards_m), 0.5 * plate.plate_height_m)
    middle_m = latch.half_width_m + 0.5 * (outwards_m - inwards_m)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        SubElement(
            base, "site", name=f"latch_{side}", pos=vector((latch.x_m, sign * latch.half_width_m, latch.height_m))
        )
        centre = (front_m - half[0], sign * middle_m, latch.height_m)
        add_geom(
            base,
            f"latch_plate_{side}",
            "box",
            half,
            ROBOT_BITS,
            ROBOT_GROUP,
            pos=vector(centre),
            rgba="0.35 0.36 0.38 1",
            **({} if edge is None else soft(plate_travel_m(edge, params))),
        )


def _decoration(base: Element, robot: Robot) -> None:
    """Parts for pictures only: an orange front, and the mast of the LiDAR."""
    box, lidar = robot.chassis, robot.lidar_xyz_m
    front = (0.5 * box.length_m, 0.0, box.top_m - 0.08)
    add_geom(
        base,
        "front_stripe",
        "box",
        (0.006, 0.45 * box.width_m, 0.04),
        NO_BITS,
        ROBOT_GROUP,
        pos=vector(front),
        rgba="0.95 0.45 0.10 1",
    )
    mast = 0.5 * (lidar[2] - box.top_m)
    add_geom(
        base,
        "mast",
        "cylinder",
        (0.02, mast),
        NO_BITS,
        ROBOT_GROUP,
        pos=vector((lidar[0], lidar[1], box.top_m + mast)),
        rgba="0.2 0.2 0.2 1",
    )
    add_geom(base, "lidar", "cylinder", (0.05, 0.04), NO_BITS, ROBOT_GROUP, pos=vector(lidar), rgba="0.1 0.1 0.1 1")


def _module(
    base: Element,
    name: str,
    place_m: tuple[float, float],
    radius_m: float,
    robot: Robot,
    params: SimParams,
    friction: float,
) -> None:
    fork = SubElement(base, "body", name=f"{name}_steer", pos=vector((*place_m, robot.wheel_radius_m)))
    add_inertial(fork, steering_inertial(robot, params))
    steering, wheel = params.steering, params.wheel
    _suspension(fork, name, robot, params)
    _hinge(
        fork, f"{name}_steer", "0 0 1", steering.friction_nm, steering.viscous_friction_nms, steering.rotor_inertia_kgm2
    )
    tower = (0.0, 0.0, robot.wheel_radius_m + 0.02)
    add_geom(
        fork,
        f"{name}_fork",
        "cylinder",
        (0.045, 0.02),
        NO_BITS,
        ROBOT_GROUP,
        pos=vector(tower),
        rgba="0.30 0.31 0.33 1",
    )
    hub = SubElement(fork, "body", name=f"{name}_wheel")
    add_inertial(hub, wheel_inertial(robot))
    _hinge(
        hub, f"{name}_drive", "0 1 0", wheel.rolling_friction_nm, wheel.viscous_friction_nms, wheel.rotor_inertia_kgm2
    )
    # The contact point lies in the middle of the overlap: half the sink more, and it rolls with its true radius.
    rim_m = radius_m + 0.5 * params.physics.contact_sink_m
    add_geom(
        hub,
        f"{name}_wheel",
        "ellipsoid",
        (rim_m, 0.5 * robot.wheel_width_m, rim_m),
        ROBOT_BITS,
        ROBOT_GROUP,
        condim="4",
        priority="1",
        friction=vector((friction, torsional_friction_m(friction, params), 0.0001)),
        rgba="0.12 0.12 0.13 1",
    )
    rim = (0.6 * robot.wheel_radius_m, 0.52 * robot.wheel_width_m)
    add_geom(
        hub,
        f"{name}_rim",
        "cylinder",
        rim,
        NO_BITS,
        ROBOT_GROUP,
        quat=vector((math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)),
        rgba="0.75 0.76 0.78 1",
    )
    spoke = (0.55 * robot.wheel_radius_m, 0.55 * robot.wheel_width_m, 0.008)
    add_geom(hub, f"{name}_spoke", "box", spoke, NO_BITS, ROBOT_GROUP, rgba="0.3 0.3 0.32 1")


def _hinge(body: Element, name: str, axis: str, friction_nm: float, viscous_nms: float, rotor_kgm2: float) -> None:
    # A stiff friction constraint: with MuJoCo's default a closed brake would creep 1-2 mm/s on a slope.
    stiff = {"solreffriction": "0.002 1", "solimpfriction": "0.9999 0.9999 0.001"}
    SubElement(
        body,
        "joint",
        stiff,
        name=name,
        type="hinge",
        axis=axis,
        frictionloss=number(friction_nm),
        damping=number(viscous_nms),
        armature=number(rotor_kgm2),
    )


def _suspension(body: Element, name: str, robot: Robot, params: SimParams) -> None:
    """A spring whose rest is where the empty robot's share of weight compresses it: base_link is then on the ground.

    Without it a rigid frame on four rigid wheels would stand on three of them, as no real robot does.
    """
    spring = params.suspension
    unsprung_kg = robot.wheel_mass_kg + robot.steer_mass_kg
    share_n = (0.25 * robot.mass_kg - unsprung_kg) * GRAVITY_MPS2
    damping = spring.damping_ratio * math.sqrt(spring.stiffness_n_per_m * robot.mass_kg)
    SubElement(
        body,
        "joint",
        name=f"{name}_suspension",
        type="slide",
        axis="0 0 1",
        stiffness=number(spring.stiffness_n_per_m),
        springref=number(-share_n / spring.stiffness_n_per_m),
        damping=number(damping),
        range=vector((-spring.travel_m, spring.travel_m)),
    )
