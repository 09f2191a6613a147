"""The docks, ``config/docks.yaml``: where they are, what markers they carry, and where the robot stands when docked.

Dock frame: origin on the ground below the middle of the marker board, x the way a robot approaches (into the board),
z up. A marker's own frame is OpenCV's: x to the right and y up for whoever looks at it, z out of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from robot_stack.contract.frames import FRONT_CAMERA, REAR_CAMERA
from robot_stack.core.config import Config, load
from robot_stack.core.geometry import Pose2

Positive = Annotated[float, Field(gt=0.0)]
MarkerId = Annotated[int, Field(ge=0, le=999)]


class Place(Config):
    """A planar pose."""

    x_m: float
    y_m: float
    yaw_rad: Annotated[float, Field(ge=-2.0 * math.pi, le=2.0 * math.pi)]

    def pose(self) -> Pose2:
        return Pose2(self.x_m, self.y_m, self.yaw_rad)


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


class Dock(Config):
    """One dock.

    staging: base_link in map where docking begins. dock_pose: base_link in the dock frame when docked.
    """

    kind: Literal["wheelchair", "station"]
    camera: Literal["front", "rear"]
    staging: Place
    dock_pose: Place
    markers: Annotated[dict[MarkerId, MarkerPlace], Field(min_length=1)]

    @property
    def camera_frame(self) -> str:
        """Frame of the camera that sees its markers."""
        return FRONT_CAMERA if self.camera == "front" else REAR_CAMERA


class Docks(Config):
    """Everything in ``config/docks.yaml``. dictionary: OpenCV's name of the markers' dictionary."""

    dictionary: Annotated[str, Field(pattern="^DICT_")]
    marker_size_m: Positive
    docks: dict[str, Dock]

    @model_validator(mode="after")
    def _markers_belong_to_one_dock(self) -> Docks:
        owner: dict[int, str] = {}
        for name, dock in self.docks.items():
            for marker in dock.markers:
                if marker in owner:
                    raise ValueError(f"marker {marker} belongs to {owner[marker]!r} and to {name!r}")
                owner[marker] = name
        return self

    def of_marker(self, marker_id: int) -> tuple[str, Dock] | None:
        """The dock that carries a marker."""
        return next(((name, dock) for name, dock in self.docks.items() if marker_id in dock.markers), None)

    def latched_wheelchair(self) -> Pose2 | None:
        """A docked wheelchair's frame in base_link: they all hang at the same latch. None: no dock is one."""
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
    """``config/docks.yaml``. Raises ConfigError."""
    return load(Docks, "docks")
