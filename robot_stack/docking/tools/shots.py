"""Camera images of a docking: kept small while reading, shown with the detections in them."""

from __future__ import annotations

import math
from itertools import zip_longest
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.core.docks import marker_corners
from robot_stack.docking.tools.trace import Lens, Marker, Shot, Trace

_MOST = 8
_CHANNELS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "rgb8": 3}
# A detection belongs to an image if their exposure times differ by less: cameras run at 10 Hz.
_SAME_S = 0.02
_GREEN = "#3cdc3c"


class ShotAlbum:
    """At most eight shots per camera: the first, the last, and those in between that stand farthest apart in time."""

    def __init__(self) -> None:
        self._shots: dict[str, list[Shot]] = {}

    def add(self, shot: Shot) -> None:
        shots = self._shots.setdefault(shot.camera, [])
        shots.append(shot)
        if len(shots) > _MOST:
            gaps = [shots[index + 1].at_s - shots[index - 1].at_s for index in range(1, len(shots) - 1)]
            del shots[1 + gaps.index(min(gaps))]

    def take(self, camera: str) -> list[Shot]:
        """The shots of a camera, or of the one with most where that has none; the album is empty afterwards."""
        shots = self._shots.get(camera) or max(self._shots.values(), key=len, default=[])
        self._shots = {}
        return shots


def jpeg_of(message: Any) -> bytes | None:
    """A sensor_msgs/Image as JPEG; None for another encoding or missing data."""
    channels = _CHANNELS.get(str(message.encoding), 0)
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.frombuffer(bytes(message.data), np.uint8)
    if not channels or not height or not width or step < width * channels or data.size < step * height:
        return None
    pixels = data[: step * height].reshape(height, step)[:, : width * channels].reshape(height, width, channels)
    if message.encoding == "rgb8":
        pixels = pixels[:, :, ::-1]
    return bytes(cv2.imencode(".jpg", np.ascontiguousarray(pixels), [cv2.IMWRITE_JPEG_QUALITY, 90])[1])


def strip(trace: Trace, marker_size_m: float) -> Figure | None:
    """All shots of a docking, two in a row, with the detected markers; None without any."""
    if not trace.shots:
        return None
    rows = math.ceil(len(trace.shots) / 2)
    figure = Figure(figsize=(12.8, 3.9 * rows), layout="constrained")
    for axes, shot in zip_longest(figure.subplots(rows, 2, squeeze=False).flat, trace.shots):
        axes.axis("off")
        if shot is not None:
            _show(axes, shot, trace, marker_size_m)
    return figure


def _show(axes: Any, shot: Shot, trace: Trace, marker_size_m: float) -> None:
    axes.imshow(cv2.imdecode(np.frombuffer(shot.jpeg, np.uint8), cv2.IMREAD_COLOR_RGB))
    before_ms = 1000.0 * (shot.at_s - shot.stamp_s)
    label = f"{shot.at_s - trace.start_s:.1f} s, {shot.why} (image {before_ms:.0f} ms before), {shot.camera}"
    axes.set_title(label, fontsize=9, loc="left")
    lens = trace.lenses.get(shot.camera)
    for marker in trace.markers:
        if lens is None or marker.camera != shot.camera or abs(marker.stamp_s - shot.stamp_s) >= _SAME_S:
            continue
        corners = corners_px(marker, lens, marker_size_m)
        if corners is not None:
            axes.add_patch(Polygon(corners, fill=False, color=_GREEN, linewidth=1.5))
            text = f"{marker.marker_id} q {marker.quality:.2f}"
            axes.annotate(text, corners.min(axis=0), color=_GREEN, clip_on=True, va="bottom")


def corners_px(marker: Marker, lens: Lens, size_m: float) -> NDArray[np.float64] | None:
    """(4, 2) corners in the image in OpenCV's order; None for a pose behind the camera or without a rotation."""
    if not np.linalg.norm(marker.quaternion) > 0.0 or not marker.position_m[2] > 0.0:
        return None
    rotation = Rotation.from_quat(marker.quaternion).as_rotvec()
    k, d = np.array(lens.k).reshape(3, 3), np.array(lens.d)
    projected = cv2.projectPoints(marker_corners(size_m), rotation, np.array(marker.position_m), k, d)[0]
    corners: NDArray[np.float64] = np.asarray(projected, dtype=np.float64).reshape(4, 2)
    return corners if bool(np.isfinite(corners).all()) and bool((np.abs(corners) < 1e5).all()) else None
