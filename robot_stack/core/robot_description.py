"""The robot as a URDF document, made from ``config/robot.yaml`` and ``config/robot_shape.yaml``.

It has frames, joints and looks. Masses and collision shapes are left out: the simulation has its own model, and
robot_state_publisher's parser does not support inertia of a root link.
Source: https://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from robot_stack.contract import frames
from robot_stack.core.camera import mounting
from robot_stack.core.robot import Robot
from robot_stack.core.robot_shape import Matrix, RobotShape, Solid, robot_solids, transform

_NAME = "robot"


def robot_description(robot: Robot, shape: RobotShape) -> str:
    """The URDF document. Link names are the frames of /tf and /tf_static, joint names those of /joint_states."""
    root = ElementTree.Element("robot", name=_NAME)
    solids = {
        part: [item.solid for item in group]
        for part, group in itertools.groupby(robot_solids(robot, shape, {}), key=lambda item: item.part)
    }
    _link(root, frames.BASE_LINK, solids["base"])
    for module, (x, y) in zip(frames.MODULES, robot.module_positions_m(), strict=True):
        steering, wheel = frames.steering_link(module), frames.wheel_link(module)
        axle = transform((x, y, robot.wheel_radius_m))
        _link(root, steering)
        joint = _joint(root, f"{module}_steer", "continuous", frames.BASE_LINK, steering, axle)
        _axis(joint, "0 0 1", robot.steer.max_torque_nm, robot.steer.max_rate_radps)
        _link(root, wheel, solids[f"{module}_wheel"])
        joint = _joint(root, f"{module}_drive", "continuous", steering, wheel, np.eye(4))
        _axis(joint, "0 1 0", robot.drive.max_torque_nm, robot.drive.max_speed_radps)
    for frame, pose in _sensors(robot):
        _link(root, frame)
        _joint(root, f"{frame}_mounting", "fixed", frames.BASE_LINK, frame, pose)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True)


def _sensors(robot: Robot) -> Iterable[tuple[str, Matrix]]:
    """Frame and pose in base_link of every sensor, as their drivers publish them on /tf_static."""
    yield frames.IMU, transform(robot.imu_xyz_m)
    for name, sensor in robot.range_sensors.items():
        pose = transform(sensor.xyz_m)
        pose[:3, :3] = robot.sensor_frame(name)
        yield name, pose
    for frame in (frames.FRONT_CAMERA, frames.REAR_CAMERA):
        yield frame, mounting(robot, frame)


def _link(root: ElementTree.Element, name: str, solids: Sequence[Solid] = ()) -> None:
    link = ElementTree.SubElement(root, "link", name=name)
    for number, solid in enumerate(solids):
        visual = ElementTree.SubElement(link, "visual")
        ElementTree.SubElement(
            visual, "origin", xyz=_numbers(solid.at_m), rpy=_numbers(math.radians(angle) for angle in solid.turn_deg)
        )
        geometry = ElementTree.SubElement(visual, "geometry")
        x, _, z = solid.size_m
        match solid.kind:
            case "box":
                ElementTree.SubElement(geometry, "box", size=_numbers(solid.size_m))
            case "cylinder":
                ElementTree.SubElement(geometry, "cylinder", radius=_number(0.5 * x), length=_number(z))
            case "sphere":
                ElementTree.SubElement(geometry, "sphere", radius=_number(0.5 * x))
        material = ElementTree.SubElement(visual, "material", name=f"{name}_{number}")
        ElementTree.SubElement(material, "color", rgba=_numbers((*solid.rgb(), 1.0)))


def _joint(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str, pose: Matrix
) -> ElementTree.Element:
    """pose: of the child in the parent at joint position 0."""
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    rpy = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz")
    ElementTree.SubElement(joint, "origin", xyz=_numbers(pose[:3, 3]), rpy=_numbers(rpy))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _axis(joint: ElementTree.Element, axis: str, effort_nm: float, velocity_radps: float) -> None:
    ElementTree.SubElement(joint, "axis", xyz=axis)
    ElementTree.SubElement(joint, "limit", effort=_number(effort_nm), velocity=_number(velocity_radps))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: float) -> str:
    return f"{value:.9g}"
