"""``robot-stack map teach`` with a recorded ride that is published again over DDS."""

from __future__ import annotations

import re
import shlex
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2

from robot_stack.contract import topics
from robot_stack.core.config import config_dir
from robot_stack.core.site_map import load_map
from tests.support.command_line import cli
from tests.support.peer import Peer
from tests.support.processes import Start
from tests.support.waiting import wait_for
from tests.unit.cli.test_map import write_ride
from tests.unit.mapping import site

COMMAND = [sys.executable, "-m", "robot_stack.cli", "map"]
ROWS = {row.name: row for row in (topics.LIDAR_POINTS, topics.ODOM, topics.IMU)}
_FASTER = 4.0


@pytest.fixture
def own_config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The configuration with a map builder for few points, and limits for a slow machine with a nearly full disk."""
    folder = tmp_path / "config"
    shutil.copytree(config_dir(), folder, ignore=shutil.ignore_patterns("maps"))
    change(folder / "mapping.yaml", site.params().model_dump(mode="json"))
    change(folder / "mapping.yaml", {"teach": {**read(folder / "mapping.yaml")["teach"], "points_within_s": 90.0}})
    change(folder / "recorder.yaml", {"max_disk_use": 0.99})
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(folder))
    return folder


def read(file: Path) -> dict:
    return yaml.safe_load(file.read_text(encoding="utf-8"))


def change(file: Path, values: dict) -> None:
    file.write_text(yaml.safe_dump({**read(file), **values}), encoding="utf-8")


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, float, bytes]]:
    """(topic, time in s, bytes) of a ride of 31 s through a room."""
    folder = tmp_path_factory.mktemp("rides") / "ride"
    write_ride(folder)
    with open(folder / "ride_0.mcap", "rb") as file:
        found = make_reader(file).iter_messages(topics=list(ROWS), log_time_order=False)
        return [(channel.topic, 1e-9 * message.log_time, message.data) for _, channel, message in found]


class Teaching:
    """The command, and the topics of a driven robot."""

    def __init__(self, start: Start, peer: Peer, folder: Path) -> None:
        self.maps, self.recording, self.picture = folder / "maps", folder / "taught", folder / "growing.png"
        self.peer = peer
        self.node = start(
            "teach",
            command=[
                *COMMAND, "teach", "--name", "room", "--output", str(self.maps), "--recording", str(self.recording),
                "--picture", str(self.picture), "--origin", *map(str, (site.START.x, site.START.y, site.START.yaw)),
            ],
        )  # fmt: skip

    def drive(self, ride: list[tuple[str, float, bytes]]) -> None:
        """Publishes the ride from its first sweep on, after the command has begun to record."""
        publishers = {name: self.peer.publisher(row) for name, row in ROWS.items()}
        for row in ROWS.values():
            self.peer.wait_matched(row)
        first = {name: next(data for topic, _, data in ride if topic == name) for name in ROWS}

        def begun() -> bool:
            publishers[topics.LIDAR_POINTS.name].publish(first[topics.LIDAR_POINTS.name])
            publishers[topics.ODOM.name].publish(first[topics.ODOM.name])
            return "Ctrl-C ends the ride" in self.node.output() or not self.node.running()

        wait_for(begun, "the command records", poll_s=0.1)
        begun_s, from_s = time.monotonic(), ride[0][1]
        for topic, at_s, data in ride:
            time.sleep(max(0.0, begun_s + (at_s - from_s) / _FASTER - time.monotonic()))  # at the pace of the ride
            publishers[topic].publish(data)

    def sweeps(self) -> int:
        """The number of sweeps in the newest line."""
        return int((re.findall(r"(\d+) sweeps, ", self.node.output()) or ["0"])[-1])


@pytest.fixture
def teaching(own_config: Path, start: Start, peer: Peer, tmp_path: Path) -> Teaching:
    return Teaching(start, peer, tmp_path)


def test_taught_map_equals_map_built_from_recording(teaching, messages, tmp_path):
    teaching.drive(messages[: len(messages) // 2])
    wait_for(lambda: teaching.sweeps() >= site.params().sweeps.fewest, "the map grows")
    node = teaching.node
    node.signal(signal.SIGINT)
    assert node.wait(120.0) == 0, node.output()
    said = node.output()
    assert re.search(r"^[\d.]+ m, \d+ sweeps, \d+ x \d+ m seen, .* LiDAR and wheels [\d.]+ m", said, re.MULTILINE)
    assert "the ride ends: " in said
    assert "error at the end of the ride: " in said
    assert teaching.picture.read_bytes().startswith(b"\x89PNG")

    taught = load_map(str(teaching.maps / "room"))
    # The recording contains exactly the sweeps that count.
    shown = re.search(r"^the ride ends: [\d.]+ m, (\d+) sweeps", said, re.MULTILINE)
    assert taught.about["ride"]["sweeps"] == int(shown[1]) == teaching.sweeps()
    origin = map(str, (site.START.x, site.START.y, site.START.yaw))
    again = cli(
        "map", "build", str(teaching.recording), "--name", "room", "--output", str(tmp_path), "--origin", *origin
    )
    assert again.returncode == 0, again.stderr
    assert load_map(str(tmp_path / "room")).about == taught.about


def test_terminated_teaching_prints_map_build_command(teaching, messages):
    """For example if the computer shuts down, or the operator postpones the building."""
    teaching.drive(messages[: len(messages) // 2])
    wait_for(lambda: teaching.sweeps() >= site.params().sweeps.fewest, "the map grows")
    teaching.node.signal(signal.SIGTERM)
    assert teaching.node.wait() == 130
    assert not teaching.maps.exists()
    said = teaching.node.output().splitlines()[-1]
    built = cli("map", *shlex.split(said.partition("robot-stack map ")[2]))
    assert built.returncode == 0, built.stderr
    assert load_map(str(teaching.maps / "room")).about["begins_at"]["x_m"] == site.START.x


# --- errors are reported before the ride ------------------------------------------------------------------------------


def refusal(*arguments: str) -> str:
    done = cli("map", "teach", *arguments)
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1, done.stderr
    assert "recording: " not in done.stdout
    return done.stderr


def test_invalid_map_teach_arguments_are_reported(ros_domain, own_config, tmp_path):
    (tmp_path / "taken").mkdir()
    assert "exists already" in refusal("--name", "taken", "--output", str(tmp_path))
    assert "letters, digits" in refusal("--name", "../up", "--output", str(tmp_path))
    assert "a recording needs a new folder" in refusal("--name", "a", "--recording", str(tmp_path / "taken"))


def test_no_stack(ros_domain, own_config, tmp_path):
    shown = refusal("--name", "room", "--output", str(tmp_path))
    assert f"no stack is running in ROS domain {ros_domain}" in shown
    assert not (tmp_path / "room").exists()


def test_a_full_disk(ros_domain, own_config, tmp_path):
    change(own_config / "recorder.yaml", {"max_disk_use": 0.001})
    shown = refusal("--name", "room", "--output", str(tmp_path), "--recording", str(tmp_path / "ride"))
    assert "full, limit max_disk_use" in shown


def test_no_points(own_config, peer, tmp_path):
    change(
        own_config / "mapping.yaml", {"teach": {**read(own_config / "mapping.yaml")["teach"], "points_within_s": 2.0}}
    )
    peer.repeat(topics.ODOM, Odometry, 20.0)
    shown = refusal("--name", "room", "--output", str(tmp_path), "--recording", str(tmp_path / "ride"))
    assert "no message on /sensors/lidar/points" in shown
    assert not (tmp_path / "ride").exists()


def test_a_cloud_without_times(own_config, peer, start, tmp_path):
    peer.repeat(topics.ODOM, Odometry, 20.0)
    peer.repeat(topics.LIDAR_POINTS, lambda: PointCloud2(width=1, height=1, point_step=4, data=[0] * 4), 10.0)
    node = start(
        command=[*COMMAND, "teach", "--name", "room", "--output", str(tmp_path), "--recording", str(tmp_path / "ride")]
    )
    assert node.wait() == 1
    assert "error: /sensors/lidar/points: field x is missing" in node.output()
