"""The aruco_detector node among fake cameras and a fake docking controller."""

from __future__ import annotations

import array
import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image

from custom_msgs.msg import ArucoDetection, DockingStatus
from robot_stack.contract import topics
from robot_stack.core.docks import load_docks
from robot_stack.docking.warm_up import warm_up
from robot_stack.middleware.conversions import time_from_s, time_to_s
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for
from tests.unit.docking.vision.images import CAMERA, background, facing, finish, picture
from tests.unit.docking.vision.images import CLEAN as CLEAN_LOOK

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
EMPTY = finish(background(), CLEAN_LOOK, np.random.default_rng(0))


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


@dataclass
class Cameras:
    """Both cameras, triggered together at 10 Hz."""

    peer: Peer
    running: set[str] = field(default_factory=lambda: {"front", "rear"})
    pixels: dict[str, NDArray[np.uint8]] = field(default_factory=lambda: dict(PICTURES))
    pad: int = 0
    stamps: list[float] = field(default_factory=list)

    def start(self) -> None:
        for row in (row for rows in ROWS.values() for row in rows):
            self.peer.wait_matched(row)
        self.peer.node.create_timer(0.1, self.shoot)

    def shoot(self) -> None:
        stamp_s = round(time.time(), 6)
        self.stamps.append(stamp_s)
        for camera in sorted(self.running):
            image_row, info_row = ROWS[camera]
            self.peer.publish(info_row, info())
            self.peer.publish(image_row, self.make(camera, stamp_s))

    def make(self, camera: str, stamp_s: float) -> Image:
        return image(camera, self.pixels[camera], stamp_s, self.pad)


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """What the node compiles at its first start on a machine takes longer than a test may wait."""
    warm_up()


@pytest.fixture
def node(start: Callable[..., NodeProcess]) -> NodeProcess:
    return start("aruco_detector", "-p", "always_on:=true")


@pytest.fixture
def cameras(node: NodeProcess, peer: Peer) -> Cameras:
    return Cameras(peer)


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


def test_markers_of_both_cameras_in_one_array_at_10_hz(cameras: Cameras, peer: Peer) -> None:
    heard = peer.listen(topics.ARUCO_DETECTIONS)
    cameras.pad = 24  # rows longer than the image is wide
    cameras.start()
    heard.wait(lambda message: ids(message) == [0, 1, 2, 3, 4, 5, 6, 7], "all eight markers")
    first = len(heard.items)
    heard.wait_period(0.1)
    # A machine that is held up may bring an image too late for its array, which is empty then and has no stamp.
    arrays = [message for message in heard.messages[first:] if time_to_s(message.header.stamp)]
    assert len({time_to_s(message.header.stamp) for message in arrays}) >= 12
    seen = [(time_to_s(item.header.stamp), item.marker_id) for message in arrays for item in message.detections]
    assert len(set(seen)) == len(seen), "an exposure came twice"
    message = arrays[-1]
    for entry in message.detections:
        camera = "front" if entry.marker_id < 4 else "rear"
        dock = DOCKS.docks["chair_1" if camera == "front" else "charger"]
        expected = BOARDS[camera] @ dock.markers[entry.marker_id].pose()
        np.testing.assert_allclose(pose_of(entry), expected, atol=1e-3)
        assert entry.camera_frame == entry.header.frame_id == f"{camera}_camera"
        assert min(abs(time_to_s(entry.header.stamp) - stamp_s) for stamp_s in cameras.stamps) < 1e-6
        assert entry.quality_score > 0.99


def test_a_dead_camera_costs_neither_rate_nor_the_other_cameras_markers(cameras: Cameras, peer: Peer) -> None:
    heard = peer.listen(topics.ARUCO_DETECTIONS)
    cameras.start()
    heard.wait(lambda message: len(ids(message)) == 8, "all eight markers")
    cameras.running.discard("rear")
    # An image of the rear camera may still be on its way, and come late.
    wait_for(lambda: [ids(m) for m in heard.messages[-3:]] == 3 * [[0, 1, 2, 3]], "the front camera's markers alone")
    first = len(heard.items)
    heard.wait_period(0.1, count=16)
    # A machine that is held up may bring an image too late for its array, which is empty then and has no stamp.
    arrays = [message for message in heard.messages if time_to_s(message.header.stamp)]
    later = [message for message in heard.messages[first:] if time_to_s(message.header.stamp)]
    assert all(ids(message) == [0, 1, 2, 3] for message in later)
    assert len(later) >= 12
    stamps = [time_to_s(message.header.stamp) for message in arrays]
    assert all(after > before for before, after in itertools.pairwise(stamps))
    cameras.running.clear()
    heard.wait(lambda message: ids(message) == [] and time_to_s(message.header.stamp) == 0.0, "empty arrays")
    first = len(heard.items)
    heard.wait_period(0.1, rel=0.1, count=11)
    assert all(not message.detections for message in heard.messages[first:])


def test_what_is_wrong_with_an_image_is_said(node: NodeProcess, cameras: Cameras, peer: Peer) -> None:
    heard = peer.listen(topics.ARUCO_DETECTIONS)
    make = cameras.make

    def coloured(camera: str, stamp_s: float) -> Image:
        message = make(camera, stamp_s)
        message.encoding = "rgb8" if camera == "rear" else message.encoding
        return message

    def short(camera: str, stamp_s: float) -> Image:
        message = make(camera, stamp_s)
        if camera == "rear":
            message.data = message.data[:-1]
        return message

    def small(camera: str, stamp_s: float) -> Image:
        return image(camera, PICTURES[camera][:360], stamp_s) if camera == "rear" else make(camera, stamp_s)

    cameras.start()
    for wrong, text in (
        (coloured, "rear_camera image: encoding is 'rgb8', must be 'mono8'"),
        (short, "rear_camera image: data has 921599 bytes, step x height is 921600"),
        (small, "rear_camera image: shape is (360, 1280)"),
    ):
        cameras.make = wrong  # type: ignore[method-assign]
        node.wait_output(text)
        heard.wait(lambda message: ids(message) == [0, 1, 2, 3], "the front camera's markers")
    cameras.make = make  # type: ignore[method-assign]
    heard.wait(lambda message: len(ids(message)) == 8, "all markers again")


def test_a_frozen_image_is_not_taken_for_a_new_one(node: NodeProcess, cameras: Cameras, peer: Peer) -> None:
    heard = peer.listen(topics.ARUCO_DETECTIONS)
    make, frozen_s = cameras.make, round(time.time(), 6)

    def frozen(camera: str, stamp_s: float) -> Image:
        return make(camera, frozen_s if camera == "front" else stamp_s)

    cameras.make = frozen  # type: ignore[method-assign]
    cameras.start()
    node.wait_output("front_camera image: stamp is not newer")
    first = len(heard.items)
    wait_for(lambda: len(heard.items) >= first + 11, "11 arrays")
    assert all(ids(message) == [4, 5, 6, 7] for message in heard.messages[first + 1 :])


def test_detects_only_while_docking_is_on_its_way(start: Callable[..., NodeProcess], peer: Peer) -> None:
    start("aruco_detector")
    cameras, status = Cameras(peer), DockingStatus(state="IDLE")
    heard = peer.listen(topics.ARUCO_DETECTIONS)
    peer.repeat(topics.DOCKING_STATUS, lambda: status, 10.0)
    cameras.start()
    heard.wait(lambda message: time_to_s(message.header.stamp) > 0.0, "an array of an image")
    for state in ("APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN"):
        status.state = "DOCKED"
        heard.wait(lambda message: ids(message) == [], "nothing while docked")
        status.state = state
        heard.wait(lambda message: len(ids(message)) == 8, f"markers in {state}")
    peer.silence(topics.DOCKING_STATUS)
    heard.wait(lambda message: ids(message) == [], "nothing once docking is silent")
