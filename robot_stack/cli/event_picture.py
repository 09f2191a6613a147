"""The picture of a kept event: the costmap around the robot, and camera images if they are recorded."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from robot_stack.contract import topics
from robot_stack.core.geometry import Pose2, planar_pose
from robot_stack.core.kept_events import EventRecord
from robot_stack.core.robot import load_robot
from robot_stack.docking.tools.shots import jpeg_of
from robot_stack.recording.recovery import recorded_files

# The newest message of this time before the first trigger counts; what happens within a moment after it, as well.
_BEFORE_S, _AFTER_S = 3.0, 0.2
_IMAGES = (topics.FRONT_IMAGE.name, topics.REAR_IMAGE.name)
_COSTMAP, _ODOM, _MISSION = topics.LOCAL_COSTMAP.name, topics.ODOM.name, topics.MISSION_STATUS.name
_TOPICS = (*_IMAGES, _COSTMAP, _ODOM, _MISSION)
_DPI, _PANEL_IN = 90, 4.5


def event_picture(folder: Path, event: EventRecord) -> bytes | None:
    """A PNG of the moment of the first trigger; None if the event's files show none."""
    seen = _newest(folder, event.triggers[0].ros_s)
    images = [(name.split("/")[-2], jpeg) for name in _IMAGES if name in seen and (jpeg := jpeg_of(seen[name]))]
    panels = len(images) + (_COSTMAP in seen)
    if not panels:
        return None
    figure = Figure(figsize=(_PANEL_IN * panels, _PANEL_IN), layout="constrained")
    axes = list(figure.subplots(1, panels, squeeze=False)[0])
    if _COSTMAP in seen:
        _draw_costmap(axes.pop(0), seen)
    for axis, (name, jpeg) in zip(axes, images, strict=True):
        axis.imshow(imread(BytesIO(jpeg), format="jpg"), cmap="gray")
        axis.set(title=f"{name} camera", xticks=(), yticks=())
    written = BytesIO()
    figure.savefig(written, format="png", dpi=_DPI)
    return written.getvalue()


def _newest(folder: Path, ros_s: float) -> dict[str, Any]:
    """The newest message of each topic by then. A file that was cut off has no index and is left out."""
    begin_ns, end_ns = round(1e9 * (ros_s - _BEFORE_S)), round(1e9 * (ros_s + _AFTER_S))
    found: dict[str, Any] = {}
    for name in recorded_files(folder):
        try:
            with open(folder / name, "rb") as file:
                reader = make_reader(file, decoder_factories=[DecoderFactory()])
                for _, channel, _, message in reader.iter_decoded_messages(
                    _TOPICS, starting_at=begin_ns, ending_at=end_ns
                ):
                    found[channel.topic] = message
        except (OSError, McapError):
            continue
    return found


def _draw_costmap(axes: Any, seen: dict[str, Any]) -> None:
    """In odom, with the robot's outline; dark is occupied."""
    grid = seen[_COSTMAP]
    cells = np.array(grid.data, np.int8).reshape(grid.info.height, grid.info.width)
    x, y, size_m = grid.info.origin.position.x, grid.info.origin.position.y, grid.info.resolution
    extent = (x, x + grid.info.width * size_m, y, y + grid.info.height * size_m)
    shade = np.where(cells < 0, 40, cells)  # unknown
    axes.imshow(shade, origin="lower", extent=extent, cmap="Greys", vmin=0.0, vmax=100.0, interpolation="nearest")
    axes.set(title="costmap", xlabel="x in odom / m", ylabel="y in odom / m", aspect="equal")
    if _ODOM not in seen:
        return
    robot, at = load_robot(), seen[_ODOM].pose.pose
    carries = _MISSION in seen and seen[_MISSION].passenger_attached
    outline = _outline(
        planar_pose(at.position, at.orientation), robot.footprint_with_chair if carries else robot.footprint
    )
    axes.plot(outline[:, 0], outline[:, 1], color="#1f5fbf", linewidth=1.8)


def _outline(pose: Pose2, footprint: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(5, 2) closed, m."""
    corners = footprint.corners()
    points = [pose.compose(Pose2(x, y, 0.0)) for x, y in (*corners, corners[0])]
    return np.array([(point.x, point.y) for point in points])
