"""Conversions between camera messages and the marker detector's values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo

from custom_msgs.msg import ArucoDetection, ArucoDetectionArray
from robot_stack.core.camera import Intrinsics
from robot_stack.docking.vision.detector import MarkerObservation
from robot_stack.docking.vision.pairing import Exposure


class Seen(NamedTuple):
    """The detections of one image."""

    stamp: Time
    detections: list[ArucoDetection]
    taken_ms: float


def intrinsics_of(message: CameraInfo) -> Intrinsics:
    """Raises ValueError naming the field that cannot be used."""
    if message.distortion_model != "plumb_bob" or len(message.d) != 5:
        raise ValueError(
            f"distortion_model is {message.distortion_model!r} with {len(message.d)} coefficients, "
            "must be 'plumb_bob' with 5"
        )
    k, d = message.k, message.d
    if not (np.isfinite(k).all() and np.isfinite(d).all() and k[0] > 0.0 and k[4] > 0.0):
        raise ValueError(f"k or d cannot be used: {list(k)}, {list(d)}")
    return Intrinsics(message.width, message.height, k[0], k[4], k[2], k[5], (d[0], d[1], d[2], d[3], d[4]))


def detections(observations: Iterable[MarkerObservation], camera_frame: str, stamp: Time) -> list[ArucoDetection]:
    """One message for each marker, stamped with the exposure."""
    return [_detection(item, camera_frame, stamp) for item in observations]


def detection_array(exposures: Sequence[Exposure[Seen]]) -> ArucoDetectionArray:
    """All markers by their ids, with the newest exposure's stamp; empty and of stamp zero without exposures."""
    message = ArucoDetectionArray()
    message.detections = sorted((item for seen in exposures for item in seen.item.detections), key=_marker_id)
    if exposures:
        message.header.stamp = max(exposures, key=lambda item: item.stamp_s).item.stamp
    return message


def _marker_id(entry: ArucoDetection) -> int:
    return int(entry.marker_id)


def _detection(observation: MarkerObservation, camera_frame: str, stamp: Time) -> ArucoDetection:
    message = ArucoDetection(marker_id=observation.marker_id, camera_frame=camera_frame)
    message.header.stamp, message.header.frame_id = stamp, camera_frame
    message.quality_score = float(observation.quality)
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = (float(value) for value in observation.pose[:3, 3])
    orientation.x, orientation.y, orientation.z, orientation.w = _quaternion(observation.pose[:3, :3])
    return message


def _quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a (3, 3) rotation: from the row of the largest component, w >= 0 (Shepperd's method)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    squares = np.array([1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i, 1.0 + a + e + i])
    products = np.array(
        [
            [squares[0], b + d, c + g, h - f],
            [b + d, squares[1], f + h, c - g],
            [c + g, f + h, squares[2], d - b],
            [h - f, c - g, d - b, squares[3]],
        ]
    )
    row = products[int(np.argmax(squares))]
    x, y, z, w = (row / np.linalg.norm(row) * (1.0 if row[3] >= 0.0 else -1.0)).tolist()
    return x, y, z, w
