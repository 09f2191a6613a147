"""Writes the MuJoCo model of robot, wheelchair and world as MJCF text.

Obstacles are geoms of the world body: rays test them several times faster than geoms of separate bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robot_stack.contract.frames import MODULES
from robot_stack.core.robot import Robot
from sim.params import SimParams
from sim.plant.chair_model import add_latch, add_wheelchair
from sim.plant.doors import PREFIX
from sim.plant.mjcf import (
    NO_BITS,
    PAINT_GROUP,
    PERSON_GROUP,
    WORLD_BITS,
    WORLD_GROUP,
    add_geom,
    number,
    quaternion,
    vector,
)
from sim.plant.people import HEIGHT_M, RADIUS_M
from sim.plant.robot_model import Tolerances, add_robot
from sim.plant.terrain import Solid, solids
from sim.worldfile import Door, WorldFile

_COLORS = {
    "kerb": "0.62 0.60 0.56 1",
    "wall": "0.74 0.70 0.63 1",
    "box": "0.45 0.52 0.60 1",
    "cylinder": "0.40 0.33 0.24 1",
    "ramp": "0.58 0.58 0.60 1",
    "station": "0.85 0.86 0.88 1",
    "patch": "0.35 0.50 0.62 1",
}


def write_mjcf(
    robot: Robot,
    params: SimParams,
    world: WorldFile,
    tolerances: Tolerances,
    wheelchair: bool,
    people: Sequence[str] = (),
) -> str:
    """The model as MJCF text. The origin of body ``base`` is base_link's; robot and chair stand at the map's origin.

    people: names of the bodies that are persons.
    """
    root = Element("mujoco", model="robot_in_world")
    _options(root, params)
    _assets(root)
    body = SubElement(root, "worldbody")
    _ground(body, world)
    add_robot(body, robot, params, world.friction, tolerances)
    if wheelchair:
        add_wheelchair(body, robot, params)
        add_latch(root)
    for name in people:
        _person(body, name)
    for door in world.doors:
        _door(body, door)
    _actuators(root)
    _sensors(root)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _options(root: Element, params: SimParams) -> None:
    SubElement(root, "compiler", angle="radian", autolimits="true")
    option = SubElement(
        root,
        "option",
        timestep=number(params.physics.timestep_s),
        integrator="implicitfast",
        cone="elliptic",
        impratio=number(params.physics.friction_ratio),
        iterations=str(params.physics.solver_iterations),
    )
    # By default MuJoCo resets a diverged state to the start; the world reports it instead.
    SubElement(option, "flag", autoreset="disable")
    default = SubElement(root, "default")
    SubElement(default, "geom", solref=f"{number(params.physics.contact_time_s)} 1", solimp="0.95 0.99 0.001")
    visual = SubElement(root, "visual")
    SubElement(visual, "global", offwidth="1920", offheight="1080")
    SubElement(visual, "headlight", ambient="0.35 0.35 0.35", diffuse="0.4 0.4 0.4", specular="0 0 0")


def _assets(root: Element) -> None:
    asset = SubElement(root, "asset")
    sky = {"type": "skybox", "builtin": "gradient", "rgb1": "0.75 0.84 0.93", "rgb2": "0.45 0.60 0.78"}
    SubElement(asset, "texture", sky, width="256", height="1536")
    ground = {"type": "2d", "builtin": "checker", "rgb1": "0.42 0.43 0.44", "rgb2": "0.46 0.47 0.48"}
    SubElement(asset, "texture", ground, name="ground", width="256", height="256")
    SubElement(asset, "material", name="ground", texture="ground", texrepeat="0.5 0.5", texuniform="true")


def _ground(body: Element, world: WorldFile) -> None:
    floor = world.floor
    center = (0.5 * (floor.min_x_m + floor.max_x_m), 0.5 * (floor.min_y_m + floor.max_y_m), 0.0)
    size = (0.5 * (floor.max_x_m - floor.min_x_m), 0.5 * (floor.max_y_m - floor.min_y_m), 0.1)
    SubElement(body, "light", pos="0 0 30", dir="-0.3 0.2 -1", directional="true", diffuse="0.7 0.7 0.7")
    add_geom(body, "ground", "plane", size, WORLD_BITS, WORLD_GROUP, pos=vector(center), material="ground")
    for solid in solids(world):
        _solid(body, solid)


def _solid(body: Element, solid: Solid) -> None:
    bits = NO_BITS if solid.kind == "patch" else WORLD_BITS  # a patch is only painted on the ground
    group = PAINT_GROUP if solid.kind == "patch" else WORLD_GROUP
    turned = vector(quaternion(solid.yaw_rad, solid.pitch_rad))
    add_geom(
        body,
        solid.name,
        solid.shape,
        solid.size_m,
        bits,
        group,
        pos=vector(solid.centre_m),
        quat=turned,
        rgba=_COLORS[solid.kind],
    )


def _person(body: Element, name: str) -> None:
    """A kinematic body: the simulation sets its pose, and the robot cannot push it. Origin on the ground."""
    frame = SubElement(body, "body", name=name, mocap="true")
    half = 0.5 * HEIGHT_M
    size = (RADIUS_M, half)
    place = vector((0.0, 0.0, half))
    add_geom(frame, name, "cylinder", size, WORLD_BITS, PERSON_GROUP, pos=place, rgba="0.75 0.45 0.25 1")


def _door(body: Element, door: Door) -> None:
    """A kinematic body as a person's."""
    name, half = f"{PREFIX}{door.name}", 0.5 * door.height_m
    frame = SubElement(body, "body", name=name, mocap="true")
    size = (0.5 * door.length_m, 0.5 * door.width_m, half)
    add_geom(frame, name, "box", size, WORLD_BITS, WORLD_GROUP, pos=vector((0.0, 0.0, half)), rgba=_COLORS["box"])


def _actuators(root: Element) -> None:
    actuator = SubElement(root, "actuator")
    for name in MODULES:
        for part in ("drive", "steer"):
            SubElement(actuator, "motor", name=f"{name}_{part}", joint=f"{name}_{part}")


def _sensors(root: Element) -> None:
    sensor = SubElement(root, "sensor")
    SubElement(sensor, "accelerometer", name="imu_accelerometer", site="imu")
    SubElement(sensor, "gyro", name="imu_gyroscope", site="imu")
