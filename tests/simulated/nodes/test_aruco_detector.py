"""The marker detector with fake cameras and a fake docking controller."""

from __future__ import annotations

import array
import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image

from custom_msgs.msg import ArucoDetection, DockingStatus
from robot_stack.contract import topics
from robot_stack.core.docks import load_docks
from robot_stack.middleware.conversions import time_from_s, time_to_s
from tests.simulated.bench import LATENCY_S, Bench
from tests.unit.docking.vision.images import CAMERA, facing, picture

DOCKS = load_docks()
BOARDS = {"front": facing(1.0, yaw_rad=0.2), "rear": facing(1.4, yaw_rad=-0.1)}
ROWS = {
    "front": (topics.FRONT_IMAGE, topics.FRONT_CAMERA_INFO),
    "rear": (topics.REAR_IMAGE, topics.REAR_CAMERA_INFO),
}
PICTURES = {
    "front": picture(DOCKS.docks["chair_1"], BOARDS["front"]),
    "rear": picture(DOCKS.docks["charger"], BOARDS["rear"]),
}


def info() -> CameraInfo:
    message = CameraInfo(width=CAMERA.width, height=CAMERA.height, distortion_model="plumb_bob")
    message.d = array.array("d", CAMERA.distortion)
    message.k = CAMERA.matrix().ravel()
    return message


def image(camera: str, pixels: NDArray[np.uint8], stamp_s: float, pad: int = 0) -> Image:
    height, width = pixels.shape
    rows = np.pad(pixels, ((0, 0), (0, pad)), constant_values=255)
    message = Image(height=height, width=width, encoding="mono8", step=width + pad)
    message.data = array.array("B", rows.tobytes())
    message.header.frame_id, message.header.stamp = f"{camera}_camera", time_from_s(stamp_s)
    return message


class Cameras:
    """Both cameras, triggered together at 10 Hz, and the node. make: returns a camera's image."""

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench = bench
        self.running = {"front", "rear"}
        self.pad = 0
        self.stamps: list[float] = []
        self.make = self.image
        self.arrived = bench.listen(topics.ARUCO_DETECTIONS)
        bench.start("aruco_detector", parameters)
        bench.wait(lambda: bench.port.count_subscribers(topics.FRONT_IMAGE.name), "the node's subscription")
        for row in (row for rows in ROWS.values() for row in rows):
            bench.publisher(row)
        bench.run(0.2)
        bench.scheduler.every(100_000_000, self._shoot)

    def _shoot(self) -> None:
        stamp_s = round(self.bench.stamp_s(), 6)
        self.stamps.append(stamp_s)
        for camera in sorted(self.running):
            image_row, info_row = ROWS[camera]
            self.bench.publisher(info_row).publish(info())
            self.bench.publisher(image_row).publish(self.make(camera, stamp_s))

    def image(self, camera: str, stamp_s: float) -> Image:
        return image(camera, PICTURES[camera], stamp_s, self.pad)

    def wait_ids(self, expected: list[int]) -> None:
        self.arrived.wait(lambda message: ids(message) == expected, f"markers {expected}", 5.0)

    def settled(self, duration_s: float = 1.5) -> list[Any]:
        """The arrays received during a period, without those in flight at its start."""
        self.bench.run(0.3)
        begun_s = self.bench.now_s
        self.bench.run(duration_s)
        return self.arrived.since(begun_s)


@pytest.fixture
def cameras(bench: Bench) -> Cameras:
    return Cameras(bench, always_on=True)


def ids(message: Any) -> list[int]:
    return [item.marker_id for item in message.detections]


def pose_of(entry: ArucoDetection) -> NDArray[np.float64]:
    """(4, 4) of an entry; the rotation from the quaternion by its definition."""
    p, q = entry.pose.position, entry.pose.orientation
    x, y, z, w = q.x, q.y, q.z, q.w
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = p.x, p.y, p.z
    return pose


FRONT, REAR = [0, 1, 2, 3], [4, 5, 6, 7]


def test_markers_of_both_cameras_in_one_array_at_10_hz(cameras: Cameras) -> None:
    cameras.pad = 24  # pads the rows beyond the image width
    arrays = cameras.settled()
    assert [ids(message) for message in arrays] == [FRONT + REAR] * len(arrays)
    assert cameras.arrived.period_s(10) == pytest.approx(0.1, abs=LATENCY_S)
    stamps = [time_to_s(message.header.stamp) for message in arrays]
    assert len(set(stamps)) == len(stamps) >= 14, "an exposure came twice"
    for entry in arrays[-1].detections:
        camera = "front" if entry.marker_id < 4 else "rear"
        dock = DOCKS.docks["chair_1" if camera == "front" else "charger"]
        expected = BOARDS[camera] @ dock.markers[entry.marker_id].pose()
        np.testing.assert_allclose(pose_of(entry), expected, atol=1e-3)
        assert entry.camera_frame == entry.header.frame_id == f"{camera}_camera"
        assert min(abs(time_to_s(entry.header.stamp) - stamp_s) for stamp_s in cameras.stamps) < 1e-6
        assert entry.quality_score > 0.99


def test_a_dead_camera_costs_neither_rate_nor_the_other_cameras_markers(cameras: Cameras) -> None:
    cameras.settled()
    cameras.running.discard("rear")
    arrays = cameras.settled()
    assert [ids(message) for message in arrays] == [FRONT] * len(arrays)
    assert cameras.arrived.period_s(10) == pytest.approx(0.1, abs=LATENCY_S)
    stamps = [time_to_s(message.header.stamp) for message in arrays]
    assert all(after > before for before, after in itertools.pairwise(stamps))
    cameras.running.clear()
    empty = cameras.settled(3.0)
    assert cameras.arrived.period_s(10) == pytest.approx(0.1, abs=LATENCY_S)
    assert {(len(ids(message)), time_to_s(message.header.stamp)) for message in empty} == {(0, 0.0)}


def test_problem_of_an_image_is_reported(cameras: Cameras) -> None:
    make = cameras.image

    def coloured(camera: str, stamp_s: float) -> Image:
        message = make(camera, stamp_s)
        message.encoding = "rgb8" if camera == "rear" else message.encoding
        return message

    def short(camera: str, stamp_s: float) -> Image:
        message = make(camera, stamp_s)
        if camera == "rear":
            message.data = message.data[:-1]
        return message

    for wrong, text in (
        (coloured, "rear_camera image: encoding is 'rgb8', must be 'mono8'"),
        (short, "rear_camera image: data has 921599 bytes, step x height is 921600"),
    ):
        cameras.make = wrong
        arrays = cameras.settled()
        assert text in cameras.bench.log("aruco_detector")
        assert [ids(message) for message in arrays] == [FRONT] * len(arrays)
    cameras.make = make
    cameras.wait_ids(FRONT + REAR)


def test_a_frozen_image_is_not_taken_for_a_new_one(cameras: Cameras) -> None:
    frozen_s = round(cameras.bench.stamp_s(), 6)
    cameras.make = lambda camera, stamp_s: cameras.image(camera, frozen_s if camera == "front" else stamp_s)
    arrays = cameras.settled()
    assert "front_camera image: stamp is not newer" in cameras.bench.log("aruco_detector")
    assert [ids(message) for message in arrays] == [REAR] * len(arrays)


def test_detects_only_during_docking(bench: Bench) -> None:
    status = DockingStatus(state="IDLE")
    cameras = Cameras(bench)
    bench.repeat(topics.DOCKING_STATUS, lambda: status, 10.0)
    for state in ("APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN"):
        status.state = state
        cameras.wait_ids(FRONT + REAR)
        status.state, docked_s = "DOCKED", bench.now_s
        cameras.wait_ids([])
        assert 4.0 <= bench.now_s - docked_s <= 4.4  # while the latch closes
        assert not any(map(ids, cameras.settled(0.5)))
    status.state = "SERVOING"
    cameras.wait_ids(FRONT + REAR)
    bench.silence(topics.DOCKING_STATUS)
    cameras.wait_ids([])
    assert not any(map(ids, cameras.settled(0.5)))
