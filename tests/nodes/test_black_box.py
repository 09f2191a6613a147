"""The black box as a process that is killed, and its images. What an event keeps: tests/simulated/test_black_box.py."""

from __future__ import annotations

import os
import shutil
import signal
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import Image

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import topics
from robot_stack.core.kept_events import EventRecord, EventState, black_box_dir, events_dir, read_events
from robot_stack.recording.recovery import recover_folder
from tests.support.peer import Peer
from tests.support.processes import NodeProcess, node_command
from tests.support.waiting import wait_for

_SHORT = ("max_disk_use:=0.99", "before_s:=5.0", "segment_s:=1.0", "after_s:=1.0", "map:=''")


class Scene:
    """A safety monitor that publishes its status, and a black box."""

    def __init__(self, folder: Path, peer: Peer) -> None:
        self.folder, self.peer = folder, peer
        self.faults: list[str] = []
        self.sent = 0
        self.heartbeat = peer.listen(topics.HEARTBEAT)
        peer.repeat(topics.SAFETY_STATUS, self._status, 10.0)
        self.node: NodeProcess | None = None

    def _status(self) -> SafetyStatus:
        self.sent += 1
        # Numbers the messages.
        return SafetyStatus(safety_state="NORMAL", active_faults=self.faults, min_obstacle_distance=float(self.sent))

    def launch(self, *overrides: str) -> NodeProcess:
        arguments = [part for item in (*_SHORT, *overrides) for part in ("-p", item)]
        self.node = NodeProcess(node_command("black_box", *arguments), self.folder / f"{os.getpid()}-{self.sent}.log")
        pid = self.node.pid
        wait_for(
            lambda: not self.node.running() or any(m.ready and m.pid == pid for m in self.heartbeat.messages), "ready"
        )
        assert self.node.running(), self.node.output()
        wait_for(lambda: self.peer.publisher(topics.SAFETY_STATUS).get_subscription_count() >= 2, "subscribed")
        return self.node

    def wait_sent(self, count: int) -> None:
        end = self.sent + count
        wait_for(lambda: self.sent >= end, f"{count} more messages")

    def wait_event(self, count: int = 1) -> EventRecord:
        """The newest event, when so many are complete."""
        wait_for(
            lambda: [item.state for item in read_events(events_dir())] == [EventState.COMPLETE] * count, "the event"
        )
        return read_events(events_dir())[0]


@pytest.fixture
def scene(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    peer = Peer()
    made = Scene(tmp_path, peer)
    yield made
    if made.node is not None:
        made.node.stop()
    peer.close()


def numbers(folder: Path) -> list[int]:
    """The numbers of the safety monitor's messages in an event's folder, as rosbags reads them."""
    with AnyReader([folder]) as reader:
        rows = [item for item in reader.connections if item.topic == topics.SAFETY_STATUS.name]
        return [
            round(reader.deserialize(data, connection.msgtype).min_obstacle_distance)
            for connection, _, data in reader.messages(connections=rows)
        ]


def on_disk(copy: Path) -> list[int]:
    """The numbers that a power failure would leave in the segments. copy: a folder for them, made anew."""
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    for path in (black_box_dir() / "segments").glob("*.mcap"):
        with suppress(FileNotFoundError):  # too old meanwhile
            shutil.copy(path, copy)
    recover_folder(copy)
    return numbers(copy) if any(copy.glob("*.mcap")) else []


def test_a_killed_black_box_leaves_an_event_of_what_was_before(scene: Scene, tmp_path: Path) -> None:
    node = scene.launch()
    wait_for(lambda: len(on_disk(tmp_path / "copy")) > 20, "messages on the disk", poll_s=0.5)
    node.signal(signal.SIGKILL)
    node.wait()
    left = on_disk(tmp_path / "copy")
    scene.launch()
    event = scene.wait_event()
    assert event.reasons == ("INTERRUPTED",)
    assert len(left) > 10
    assert numbers(events_dir() / event.id)[: len(left)] == left


def test_images_are_left_out_or_blurred(scene: Scene) -> None:
    stripes = Image(height=64, width=64, encoding="mono8", step=64, data=bytes([0, 255]) * 2048)
    scene.peer.repeat(topics.FRONT_IMAGE, lambda: stripes, 10.0)
    node = scene.launch()
    assert scene.peer.publisher(topics.FRONT_IMAGE).get_subscription_count() == 0
    node.signal(signal.SIGINT)
    assert node.wait() == 0
    scene.launch("images:=always")
    wait_for(lambda: scene.peer.publisher(topics.FRONT_IMAGE).get_subscription_count() == 1, "images")
    scene.wait_sent(20)
    scene.faults = ["CONTACT"]
    event = scene.wait_event()
    with AnyReader([events_dir() / event.id]) as reader:
        rows = [item for item in reader.connections if item.topic == topics.FRONT_IMAGE.name]
        images = [reader.deserialize(data, row.msgtype) for row, _, data in reader.messages(connections=rows)]
    assert images
    assert {value for image in images for value in image.data.tolist()} <= {127, 128}
