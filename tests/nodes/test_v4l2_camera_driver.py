"""The driver of V4L2 cameras at the kernel's interface: images, exposure times, corrupt frames, a pulled cable."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.contract import topics
from robot_stack.middleware.conversions import time_to_s
from sim.devices.v4l2 import build_library
from tests.support.peer import Peer, Received, says
from tests.support.processes import NodeProcess, node_command
from tests.support.waiting import wait_for

NAME = "v4l2_camera_driver"
HEIGHT, WIDTH = 720, 1280


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library that replaces the kernel's interface."""
    return build_library(tmp_path_factory.mktemp("v4l2"))


class Cameras:
    """Two device files, and the driver that reads them."""

    def __init__(self, folder: Path, kernel: Path, peer: Peer) -> None:
        self._folder, self._kernel = folder / "dev", kernel
        self._folder.mkdir()
        self.front, self.rear = self._folder / "front", self._folder / "rear"
        self.images = peer.listen(topics.FRONT_IMAGE), peer.listen(topics.REAR_IMAGE)
        self.infos = peer.listen(topics.FRONT_CAMERA_INFO)
        self.diagnostics = peer.listen(topics.DIAGNOSTICS)
        self.node: NodeProcess | None = None

    def start(self, monkeypatch: pytest.MonkeyPatch, *parameters: str) -> NodeProcess:
        monkeypatch.setenv("V4L2_CAMERAS", str(self._folder))
        given = (f"devices.front:={self.front}", f"devices.rear:={self.rear}", "reopen_s:=0.2", *parameters)
        command = node_command(NAME, *(part for item in given for part in ("-p", item)))
        self.node = NodeProcess(command, self._folder.parent / "driver.log", self._kernel)
        return self.node

    def show(self, device: Path, data: bytes) -> None:
        """Sets the frame that the camera sends from now on, in one step."""
        beside = self._folder.parent / "next"
        beside.write_bytes(data)
        beside.rename(device)


@pytest.fixture
def cameras(ros_domain: int, tmp_path: Path, kernel: Path, peer: Peer) -> Iterator[Cameras]:
    made = Cameras(tmp_path, kernel, peer)
    yield made
    if made.node is not None:
        made.node.stop()


def scene(seed: int) -> NDArray[np.uint8]:
    small = np.random.default_rng(seed).integers(0, 255, (9, 16), np.uint8)
    return np.asarray(cv2.resize(small, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC), np.uint8)


def jpeg(picture: NDArray[np.uint8]) -> bytes:
    return bytes(cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))[1].tobytes())


def wait_picture(received: Received, picture: NDArray[np.uint8]) -> None:
    def close() -> bool:
        pixels = np.frombuffer(bytes(received.last.data), np.uint8).reshape(HEIGHT, WIDTH)
        return bool(np.abs(pixels.astype(int) - picture).mean() < 3.0)

    wait_for(lambda: received.items and close(), "what the camera shows")


def test_both_cameras_that_keep_their_own_exposure_and_what_goes_wrong(
    cameras: Cameras, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("V4L2_OWN_EXPOSURE", "1")
    pictures = scene(1), scene(2)
    for device, picture in zip((cameras.front, cameras.rear), pictures, strict=True):
        cameras.show(device, jpeg(picture))
    cameras.start(monkeypatch)
    for received, picture in zip(cameras.images, pictures, strict=True):
        wait_picture(received, picture)
    image, info = cameras.images[0].last, cameras.infos.wait(lambda _: True, "a calibration")
    assert (image.encoding, image.width, image.height, image.step) == ("mono8", WIDTH, HEIGHT, WIDTH)
    assert image.header.frame_id == info.header.frame_id == "front_camera"
    assert (info.width, info.height, info.k[0]) == (WIDTH, HEIGHT, 900.0)
    values = says(cameras.diagnostics, NAME, "images arrive")
    assert values["front exposure"] == values["rear exposure"] == "the camera's own, instead of 4 ms"
    assert values["front device"] == f"{cameras.front} is open"

    cameras.show(cameras.front, jpeg(pictures[0])[:5000])
    values = says(cameras.diagnostics, NAME, "no images of the front camera: a frame is cut off")
    assert int(values["front corrupt frames"]) > 0
    count = len(cameras.images[1].items)
    wait_for(lambda: len(cameras.images[1].items) > count + 5, "the rear camera, which goes on")
    cameras.show(cameras.front, jpeg(pictures[1]))
    wait_picture(cameras.images[0], pictures[1])

    cameras.front.unlink()
    says(cameras.diagnostics, NAME, f"no images of the front camera: {cameras.front} is not there")
    cameras.show(cameras.front, jpeg(pictures[0]))
    wait_picture(cameras.images[0], pictures[0])
    says(cameras.diagnostics, NAME, "images arrive")


def test_an_image_is_stamped_with_the_middle_of_its_exposure(cameras: Cameras, monkeypatch: pytest.MonkeyPatch) -> None:
    """The frames contain the start of their exposure on the monotonic clock."""
    cameras.show(cameras.front, scene(3).tobytes())
    cameras.start(monkeypatch, "pixel_format:=GREY", "devices.rear:=''", "exposure_s:=0.01", "readout_s:=0.02")
    wait_for(lambda: len(cameras.images[0].items) >= 20, "images")
    apart_s = max(time.time() - time.monotonic() for _ in range(10))  # the process may be paused between the two
    begun_s, stamped_s = [], []
    for message in cameras.images[0].messages:
        begun_s.append(1e-6 * struct.unpack("<q", bytes(message.data[:8]))[0])
        stamped_s.append(time_to_s(message.header.stamp) - apart_s)
    late_s = np.array(stamped_s) - np.array(begun_s) - 0.015
    assert np.abs(np.median(late_s)) < 0.001
    assert says(cameras.diagnostics, NAME, "images arrive")["front exposure"] == "10 ms"


def test_a_camera_of_another_frame_rate_is_named(cameras: Cameras, monkeypatch: pytest.MonkeyPatch) -> None:
    cameras.show(cameras.front, jpeg(scene(4)))
    cameras.start(monkeypatch, "devices.rear:=''", "frame_rate_hz:=60.0")
    says(cameras.diagnostics, NAME, "sends 30 frames a second instead of 60")
