"""The recorder as a process: recorded messages equal received ones for other readers."""

from __future__ import annotations

import resource
import signal
import time
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Bool

from custom_msgs.msg import DockingStatus, MissionStatus
from robot_stack.contract import topics
from robot_stack.contract.model import System
from tests.support.peer import Peer
from tests.support.processes import NodeProcess, node_command
from tests.support.waiting import DEADLINE_S, wait_for


class Studio:
    """A recorder and a publisher."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.output = folder / "recordings"
        self.peer = Peer()
        self.heartbeat = self.peer.listen(topics.HEARTBEAT)
        self.diagnostics = self.peer.listen(topics.DIAGNOSTICS)
        self.node: NodeProcess | None = None

    def launch(self, *overrides: str, name: str = "ride") -> NodeProcess:
        # The disk of the test machine may be nearly full.
        chosen = (f"output_folder:={self.output}", f"name:={name}", "max_disk_use:=0.99", *overrides)
        arguments = [part for item in chosen for part in ("-p", item)]
        self.node = NodeProcess(node_command("recorder", *arguments), self.folder / f"{name}.log")
        return self.node

    def wait_ready(self) -> None:
        pid = self.node.pid
        wait_for(
            lambda: not self.node.running() or any(m.ready and m.pid == pid for m in self.heartbeat.messages),
            "recorder ready",
        )
        assert self.node.running(), self.node.output()

    def value(self, key: str) -> str:
        """A value of the recorder's newest diagnostics."""
        for message in self.reported()[-1:]:
            return next((item.value for item in message.status[0].values if item.key == key), "")
        return ""

    def wait_taken(self) -> None:
        """Waits until the recorder has processed all received messages, which it does between two diagnostics."""
        reported = len(self.reported())
        wait_for(lambda: len(self.reported()) >= reported + 2, "the recorder's diagnostics twice")

    def reported(self) -> list[DiagnosticArray]:
        """The recorder's diagnostics so far."""
        return [message for message in self.diagnostics.messages if message.status[0].name == "recorder"]

    def close(self) -> None:
        if self.node is not None:
            self.node.stop()
        self.peer.close()


@pytest.fixture
def studio(ros_domain: int, tmp_path: Path):
    made = Studio(tmp_path)
    yield made
    made.close()


def status(number: int) -> MissionStatus:
    return MissionStatus(state="RUNNING", mission_name="走行", current_waypoint=f"w{number}", eta_s=float(number))


def talk(studio: Studio, count: int, first: int = 0) -> None:
    """Publishes latched custom messages, each after the previous one has arrived, and odometry, which may be lost."""
    studio.peer.wait_matched(topics.MISSION_STATUS)
    studio.peer.wait_matched(topics.ODOM)
    talk_on(studio, count, first)


def talk_on(studio: Studio, count: int, first: int) -> None:
    """The same without waiting for subscribers."""
    missions, odometries = studio.peer.publisher(topics.MISSION_STATUS), studio.peer.publisher(topics.ODOM)
    for number in range(first, first + count):
        missions.publish(status(number))
        assert missions.wait_for_all_acked(Duration(seconds=DEADLINE_S))
        odometry = Odometry()
        odometry.pose.pose.position.x = float(number)
        odometries.publish(odometry)
        time.sleep(0.01)  # the pace of a real node


def recorded(folder: Path) -> tuple[list[str], list[float]]:
    """(waypoints, positions) as rosbags reads them."""
    names: list[str] = []
    positions: list[float] = []
    with AnyReader([folder]) as reader:
        for connection, _, data in reader.messages():
            if connection.topic == "/mission/status":
                names.append(reader.deserialize(data, connection.msgtype).current_waypoint)
            elif connection.topic == "/odom":
                positions.append(reader.deserialize(data, connection.msgtype).pose.pose.position.x)
    return names, positions


def test_recorded_messages_equal_sent_messages(studio):
    node = studio.launch()
    studio.wait_ready()
    before_ns = time.time_ns()
    talk(studio, 50)
    studio.wait_taken()
    node.signal(signal.SIGINT)
    assert node.wait() == 0
    names, positions = recorded(studio.output / "ride")
    assert names == [f"w{number}" for number in range(50)]
    assert positions == sorted(set(positions))
    assert len(positions) > 25
    assert set(positions) <= {float(number) for number in range(50)}

    with open(studio.output / "ride" / "ride_0.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        rows = list(reader.iter_decoded_messages(topics=["/mission/status"]))
        channels = {channel.topic for channel in reader.get_summary().channels.values()}
    assert [decoded.mission_name for *_, decoded in rows] == ["走行"] * 50
    assert all(before_ns <= row[2].publish_time <= row[2].log_time <= time.time_ns() for row in rows)
    left_out = {topics.LIDAR_HALF_SWEEP, *topics.REMOTE_COPIES}
    assert channels == {row.name for row in topics.of_system(System.ROBOT, System.SIMULATION) if row not in left_out}


def test_latched_messages_sent_before_are_recorded_and_excluded_topics_are_not_there(studio):
    studio.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    node = studio.launch("include:=['/emergency_stop', '/passenger*', '/sensors/*']", "exclude:=['/sensors/*']")
    studio.wait_ready()
    wait_for(lambda: int(studio.value("messages") or 0) >= 1, "the latched message")
    node.signal(signal.SIGTERM)
    assert node.wait() == 0
    with Reader(studio.output / "ride") as reader:
        assert set(reader.topics) == {"/emergency_stop", "/passenger_attached"}
        assert reader.topics["/emergency_stop"].msgcount == 1


def test_point_clouds_arrive_whole(studio):
    node = studio.launch("include:=['/sensors/lidar/points']", "sweeps:=always")
    studio.wait_ready()
    studio.peer.wait_matched(topics.LIDAR_POINTS)
    cloud = PointCloud2(height=1, width=150_000, point_step=16, row_step=2_400_000, data=bytes(range(240)) * 10_000)
    # Repeated, because the topic is best effort and a busy machine may lose a message.
    studio.peer.repeat(topics.LIDAR_POINTS, lambda: cloud, 2.0)
    path = studio.output / "ride" / "ride_0.mcap"
    wait_for(lambda: path.read_bytes().count(b"zstd") >= 5, "five clouds on the disk")  # each chunk names it
    studio.peer.silence(topics.LIDAR_POINTS)
    node.signal(signal.SIGINT)
    assert node.wait() == 0
    with AnyReader([studio.output / "ride"]) as reader:
        clouds = [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()]
    assert len(clouds) >= 5
    assert all(bytes(item.data) == bytes(cloud.data) for item in clouds)


class Cameras:
    """A front camera at 10 Hz that numbers its images, and a docking controller."""

    def __init__(self, studio: Studio) -> None:
        self._peer = studio.peer
        self.state = "IDLE"
        self.sent = 0
        self._peer.repeat(topics.FRONT_IMAGE, self._image, 10.0)
        self._peer.repeat(topics.DOCKING_STATUS, lambda: DockingStatus(state=self.state), 10.0)

    def _image(self) -> Image:
        self.sent += 1
        return Image(height=72, width=128, encoding="mono8", step=128, data=bytes([self.sent % 256]) * 9216)

    def listeners(self) -> int:
        return int(self._peer.publisher(topics.FRONT_IMAGE).get_subscription_count())

    def wait_sent(self, count: int) -> None:
        end = self.sent + count
        wait_for(lambda: self.sent >= end, f"{count} more images")


def images_of(folder: Path) -> list[int]:
    """The numbers of the images in a recording."""
    with AnyReader([folder]) as reader:
        rows = [item for item in reader.connections if item.topic == topics.FRONT_IMAGE.name]
        return [
            int(reader.deserialize(data, connection.msgtype).data[0])
            for connection, _, data in reader.messages(connections=rows)
        ]


def test_images_are_recorded_while_the_robot_docks(studio):
    node = studio.launch("image_tail_s:=1.0", "include:=['/sensors/camera/*', '/docking/status']")
    studio.wait_ready()
    cameras = Cameras(studio)
    studio.peer.wait_matched(topics.DOCKING_STATUS, 2)
    cameras.wait_sent(5)
    assert cameras.listeners() == 0, "nobody docks: images are not even received"
    first = cameras.sent
    cameras.state = "SERVOING"
    studio.peer.wait_matched(topics.FRONT_IMAGE)
    cameras.wait_sent(15)
    cameras.state = "DOCKED"
    wait_for(lambda: cameras.listeners() == 0, "the end of the images")
    node.signal(signal.SIGINT)
    assert node.wait() == 0
    images = images_of(studio.output / "ride")
    assert images[0] > first
    assert len(images) > 1
    assert images == sorted(set(images))


def test_a_killed_recorder_is_completed_by_the_next(studio):
    node = studio.launch()
    studio.wait_ready()
    talk(studio, 150)
    node.signal(signal.SIGKILL)
    node.wait()
    studio.launch(name="second")
    studio.wait_ready()
    studio.node.wait_output("ride_0.mcap: completed with")
    names, _ = recorded(studio.output / "ride")
    numbers = [int(name[1:]) for name in names]
    assert numbers == list(range(len(numbers)))
    assert len(names) > 50, "1.5 s were sent, half a second may be lost"


def test_full_disk_is_reported_and_recorder_keeps_running(studio):
    node = studio.launch("compression:=none")
    studio.wait_ready()
    path = studio.output / "ride" / "ride_0.mcap"
    talk(studio, 20)
    studio.wait_taken()
    # The operating system now refuses to extend the recorder's files.
    resource.prlimit(node.pid, resource.RLIMIT_FSIZE, (path.stat().st_size + 1000, resource.RLIM_INFINITY))
    talk_on(studio, 50, 20)  # the recorder may have stopped already
    wait_for(
        lambda: any("recording has stopped" in beat.waiting_for for beat in studio.heartbeat.messages),
        "the end of the recording in the heartbeat",
    )
    assert "ride_0.mcap cannot be written" in node.output()
    assert node.running()
    node.signal(signal.SIGINT)
    assert node.wait() == 0


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (("include:=['/nowhere']",), "include: '/nowhere' fits no topic"),
        (("exclude:=['*']",), "leave no topic to record"),
        (("max_disk_use:=0.000001",), "limit max_disk_use 0%"),
        (("systems:=['robot', 'wmx']",), "different machines"),
        (("output_folder:=/proc/recordings",), "cannot be used"),
        (("name:=../elsewhere",), "name"),
    ],
)
def test_refusals_are_one_line(studio, overrides, says):
    node = studio.launch(*overrides)
    assert node.wait() == 2
    errors = [line for line in node.output().splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    assert says in errors[0]


def test_a_recording_of_the_same_name_is_not_overwritten(studio):
    (studio.output / "ride").mkdir(parents=True)
    node = studio.launch()
    assert node.wait() == 2
    assert "cannot be made: File exists" in node.output()
