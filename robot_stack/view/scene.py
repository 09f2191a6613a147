"""The robot's model as Foxglove's scene entities."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from foxglove.messages import (
    Color,
    CubePrimitive,
    CylinderPrimitive,
    Duration,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    SpherePrimitive,
    Timestamp,
    Vector3,
)

from robot_stack.contract import frames
from robot_stack.core.docks import Docks
from robot_stack.core.robot import Robot
from robot_stack.core.robot_shape import Matrix, Placed, RobotShape, placed, planar, quaternion_of, robot_solids

_NANOSECONDS = 1_000_000_000
_LIFETIME = Duration(sec=2, nsec=0)  # a model without a source disappears
_FOOTPRINT_COLOUR = Color(r=0.12, g=0.72, b=0.68, a=1.0)
_FOOTPRINT_PX = 2.0


class Model:
    """The model in base_link."""

    def __init__(self, robot: Robot, shape: RobotShape, docks: Docks) -> None:
        self._robot, self._shape = robot, shape
        latched = docks.latched_wheelchair()
        self._chair: Matrix | None = None if latched is None else planar(latched)

    def solids(self, joints: Mapping[str, float], attached: bool) -> list[Placed]:
        """joints: rad by name. attached: draws the latched wheelchair with its passenger."""
        solids = robot_solids(self._robot, self._shape, joints)
        if attached and self._chair is not None:
            solids += placed("wheelchair", self._shape.wheelchair, self._chair)
            solids += placed("wheelchair", self._shape.passenger, self._chair)
        return solids

    def footprint(self, attached: bool) -> list[tuple[float, float]]:
        """Corners of the active footprint, m, base_link."""
        return (self._robot.footprint_with_chair if attached else self._robot.footprint).corners()

    def update(
        self, joints: Mapping[str, float], attached: bool, now_ns: int, others: Sequence[SceneEntity] = ()
    ) -> SceneUpdate:
        """A complete update: a new viewer needs no earlier one. now_ns: for the entities' stamps.

        others: additional entities.
        """
        solids = self.solids(joints, attached)
        parts = [
            _entity(part, list(group), now_ns) for part, group in itertools.groupby(solids, key=lambda item: item.part)
        ]
        outline = _outline(self.footprint(attached), now_ns)
        return SceneUpdate(deletions=[], entities=[*parts, outline, *others])


def joint_angles(names: Sequence[str], positions: Sequence[float]) -> dict[str, float]:
    """rad by name; joints without a finite position are left out."""
    return {name: angle for name, angle in zip(names, positions, strict=False) if np.isfinite(angle)}


def entity(name: str, now_ns: int, **primitives: Any) -> SceneEntity:
    """Primitives that move with the robot, in base_link."""
    return SceneEntity(
        timestamp=_stamp(now_ns),
        frame_id=frames.BASE_LINK,
        id=name,
        lifetime=_LIFETIME,
        frame_locked=True,
        **primitives,
    )


def _entity(part: str, solids: Sequence[Placed], now_ns: int) -> SceneEntity:
    return entity(
        part,
        now_ns,
        cubes=[CubePrimitive(pose=_pose(s.pose), size=_size(s), color=_colour(s)) for s in solids if _is(s, "box")],
        spheres=[
            SpherePrimitive(pose=_pose(s.pose), size=_size(s), color=_colour(s)) for s in solids if _is(s, "sphere")
        ],
        cylinders=[
            CylinderPrimitive(pose=_pose(s.pose), size=_size(s), bottom_scale=1.0, top_scale=1.0, color=_colour(s))
            for s in solids
            if _is(s, "cylinder")
        ],
    )


def _outline(points: Sequence[tuple[float, float]], now_ns: int) -> SceneEntity:
    line = LinePrimitive(
        type=LinePrimitiveLineType.LineLoop,
        pose=_pose(np.eye(4)),
        thickness=_FOOTPRINT_PX,
        scale_invariant=True,
        points=[Point3(x=x, y=y, z=0.01) for x, y in points],
        color=_FOOTPRINT_COLOUR,
    )
    return entity("footprint", now_ns, lines=[line])


def _is(item: Placed, kind: str) -> bool:
    return item.solid.kind == kind


def _stamp(now_ns: int) -> Timestamp:
    return Timestamp(sec=now_ns // _NANOSECONDS, nsec=now_ns % _NANOSECONDS)


def _pose(pose: Matrix) -> Pose:
    x, y, z, w = quaternion_of(pose)
    place = Vector3(x=float(pose[0, 3]), y=float(pose[1, 3]), z=float(pose[2, 3]))
    return Pose(position=place, orientation=Quaternion(x=x, y=y, z=z, w=w))


def _size(item: Placed) -> Vector3:
    x, y, z = item.solid.size_m
    return Vector3(x=x, y=y, z=z)


def _colour(item: Placed) -> Color:
    red, green, blue = item.solid.rgb()
    return Color(r=red, g=green, b=blue, a=1.0)
