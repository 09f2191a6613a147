"""Camera images of a docking: kept small while reading, shown with the detections in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.docks import marker_corners
from robot_stack.docking.tools.trace import Lens, Marker, Shot, Trace

Image = NDArray[np.uint8]
_MOST = 8
_CHANNELS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "rgb8": 3}
_WIDTH = 640
_LABEL_HEIGHT = 26
# A detection belongs to an image if their exposure times differ by less: cameras run at 10 Hz.
_SAME_S = 0.02
_GREEN, _WHITE = (60, 220, 60), (255, 255, 255)


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


def strip(trace: Trace, marker_size_m: float) -> Image | None:
    """All shots of a docking, two in a row, with the detected markers; None without any."""
    tiles = [_tile(shot, trace, marker_size_m) for shot in trace.shots]
    if not tiles:
        return None
    height = max(tile.shape[0] for tile in tiles)
    tiles = [np.pad(tile, ((0, height - tile.shape[0]), (0, 0), (0, 0))) for tile in tiles]
    if len(tiles) % 2:
        tiles.append(np.zeros_like(tiles[0]))
    return np.vstack([np.hstack(tiles[index : index + 2]) for index in range(0, len(tiles), 2)])


def _tile(shot: Shot, trace: Trace, marker_size_m: float) -> Image:
    image = cv2.imdecode(np.frombuffer(shot.jpeg, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("a JPEG that was written here cannot be read")
    found = [m for m in trace.markers if m.camera == shot.camera and abs(m.stamp_s - shot.stamp_s) < _SAME_S]
    lens = trace.lenses.get(shot.camera)
    if lens is not None:
        _draw_markers(image, found, lens, marker_size_m)
    scale = _WIDTH / image.shape[1]
    small = cv2.resize(image, (_WIDTH, round(image.shape[0] * scale)), interpolation=cv2.INTER_AREA)
    before_ms = 1000.0 * (shot.at_s - shot.stamp_s)
    label = f"{shot.at_s - trace.start_s:.1f} s, {shot.why} (image {before_ms:.0f} ms before), {shot.camera}"
    bar = np.zeros((_LABEL_HEIGHT, _WIDTH, 3), np.uint8)
    cv2.putText(bar, label, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _WHITE, 1, cv2.LINE_AA)
    return np.asarray(np.vstack([bar, small]), dtype=np.uint8)


def _draw_markers(image: Any, markers: Sequence[Marker], lens: Lens, size_m: float) -> None:
    for marker in markers:
        corners = corners_px(marker, lens, size_m)
        if corners is None:
            continue
        points = np.round(corners).astype(np.int32)
        cv2.polylines(image, [points.reshape(-1, 1, 2)], True, _GREEN, 3, cv2.LINE_AA)
        text = f"{marker.marker_id} q {marker.quality:.2f}"
        place = (int(points[:, 0].min()), int(points[:, 1].min()) - 8)
        cv2.putText(image, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.8, _GREEN, 2, cv2.LINE_AA)


def corners_px(marker: Marker, lens: Lens, size_m: float) -> NDArray[np.float64] | None:
    """(4, 2) corners in the image in OpenCV's order; None for a pose behind the camera or without a rotation."""
    x, y, z, w = marker.quaternion
    norm = float(np.sqrt(x * x + y * y + z * z + w * w))
    if not norm > 0.0 or not marker.position_m[2] > 0.0:
        return None
    vector = np.array([x, y, z]) / norm
    length = float(np.linalg.norm(vector))
    angle = 2.0 * np.arctan2(length, w / norm)
    rotation = vector / length * angle if length > 0.0 else np.zeros(3)
    k, d = np.array(lens.k).reshape(3, 3), np.array(lens.d)
    projected = cv2.projectPoints(marker_corners(size_m), rotation, np.array(marker.position_m), k, d)[0]
    corners: NDArray[np.float64] = np.asarray(projected, dtype=np.float64).reshape(4, 2)
    return corners if bool(np.isfinite(corners).all()) and bool((np.abs(corners) < 1e5).all()) else None
