"""The robot as solids that turn and roll with its joints, for drawing: ``config/robot_shape.yaml``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from robot_stack.contract import frames
from robot_stack.core.config import Config, Positive, load
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Robot

Matrix = NDArray[np.float64]
"""(4, 4) homogeneous transform, m."""

_SPOKE_WIDTH = 0.25  # of the wheel's radius
_SPOKE_PROUD = 1.1  # of the wheel's width: it shows on both sides

Triple = tuple[float, float, float]
Colour = Annotated[str, Field(pattern="^#[0-9a-f]{6}$")]


class Solid(Config):
    """size_m: length, width, height before it is turned; turn_deg: about x, then y, then z of its parent."""

    kind: Literal["box", "cylinder", "sphere"]
    size_m: tuple[Positive, Positive, Positive]
    at_m: Triple
    turn_deg: Triple
    colour: Colour

    def pose(self) -> Matrix:
        """In its parent's frame."""
        return transform(self.at_m, self.turn_deg)

    def rgb(self) -> Triple:
        """[0, 1] each."""
        red, green, blue = bytes.fromhex(self.colour[1:])
        return red / 255.0, green / 255.0, blue / 255.0


class BodyColours(Config):
    """Colours of the robot's parts other than wheels and mast."""

    body: Colour
    stripe: Colour
    deck: Colour
    post: Colour
    lidar: Colour
    hooks: Colour
    boom: Colour


class RobotShape(Config):
    """Solids of each thing, in the frames that the file names; the robot's own follow from robot.yaml."""

    robot: BodyColours
    mast_colour: Colour
    tyre_colour: Colour
    spoke_colour: Colour
    wheelchair: tuple[Solid, ...]
    passenger: tuple[Solid, ...]
    person: tuple[Solid, ...]
    station: tuple[Solid, ...]


class Placed(NamedTuple):
    """A solid of ``part`` and its pose in the frame that the caller chose."""

    part: str
    solid: Solid
    pose: Matrix


def transform(at_m: Sequence[float], turn_deg: Sequence[float] = (0.0, 0.0, 0.0)) -> Matrix:
    """A pose by its place, m, and its turns about the fixed axes x, y, z, degrees."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    pose[:3, 3] = at_m
    return pose


def planar(pose: Pose2) -> Matrix:
    """A pose on the ground."""
    return transform((pose.x, pose.y, 0.0), (0.0, 0.0, math.degrees(pose.yaw)))


def placed(part: str, solids: Sequence[Solid], pose: Matrix) -> list[Placed]:
    """Solids of a thing that stands at ``pose``."""
    return [Placed(part, solid, pose @ solid.pose()) for solid in solids]


def robot_solids(robot: Robot, shape: RobotShape, joints: Mapping[str, float]) -> list[Placed]:
    """The robot in base_link. joints: rad by name (``fl_drive``, ``fl_steer``, ...); a missing joint counts as 0."""
    parts = placed("base", (*_body(robot, shape.robot), _mast(robot, shape)), np.eye(4))
    wheel = _wheel(robot, shape)
    for module, place in zip(frames.MODULES, robot.module_positions_m(), strict=True):
        steer, drive = _angle(joints, f"{module}_steer"), _angle(joints, f"{module}_drive")
        # Rolling forward turns a wheel about its axle's y.
        turn = transform((0.0, 0.0, 0.0), (0.0, 0.0, math.degrees(steer)))
        turn = turn @ transform((0.0, 0.0, 0.0), (0.0, math.degrees(drive), 0.0))
        axle = transform((*place, robot.wheel_radius_m)) @ turn
        parts += placed(f"{module}_wheel", wheel, axle)
    return parts


def _body(robot: Robot, colours: BodyColours) -> list[Solid]:
    """Chassis, LiDARs and latch in base_link."""
    box, latch = robot.chassis, robot.latch
    x, y, z = robot.lidar_xyz_m
    middle_m, front_m, post_m = 0.5 * (box.bottom_m + box.top_m), 0.5 * box.length_m, z - 0.03 - box.top_m
    solids = [
        _box((box.length_m, box.width_m, box.top_m - box.bottom_m - 0.02), (0.0, 0.0, middle_m), colours.body),
        _box((0.02, box.width_m - 0.06, 0.07), (front_m, 0.0, box.top_m - 0.08), colours.stripe),
        _box((box.length_m - 0.16, box.width_m - 0.12, 0.03), (0.0, 0.0, box.top_m + 0.005), colours.deck),
    ]
    if post_m > 0.0:
        solids.append(_cylinder(0.05, post_m, (x, y, box.top_m + 0.5 * post_m), colours.post))
    solids.append(_cylinder(0.11, 0.08, (x, y, z), colours.lidar))
    hook_m = latch.half_width_m - 0.0625
    solids += [
        _box((0.06, 0.06, 0.10), (latch.x_m - 0.03, across_m, latch.height_m), colours.hooks)
        for across_m in (hook_m, -hook_m)
    ]
    if frames.OVERHEAD_LIDAR in robot.range_sensors:
        x, y, z = robot.range_sensors[frames.OVERHEAD_LIDAR].xyz_m
        begin_m, end_m, up_m = robot.mast.x_m - 0.01, x + 0.04, robot.mast.top_m + 0.015
        solids.append(_box((end_m - begin_m, 0.04, 0.03), (0.5 * (begin_m + end_m), y, up_m), colours.boom))
        solids.append(_box((0.065, 0.065, 0.06), (x, y, z + 0.015), colours.lidar))
    return solids


def _box(size_m: Triple, at_m: Triple, colour: str) -> Solid:
    return Solid(kind="box", size_m=size_m, at_m=at_m, turn_deg=(0.0, 0.0, 0.0), colour=colour)


def _cylinder(diameter_m: float, height_m: float, at_m: Triple, colour: str) -> Solid:
    size_m = (diameter_m, diameter_m, height_m)
    return Solid(kind="cylinder", size_m=size_m, at_m=at_m, turn_deg=(0.0, 0.0, 0.0), colour=colour)


def _mast(robot: Robot, shape: RobotShape) -> Solid:
    mast = robot.mast
    return Solid(
        kind="cylinder",
        size_m=(2.0 * mast.radius_m, 2.0 * mast.radius_m, mast.top_m - mast.bottom_m),
        at_m=(mast.x_m, mast.y_m, 0.5 * (mast.bottom_m + mast.top_m)),
        turn_deg=(0.0, 0.0, 0.0),
        colour=shape.mast_colour,
    )


def _wheel(robot: Robot, shape: RobotShape) -> tuple[Solid, Solid]:
    """Tyre and spoke, in a frame whose y is the axle."""
    diameter, width = 2.0 * robot.wheel_radius_m, robot.wheel_width_m
    spoke = (0.8 * diameter, _SPOKE_PROUD * width, _SPOKE_WIDTH * robot.wheel_radius_m)
    middle, flat = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return (
        Solid(
            kind="cylinder",
            size_m=(diameter, diameter, width),
            at_m=middle,
            turn_deg=(90.0, 0.0, 0.0),
            colour=shape.tyre_colour,
        ),
        Solid(kind="box", size_m=spoke, at_m=middle, turn_deg=flat, colour=shape.spoke_colour),
    )


def _angle(joints: Mapping[str, float], name: str) -> float:
    angle = joints.get(name, 0.0)
    return angle if math.isfinite(angle) else 0.0


def quaternion_of(pose: Matrix) -> tuple[float, float, float, float]:
    """x, y, z, w of a rotation (3, 3), or of that in a pose (4, 4); w >= 0."""
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    return float(x), float(y), float(z), float(w)


def load_robot_shape() -> RobotShape:
    """``config/robot_shape.yaml``. Raises ConfigError."""
    return load(RobotShape, "robot_shape")
