"""The process camera_driver: images, calibration, mounting, faults."""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped

from custom_msgs.srv import InjectFault
from robot_stack.contract import services, topics
from robot_stack.core.camera import camera_file, load_intrinsics
from robot_stack.middleware.conversions import time_to_s
from tests.support.peer import Peer, Received
from tests.support.processes import Start
from tests.support.waiting import wait_for
from tf2_msgs.msg import TFMessage

BODIES = {"base_link": (-0.95, 0.0, 0.0), "wheelchair": (0.0, 0.0, 0.0), "charger": (-5.0, 0.0, math.pi)}


def bodies(peer: Peer) -> TFMessage:
    """The robot at the chair's dock pose, with the charger's board behind it."""
    stamp = peer.node.get_clock().now().to_msg()
    message = TFMessage()
    for name, (x, y, yaw) in BODIES.items():
        item = TransformStamped(child_frame_id=name)
        item.header.frame_id, item.header.stamp = "map", stamp
        item.transform.translation.x, item.transform.translation.y = x, y
        item.transform.rotation.z, item.transform.rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        message.transforms.append(item)
    return message


def inject(
    peer: Peer, kind: str, target: str = "", value: float = 0.0, duration_s: float = 0.0
) -> InjectFault.Response:
    request = InjectFault.Request(kind=kind, target=target, value=value, duration_s=duration_s)
    return peer.call(services.INJECT_CAMERA_FAULT, request)


def picture(message: object) -> np.ndarray:
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width)  # type: ignore[attr-defined]


def repeated(messages: list[object]) -> bool:
    """True if a picture equals the one before, which the noise of its own prevents."""
    return any(np.array_equal(picture(one), picture(other)) for one, other in pairwise(messages))


def ids(message: object) -> set[int]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    found = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture(message))[1]
    return set() if found is None else {int(marker) for marker in np.ravel(found)}


@pytest.fixture
def front(start: Start, peer: Peer) -> Received:
    process = start("camera_driver", "-p", "world:=flat")
    received = peer.listen(topics.FRONT_IMAGE)
    peer.repeat(topics.SIM_BODIES, lambda: bodies(peer), 50.0)
    wait_for(lambda: received.items or not process.running(), "a picture", deadline_s=60.0)  # the first run compiles
    assert process.running(), process.output()
    return received


def test_pictures_show_the_boards_with_calibration_and_mounting(front: Received, peer: Peer) -> None:
    rear, info, mountings = (
        peer.listen(row) for row in (topics.REAR_IMAGE, topics.FRONT_CAMERA_INFO, topics.TF_STATIC)
    )
    wait_for(
        lambda: len(front.items) >= 8 and rear.items and info.items and mountings.items, "pictures of both cameras"
    )
    image = front.last
    assert (image.width, image.height, image.step, image.encoding) == (1280, 720, 1280, "mono8")
    assert image.header.frame_id == "front_camera"
    assert rear.last.header.frame_id == "rear_camera"
    assert ids(image) == {0, 1, 2, 3}
    stamps = np.array([time_to_s(message.header.stamp) for message in front.messages])
    assert np.allclose(np.round(stamps * 10.0), stamps * 10.0, atol=1e-4), "exposures are on the clock's tenths"
    calibrated = load_intrinsics(camera_file("front_camera"))
    assert np.allclose(np.reshape(info.last.k, (3, 3)), calibrated.matrix())
    assert np.allclose(info.last.d, calibrated.distortion)
    assert info.last.distortion_model == "plumb_bob"
    transforms = {item.child_frame_id: item for message in mountings.messages for item in message.transforms}
    assert set(transforms) == {"front_camera", "rear_camera"}
    place, turn = transforms["front_camera"].transform.translation, transforms["front_camera"].transform.rotation
    assert (place.x, place.y, place.z) == pytest.approx((0.35, 0.0, 0.45))
    # Optical axes: z forwards, x to the right, y down.
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((-0.5, 0.5, -0.5, 0.5))


def test_faults_change_the_pictures_and_are_answered(front: Received, peer: Peer) -> None:
    assert inject(peer, "cover", "2").success
    front.wait(lambda message: ids(message) == {0, 1, 3}, "marker 2 covered")
    assert inject(peer, "clear", "cover").message == "cleared cover:2"
    front.wait(lambda message: ids(message) == {0, 1, 2, 3}, "all markers again")
    assert inject(peer, "frozen", "front", duration_s=1.0).success
    begun = len(front.items)
    wait_for(lambda: repeated(front.messages[begun:]), "the same picture again")
    assert inject(peer, "dark", value=0.005).success
    front.wait(lambda message: picture(message).mean() < 20.0, "darkness")
    assert inject(peer, "silent", "front", duration_s=0.6).success
    begun = len(front.items)

    def gap_s() -> float:
        return max(np.diff([time_to_s(message.header.stamp) for message in front.messages[begun - 1 :]]), default=0.0)

    wait_for(lambda: gap_s() > 0.45, "pictures again, after the silence")
    refused = inject(peer, "glare", "left")
    assert not refused.success
    assert "target must be one of 'front', 'rear'" in refused.message


def test_camera_driver_reports_awaited_topic(start: Start, peer: Peer) -> None:
    process = start("camera_driver", "-p", "world:=flat")
    process.wait_output("waiting for /sim/bodies", 60.0)
    process.stop()
    assert "Traceback" not in process.output()
