"""The remote view between a peer's sensors and a peer that is its viewer."""

from __future__ import annotations

from array import array

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage, Image, PointCloud2

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.point_cloud import SWEEP, XYZ
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.point_cloud import cloud_message, points_of
from tests.simulated.bench import Bench

NODE = "remote_view"
SENSORS_HZ = 10.0
IMAGES = {topics.FRONT_IMAGE: topics.REMOTE_FRONT_IMAGE, topics.REAR_IMAGE: topics.REMOTE_REAR_IMAGE}
COPIES = {topics.LIDAR_POINTS: topics.REMOTE_POINTS, **IMAGES}


class Scene:
    """Sensors at 10 Hz and the node. spoil_*: change a message before it is published."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.spoil_cloud = self.spoil_image = lambda message: None
        self.sweep = np.zeros(2000, SWEEP)
        self.sweep["x"], self.sweep["y"] = np.linspace(1.0, 30.0, 2000), 2.0
        for row in IMAGES:
            bench.repeat(row, lambda row=row: self._image(row), SENSORS_HZ)
        bench.repeat(topics.LIDAR_POINTS, self._cloud, SENSORS_HZ)
        self.process = bench.start(NODE)

    def _cloud(self) -> PointCloud2:
        message = cloud_message(self.sweep, "lidar")
        message.header.stamp = self.bench.stamp()
        self.spoil_cloud(message)
        return message

    def _image(self, row: Topic) -> Image:
        message = Image(height=72, width=1280, step=1280, encoding="mono8")
        message.header.frame_id, message.header.stamp = row.name, self.bench.stamp()
        shade = np.linspace(0.0, 255.0, 1280).astype(np.uint8)
        message.data = array("B", np.tile(shade if row is topics.FRONT_IMAGE else shade[::-1], (72, 1)).tobytes())
        self.spoil_image(message)
        return message

    def received(self) -> set[Topic]:
        """The inputs that the node is subscribed to."""
        network = self.bench.scheduler.network
        return {row for row in COPIES if NODE in {item.port.name for item in network.subscriptions(row.name)}}

    def health(self) -> str:
        diagnoses = self.bench.listen(topics.DIAGNOSTICS)
        self.bench.run(1.5)
        return [one.message for message in diagnoses.messages for one in message.status if one.name == NODE][-1]


@pytest.fixture
def scene(bench: Bench) -> Scene:
    return Scene(bench)


def test_nothing_is_received_without_a_viewer(scene: Scene) -> None:
    scene.bench.run(2.0)
    assert scene.received() == set()
    assert "no viewer" in scene.bench.log(NODE)


@pytest.mark.parametrize("source", COPIES, ids=lambda row: row.name)
def test_a_viewer_of_one_topic_causes_one_subscription_that_ends_with_it(scene: Scene, source: Topic) -> None:
    viewer = scene.bench.peer("viewer")
    received = viewer.listen(COPIES[source])
    scene.bench.run(2.0)
    assert scene.received() == {source}
    assert received.items
    viewer.process.stop()
    scene.bench.run(2.0)
    assert scene.received() == set()


def test_rates_are_those_of_the_contract_and_messages_are_new(scene: Scene) -> None:
    received = {row: scene.bench.listen(row) for row in COPIES.values()}
    scene.bench.run(1.0)
    begun_s = scene.bench.now_s
    scene.bench.run(10.0)
    for row, item in received.items():
        messages = item.since(begun_s)
        assert len(messages) == pytest.approx(10.0 * row.nominal_rate_hz, abs=1), row.name
        stamps_s = [time_to_s(message.header.stamp) for message in messages]
        assert stamps_s == sorted(set(stamps_s)), row.name


def test_a_sensor_that_falls_silent_is_not_repeated(scene: Scene) -> None:
    received = scene.bench.listen(topics.REMOTE_POINTS)
    scene.bench.run(2.0)
    scene.bench.silence(topics.LIDAR_POINTS)
    scene.bench.run(0.5)
    begun_s = scene.bench.now_s
    assert "waiting for /sensors/lidar/points" in scene.health()
    assert received.since(begun_s) == []


def test_the_cloud_is_thinned_in_the_frame_and_at_the_stamp_of_the_sweep(scene: Scene) -> None:
    cloud: PointCloud2 = scene.bench.listen(topics.REMOTE_POINTS).wait()
    points = points_of(cloud, XYZ)
    assert cloud.header.frame_id == "lidar"
    assert 0.0 < scene.bench.stamp_s() - time_to_s(cloud.header.stamp) < 0.2
    assert 90 < len(points) < 100, "voxels of 0.3 m along 29 m"
    assert set(points["x"]) < set(scene.sweep["x"])


@pytest.mark.parametrize(("source", "darker"), [(topics.FRONT_IMAGE, 0), (topics.REAR_IMAGE, -1)])
def test_the_image_is_a_smaller_jpeg_of_its_camera(scene: Scene, source: Topic, darker: int) -> None:
    message: CompressedImage = scene.bench.listen(IMAGES[source]).wait()
    assert message.format.startswith("mono8; jpeg compressed")
    assert message.header.frame_id == source.name
    picture = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (36, 640)
    assert picture[:, darker].max() < 20
    assert picture[:, -1 - darker].min() > 235


def test_a_sweep_that_cannot_be_read_is_reported_and_the_next_is_published(scene: Scene) -> None:
    received = scene.bench.listen(topics.REMOTE_POINTS)
    received.wait()

    def spoil(message: PointCloud2) -> None:
        message.data = message.data[:-1]

    scene.spoil_cloud = spoil
    scene.bench.run(0.5)
    begun_s = scene.bench.now_s
    assert "/sensors/lidar/points" in scene.health()
    assert received.since(begun_s) == []
    scene.spoil_cloud = lambda message: None
    scene.bench.run(1.0)
    assert received.since(begun_s)
    assert "publishing /remote/points" in scene.health()


def test_an_image_that_cannot_be_read_is_reported_and_the_cloud_goes_on(scene: Scene) -> None:
    images, clouds = (scene.bench.listen(row) for row in (topics.REMOTE_FRONT_IMAGE, topics.REMOTE_POINTS))
    images.wait()

    def spoil(message: Image) -> None:
        message.encoding = "rgb8"

    scene.spoil_image = spoil
    scene.bench.run(0.5)
    begun_s = scene.bench.now_s
    assert "/sensors/camera/front/image_raw: image: encoding is 'rgb8', must be 'mono8'" in scene.health()
    assert images.since(begun_s) == []
    assert len(clouds.since(begun_s)) >= 8
