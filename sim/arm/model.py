"""The arm as MJCF text.

Zero pose: stretched upwards. Joint 1 turns about z, joints 2, 3 and 4 about y, joint 5 about z, joint 6 about y; the
gripper points along +y of the flange. The links collide with the table and the cube, not with each other.
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from sim.arm.params import ArmParams, Cube
from sim.plant.mjcf import NO_BITS, WORLD_GROUP, add_geom, number, vector

FINGERS = ("picker_1_joint", "picker_2_joint")
_ARM_BITS, _TABLE_BITS, _CUBE_BITS = (2, 1), (1, 2), (1, 3)
_ARM_GROUP = 1
_GREY, _WHITE, _DARK = "0.55 0.57 0.60 1", "0.93 0.93 0.95 1", "0.20 0.21 0.23 1"
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
Vector = tuple[float, float, float]


def write_arm(params: ArmParams, timestep_s: float) -> str:
    """The model; actuators are six motors in joint order, then the two fingers' position servos."""
    root = Element("mujoco", model="manipulator")
    SubElement(root, "compiler", angle="radian", autolimits="true")
    option = SubElement(
        root, "option", timestep=number(timestep_s), integrator="implicitfast", cone="elliptic", iterations="20"
    )
    SubElement(option, "flag", autoreset="disable")
    default = SubElement(root, "default")
    # Stiff dry friction: a closed brake must not creep under the arm's weight.
    SubElement(default, "joint", solreffriction="0.004 1", solimpfriction="0.9999 0.9999 0.001")
    _looks(root)
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos="0.4 -0.5 2.5", dir="-0.2 0.3 -1", directional="true", diffuse="0.6 0.6 0.6")
    add_geom(world, "table", "plane", (1.0, 1.0, 0.05), _TABLE_BITS, WORLD_GROUP, rgba="0.72 0.66 0.58 1")
    _arm(world, params)
    if params.cube is not None:
        _cube(world, params.cube)
    _actuators(root, params)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _looks(root: Element) -> None:
    """Visual parts, for pictures only."""
    asset, visual = SubElement(root, "asset"), SubElement(root, "visual")
    sky = {"type": "skybox", "builtin": "gradient", "rgb1": "0.93 0.95 0.97", "rgb2": "0.70 0.76 0.82"}
    SubElement(asset, "texture", sky, width="256", height="1536")
    SubElement(visual, "global", offwidth="1920", offheight="1080")
    SubElement(visual, "quality", shadowsize="8192", offsamples="8")
    SubElement(visual, "map", shadowclip="0.9")
    SubElement(visual, "headlight", ambient="0.4 0.4 0.4", diffuse="0.4 0.4 0.4", specular="0 0 0")


def _arm(world: Element, params: ArmParams) -> None:
    body, mass, radius = params.body, params.body.mass_kg, params.body.radius_m
    base = SubElement(world, "body", name="base", pos=vector((0.0, 0.0, body.pedestal_m)))
    if body.pedestal_m:
        half_m = 0.5 * body.pedestal_m
        more = {"pos": vector((0.0, 0.0, -half_m)), "rgba": _GREY, "mass": "0"}
        add_geom(base, "pedestal", "cylinder", (1.2 * radius.base, half_m), NO_BITS, WORLD_GROUP, **more)
    _bar(
        base,
        "base",
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.5 * body.base_height_m),
        0.97 * radius.base,
        mass.base,
        NO_BITS,
        _DARK,
    )
    shoulder = _link(base, params, 0, (0.0, 0.0, 0.5 * body.base_height_m), _Z)
    top = (0.0, 0.0, 0.5 * body.base_height_m)
    _bar(shoulder, "shoulder", (0.0, 0.0, 0.0), top, radius.base, mass.shoulder, NO_BITS, _WHITE)
    upper = _link(shoulder, params, 1, top, _Y)
    elbow = (0.0, 0.0, body.upper_arm_m)
    _limb(upper, "upper_arm", elbow, radius.arm, mass.upper_arm, body.elbow_share)
    forearm = _link(upper, params, 2, elbow, _Y)
    wrist = (0.0, 0.0, body.forearm_m)
    _limb(forearm, "forearm", wrist, radius.arm, mass.forearm, body.elbow_share)
    wrist1 = _link(forearm, params, 3, wrist, _Y)
    aside = (0.0, body.wrist_offset_m, 0.0)
    _bar(wrist1, "wrist1", (0.0, 0.0, 0.0), aside, radius.wrist, mass.wrist1, _ARM_BITS, _GREY)
    wrist2 = _link(wrist1, params, 4, aside, _Z)
    up = (0.0, 0.0, body.wrist_m)
    _bar(wrist2, "wrist2", (0.0, 0.0, 0.0), up, radius.wrist, mass.wrist2, _ARM_BITS, _WHITE)
    wrist3 = _link(wrist2, params, 5, up, _Y)
    flange = (0.0, body.flange_m, 0.0)
    _bar(wrist3, "wrist3", (0.0, 0.0, 0.0), flange, 0.97 * radius.wrist, mass.wrist3, _ARM_BITS, _GREY)
    _gripper(wrist3, params, body.flange_m)


def _link(parent: Element, params: ArmParams, axis: int, place: Vector, turns_about: Vector) -> Element:
    """A body that joint number ``axis`` turns against ``parent``."""
    joint, kind = params.joints[axis], params.kind(axis)
    link = SubElement(parent, "body", name=f"link{axis + 1}", pos=vector(place))
    SubElement(
        link,
        "joint",
        name=joint.name,
        axis=vector(turns_about),
        range=vector((joint.lower_rad, joint.upper_rad)),
        armature=number(kind.armature_kgm2),
        damping=number(kind.viscous_friction_nms),
        frictionloss=number(kind.friction_nm),
    )
    return link


def _bar(
    body: Element,
    name: str,
    start: Vector,
    end: Vector,
    radius_m: float,
    mass_kg: float,
    bits: tuple[int, int],
    color: str,
) -> None:
    more = {"fromto": vector((*start, *end)), "mass": number(mass_kg), "rgba": color}
    add_geom(body, name, "capsule", (radius_m,), bits, _ARM_GROUP, **more)


def _limb(body: Element, name: str, end: Vector, radius_m: float, mass_kg: float, at_end: float) -> None:
    """A tube with the motor of the next joint at its end."""
    _bar(body, name, (0.0, 0.0, 0.0), end, radius_m, (1.0 - at_end) * mass_kg, _ARM_BITS, _WHITE)
    more = {"pos": vector(end), "mass": number(at_end * mass_kg), "rgba": _GREY}
    add_geom(body, f"{name}_motor", "sphere", (radius_m * 1.1,), NO_BITS, _ARM_GROUP, **more)


def _gripper(wrist3: Element, params: ArmParams, flange_m: float) -> None:
    gripper = params.gripper
    end_m = flange_m + gripper.length_m
    box = (0.05, 0.5 * gripper.length_m, 0.03)
    more = {"pos": vector((0.0, flange_m + box[1], 0.0)), "mass": number(gripper.mass_kg), "rgba": _DARK}
    add_geom(wrist3, "gripper", "box", box, _ARM_BITS, _ARM_GROUP, **more)
    half = (0.006, 0.5 * gripper.finger_length_m, 0.01)
    for name, sign in zip(FINGERS, (1.0, -1.0), strict=True):
        place = (sign * (gripper.stroke_m + half[0]), end_m, 0.0)  # when closed, the fingertips touch in the middle
        finger = SubElement(wrist3, "body", name=name.removesuffix("_joint"), pos=vector(place))
        SubElement(
            finger,
            "joint",
            name=name,
            type="slide",
            axis=vector((-sign, 0.0, 0.0)),
            range=vector((0.0, gripper.stroke_m)),
            armature="0.05",
        )
        more = {"pos": vector((0.0, half[1], 0.0)), "mass": number(gripper.finger_mass_kg), "rgba": _GREY}
        add_geom(finger, f"{name}_finger", "box", half, _ARM_BITS, _ARM_GROUP, friction="1.2 0.01 0.001", **more)
    tip = (0.0, end_m + gripper.finger_length_m, 0.0)
    SubElement(wrist3, "site", name="tool", pos=vector(tip))
    payload = SubElement(wrist3, "body", name="payload", pos=vector(tip))
    mass = max(params.payload_kg, 1e-6)
    SubElement(payload, "inertial", pos="0 0 0", mass=number(mass), diaginertia=vector((1e-9, 1e-9, 1e-9)))


def _cube(world: Element, cube: Cube) -> None:
    half = 0.5 * cube.edge_m
    body = SubElement(world, "body", name="cube", pos=vector((cube.x_m, cube.y_m, half)))
    SubElement(body, "freejoint", name="cube")
    more = {"mass": number(cube.mass_kg), "rgba": "0.80 0.35 0.25 1", "friction": "1.2 0.01 0.001", "condim": "4"}
    add_geom(body, "cube", "box", (half, half, half), _CUBE_BITS, WORLD_GROUP, **more)


def _actuators(root: Element, params: ArmParams) -> None:
    actuator, gripper = SubElement(root, "actuator"), params.gripper
    for joint in params.joints:
        SubElement(actuator, "motor", name=joint.name, joint=joint.name)
    for name in FINGERS:
        SubElement(
            actuator,
            "position",
            name=name,
            joint=name,
            kp=number(gripper.stiffness_n_per_m),
            kv=number(gripper.damping_ns_per_m),
            forcerange=vector((-gripper.force_n, gripper.force_n)),
        )
