"""The docks, ``config/docks.yaml``: where they are, what markers they carry, and where the robot stands when docked.

Dock frame: origin on the ground below the middle of the marker board, x the way a robot approaches (into the board),
z up. A marker's own frame is OpenCV's: x to the right and y up as seen from the front, z out of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Generic, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from robot_stack.contract.frames import FRONT_CAMERA, REAR_CAMERA
from robot_stack.core.config import Config, Positive, load
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Robot, load_robot

MarkerId = Annotated[int, Field(ge=0, le=999)]


class Place(Config):
    """A planar pose."""

    x_m: float
    y_m: float
    yaw_rad: Annotated[float, Field(ge=-2.0 * math.pi, le=2.0 * math.pi)]

    def pose(self) -> Pose2:
        return Pose2(self.x_m, self.y_m, self.yaw_rad)


class StagingAlternative(Config):
    """Another pose to begin docking at. From it the robot faces the board, and the approach still corrects the offset.

    along_m: before the dock pose. across_m: to the left, as the board is seen from there.
    """

    along_m: Annotated[float, Field(ge=1.2, le=2.0)]
    across_m: Annotated[float, Field(ge=-0.5, le=0.5)]


class MarkerPlace(Config):
    """Centre of a marker in the dock frame, m. It faces the robot (-x), turned by yaw_rad about z."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float = 0.0

    def pose(self) -> NDArray[np.float64]:
        """(4, 4) marker in the dock frame."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        # Columns: the marker's x is the dock's -y, its y the dock's z, its z the dock's -x; then turned about z.
        return np.array(
            [[s, 0.0, -c, self.x_m], [-c, 0.0, -s, self.y_m], [0.0, 1.0, 0.0, self.z_m], [0.0, 0.0, 0.0, 1.0]]
        )


class Board(Config):
    """A dock's kind, the robot camera that observes it, and its markers. A charger is a station that charges."""

    kind: Literal["wheelchair", "station", "charger"]
    camera: Literal["front", "rear"]
    markers: Annotated[dict[MarkerId, MarkerPlace], Field(min_length=1)]

    @property
    def camera_frame(self) -> str:
        """Frame of the camera that sees its markers."""
        return FRONT_CAMERA if self.camera == "front" else REAR_CAMERA


class Dock(Board):
    """One dock for this robot.

    staging: base_link in map where docking begins; staging_alternatives: after a failed try, in their order.
    dock_pose: base_link in the dock frame when docked.
    """

    staging: Place
    staging_alternatives: tuple[Place, ...] = ()
    dock_pose: Place

    @property
    def stagings(self) -> tuple[Place, ...]:
        return (self.staging, *self.staging_alternatives)


class DockPlace(Board):
    """One dock as in the file: its place, and where the robot's matching part stands when docked.

    place: the dock frame in map. latch_x_m: the robot's latch, of a wheelchair; camera_x_m: the camera, of a station
    or charger; m in the dock frame.
    """

    place: Place
    staging_alternatives: tuple[StagingAlternative, ...] = ()
    latch_x_m: Annotated[float, Field(lt=0.0)] | None = None
    camera_x_m: Annotated[float, Field(lt=0.0)] | None = None

    @model_validator(mode="after")
    def _says_where_the_robot_stands(self) -> DockPlace:
        by_latch, by_camera = self.latch_x_m is not None, self.camera_x_m is not None
        wheelchair = self.kind == "wheelchair"
        if (by_latch, by_camera) != (wheelchair, not wheelchair):
            raise ValueError("a wheelchair has latch_x_m, a station or charger camera_x_m, and neither has the other")
        if self.kind == "wheelchair" and self.camera != "front":
            raise ValueError("a wheelchair is docked to by the front camera: the latch is at the robot's front")
        return self

    def of_robot(self, robot: Robot, staging_m: float) -> Dock:
        """The dock for ``robot``, with a staging pose ``staging_m`` before the dock pose."""
        front = self.camera == "front"
        if self.latch_x_m is not None:
            x, y = self.latch_x_m - robot.latch.x_m, 0.0
        else:
            assert self.camera_x_m is not None
            camera = robot.front_camera_xyz_m if front else robot.rear_camera_xyz_m
            ahead = 1.0 if front else -1.0
            x, y = self.camera_x_m - ahead * camera[0], -ahead * camera[1]
        docked = Pose2(x, y, 0.0 if front else math.pi)
        staging = self.place.pose().compose(Pose2(docked.x - staging_m, docked.y, docked.yaw))
        others = [self._facing_board(item, docked) for item in self.staging_alternatives]
        return Dock(
            kind=self.kind,
            camera=self.camera,
            markers=self.markers,
            staging=_place(staging),
            staging_alternatives=tuple(_place(self.place.pose().compose(pose)) for pose in others),
            dock_pose=_place(docked),
        )

    @staticmethod
    def _facing_board(item: StagingAlternative, docked: Pose2) -> Pose2:
        """base_link in the dock frame, turned so that the camera's side faces the middle of the board."""
        x, y = docked.x - item.along_m, docked.y + item.across_m
        return Pose2(x, y, docked.yaw + math.atan2(-y, -x))


def _place(pose: Pose2) -> Place:
    return Place(x_m=pose.x, y_m=pose.y, yaw_rad=pose.yaw)


DockT = TypeVar("DockT", bound=Board)


class _Docks(Config, Generic[DockT]):
    """dictionary: OpenCV's name of the markers' dictionary."""

    dictionary: Annotated[str, Field(pattern="^DICT_")]
    marker_size_m: Positive
    docks: dict[str, DockT]

    @model_validator(mode="after")
    def _markers_belong_to_one_dock(self) -> Self:
        owner: dict[int, str] = {}
        for name, dock in self.docks.items():
            for marker in dock.markers:
                if marker in owner:
                    raise ValueError(f"marker {marker} belongs to {owner[marker]!r} and to {name!r}")
                owner[marker] = name
        return self


class DocksFile(_Docks[DockPlace]):
    """Everything in ``config/docks.yaml``. staging_m: distance from the staging pose to the dock pose."""

    staging_m: Positive

    def of_robot(self, robot: Robot) -> Docks:
        """The docks for ``robot``."""
        docks = {name: dock.of_robot(robot, self.staging_m) for name, dock in self.docks.items()}
        return Docks(dictionary=self.dictionary, marker_size_m=self.marker_size_m, docks=docks)


class Docks(_Docks[Dock]):
    """The docks for one robot."""

    def of_marker(self, marker_id: int) -> tuple[str, Dock] | None:
        """The dock that carries a marker."""
        return next(((name, dock) for name, dock in self.docks.items() if marker_id in dock.markers), None)

    def latched_wheelchair(self) -> Pose2 | None:
        """A docked wheelchair's frame in base_link: all hang at the same latch. None: no dock is a wheelchair."""
        chairs = (dock for dock in self.docks.values() if dock.kind == "wheelchair")
        return next((dock.dock_pose.pose().inverse() for dock in chairs), None)


def marker_corners(size_m: float) -> NDArray[np.float64]:
    """(4, 3) corners in the marker's frame, m, in OpenCV's order: top left, top right, bottom right, bottom left."""
    h = 0.5 * size_m
    return np.array([[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]])


def board_corners(markers: Mapping[int, MarkerPlace], size_m: float) -> dict[int, NDArray[np.float64]]:
    """(4, 3) corners of each marker in the dock frame, m, in OpenCV's order."""
    corners = np.c_[marker_corners(size_m), np.ones(4)]
    return {marker: (place.pose() @ corners.T).T[:, :3] for marker, place in markers.items()}


def load_docks() -> Docks:
    """``config/docks.yaml`` for the robot of ``config/robot.yaml``. Raises ConfigError."""
    return load(DocksFile, "docks").of_robot(load_robot())
