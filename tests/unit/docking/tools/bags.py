"""Generated recordings of dockings, in the format of the recorder."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.message_definitions import message_definition
from robot_stack.recording.writer import BagWriter, Format, topic_info

START_S = 1_700_000_000.0
FX, CX, CY = 900.0, 639.5, 359.5
ROWS = (
    topics.DOCKING_STATUS,
    topics.ARUCO_DETECTIONS,
    topics.FRONT_IMAGE,
    topics.FRONT_CAMERA_INFO,
    topics.REAR_CAMERA_INFO,
    topics.SAFETY_STATUS,
    topics.VELOCITY_LIMIT,
    topics.DOCKING_CMD_VEL,
    topics.ODOM,
    topics.JOINT_STATES,
    topics.PASSENGER_ATTACHED,
    topics.DIAGNOSTICS,
    topics.MISSION_STATUS,
)
STORE = get_typestore(Stores.ROS2_JAZZY)
for _row in ROWS:
    if _row.type.startswith("custom_msgs"):
        STORE.register(get_types_from_msg(message_definition(_row.type), _row.type))


def make(type_name: str, **values: Any) -> Any:
    """Returns a message. Fields without a value are zero, empty or the type's default."""
    fields = STORE.fielddefs[type_name][1]
    return STORE.types[type_name](**{name: values.get(name, _zero(kind)) for name, kind in fields})


def _zero(kind: Any) -> Any:
    node, detail = int(kind[0]), kind[1]
    if node == 2:  # a message
        return make(detail)
    if node in (3, 4):  # array, sequence
        inner, count = detail
        if int(inner[0]) == 1 and inner[1][0] != "string":
            return np.zeros(count if node == 3 else 0, inner[1][0] if inner[1][0] != "octet" else np.uint8)
        return []
    name = detail[0]
    return "" if name == "string" else False if name == "bool" else 0.0 if name.startswith("float") else 0


def header(at_s: float, frame: str = "base_link") -> Any:
    stamp = make("builtin_interfaces/msg/Time", sec=int(at_s), nanosec=round((at_s % 1.0) * 1e9) % 1_000_000_000)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


@dataclass
class Story:
    """A generated recording. ``run`` advances the time."""

    folder: Path
    at_s: float = START_S
    camera: bool = True
    markers: int = 4
    error_m: float = 1.0
    yaw_rad: float = 0.05
    faults: tuple[str, ...] = ()
    emergency: bool = False
    chunk_bytes: int = 50_000
    images: bool = False
    bag: BagWriter = field(init=False)
    _tick: int = 0

    def __post_init__(self) -> None:
        form = Format(split_bytes=10**9, chunk_bytes=self.chunk_bytes, compress=True)
        self.bag = BagWriter(self.folder, [topic_info(row) for row in ROWS], form)
        self.write(topics.VELOCITY_LIMIT, max_linear_velocity=1.5, max_angular_velocity=1.0, reason="")

    def write(self, row: Topic, **values: Any) -> None:
        message = make(row.type, **values)
        at_ns = round(self.at_s * 1e9)
        self.bag.write(row.name, at_ns, at_ns, bytes(STORE.serialize_cdr(message, row.type)))

    def run(self, state: str, duration_s: float, error_m: float | None = None, yaw_rad: float | None = None) -> None:
        """Writes at 10 Hz for ``duration_s``. The errors shrink geometrically to the given values."""
        steps = round(10 * duration_s)
        shrink = (error_m / self.error_m) ** (1 / steps) if error_m else 1.0
        turn = (yaw_rad / self.yaw_rad) ** (1 / steps) if yaw_rad else 1.0
        for _ in range(steps):
            self.error_m *= shrink
            self.yaw_rad *= turn
            self._step(state)
            self.at_s = round(self.at_s + 0.1, 3)

    def _step(self, state: str) -> None:
        self._tick += 1
        seen = self.markers if self.camera else 0
        unknown = state in ("IDLE", "APPROACH") or not seen
        if self.camera:
            info = {"k": np.array([FX, 0, CX, 0, FX, CY, 0, 0, 1.0]), "d": np.zeros(5), "width": 1280, "height": 720}
            self.write(topics.FRONT_CAMERA_INFO, header=header(self.at_s, "front_camera"), **info)
            if self.images and self._tick % 5 == 0:
                self._image()
        self.write(topics.ARUCO_DETECTIONS, detections=[] if unknown else [self._marker(i) for i in range(seen)])
        self.write(
            topics.DOCKING_STATUS,
            header=header(self.at_s),
            state=state,
            position_error=math.nan if unknown else self.error_m,
            orientation_error=math.nan if unknown else self.yaw_rad,
            visible_markers_count=0 if unknown else seen,
        )
        self.write(
            topics.SAFETY_STATUS,
            safety_state="EMERGENCY_STOP" if self.emergency else "NORMAL",
            active_faults=list(self.faults),
            emergency_stop_active=False,  # a latched stop appears only in safety_state
        )
        linear = make("geometry_msgs/msg/Vector3", x=0.12)
        twist = make("geometry_msgs/msg/Twist", linear=linear)
        self.write(topics.DOCKING_CMD_VEL, twist=twist)
        self.write(topics.ODOM, twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist))
        self.write(topics.JOINT_STATES, effort=np.array([1.0, -3.5]))

    def _marker(self, number: int) -> Any:
        """Straight ahead of the camera, upright and facing it: rotated by half a turn about x."""
        pose = make(
            "geometry_msgs/msg/Pose",
            position=make("geometry_msgs/msg/Point", x=0.1 * number, y=0.0, z=1.0),
            orientation=make("geometry_msgs/msg/Quaternion", x=1.0, w=0.0),
        )
        return make(
            "custom_msgs/msg/ArucoDetection",
            header=header(self.at_s - 0.05, "front_camera"),
            marker_id=number,
            pose=pose,
            quality_score=0.9,
            camera_frame="front_camera",
        )

    def _image(self) -> None:
        data = np.full(1280 * 720, 90, np.uint8)
        shape = {"height": 720, "width": 1280, "step": 1280, "encoding": "mono8", "data": data}
        self.write(topics.FRONT_IMAGE, header=header(self.at_s - 0.05, "front_camera"), **shape)

    def close(self) -> Path:
        self.bag.close()
        return self.folder


def success(story: Story) -> None:
    story.run("IDLE", 1.0)
    story.run("APPROACH", 2.0)
    story.run("SEARCH", 1.0)
    story.run("SERVOING", 5.0, 0.1, 0.01)
    story.run("FINE_ALIGN", 4.0, 0.0008, 0.001)
    story.run("DOCKED", 1.0)
    story.write(topics.PASSENGER_ATTACHED, data=True)
    story.run("DOCKED", 8.0)
