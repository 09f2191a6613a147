"""Reading of recordings for a replay, and the lives of nodes in them."""

from __future__ import annotations

from pathlib import Path

import pytest

from custom_msgs.msg import Heartbeat
from robot_stack.contract import topics
from robot_stack.core.kept_events import CONFIG_FILE
from robot_stack.recording.writer import BagWriter, topic_info
from robot_stack.ros.serialization import serialize_message
from sim.replay.recorded import Recorded, Sent, read_recording, write_thinned
from sim.replay.replay import life_of
from sim.scheduler.observers import Recording
from sim.stack.recording import RUN_FILE, run_file

SECOND = 1_000_000_000
NODE = "swerve_controller"
ROWS = [topics.HEARTBEAT, topics.EMERGENCY_STOP]


def beat(at_ns: int, sequence: int, pid: int = 1) -> Sent:
    message = Heartbeat(node=NODE, pid=pid, sequence=sequence)
    message.stamp.sec, message.stamp.nanosec = divmod(at_ns, SECOND)
    return Sent(at_ns, at_ns, serialize_message(message))


def recorded(*beats: Sent, begin_ns: int = 100 * SECOND) -> Recorded:
    made = Recorded(Path("ride"), begin_ns=begin_ns, end_ns=beats[-1].received_ns)
    made.messages[topics.HEARTBEAT.name] = list(beats)
    return made


def write(folder: Path, *beats: Sent) -> Path:
    attachments = {CONFIG_FILE: b"configuration", RUN_FILE: run_file(7, {NODE: {"a": 1}})}
    bag = BagWriter(folder, [topic_info(row) for row in ROWS], Recording.FORMAT, attachments)
    for item in beats:
        bag.write(topics.HEARTBEAT.name, item.received_ns, item.sent_ns, item.data)
    bag.close()
    return folder / f"{folder.name}_0.mcap"


LATE_NS = 40_000_000
STARTS = [beat((101 + n) * SECOND + 300, n + 1) for n in range(4)]
RAN_BEFORE = [beat((100 + n) * SECOND + 300, 50 + n) for n in range(4)]
ONE_LATE = [beat((101 + n) * SECOND + (LATE_NS if n == 2 else 0), n + 1) for n in range(5)]
RESTARTS = [beat(101 * SECOND, 1), beat(102 * SECOND, 2), beat(110 * SECOND, 1, pid=2)]


@pytest.mark.parametrize(
    ("beats", "start_ns", "recorded_start", "end_ns"),
    [
        (STARTS, 100 * SECOND + 300, True, None),  # a second before its first heartbeat
        (RAN_BEFORE, 100 * SECOND + 300, False, None),  # in phase at the begin of the recording
        (ONE_LATE, 100 * SECOND, True, None),  # the late one does not move the phase
        (RESTARTS, 100 * SECOND, True, 102 * SECOND),
    ],
    ids=["starts", "ran before", "one late", "restarts"],
)
def test_life_of_a_node(beats: list[Sent], start_ns: int, recorded_start: bool, end_ns: int | None) -> None:
    life = life_of(NODE, recorded(*beats))
    assert life is not None
    assert (life.start_ns, life.recorded_start, life.restarted) == (start_ns, recorded_start, end_ns is not None)
    if end_ns is not None:
        assert life.end_ns == end_ns


def test_what_is_stored_with_a_recording_is_read(tmp_path: Path) -> None:
    write(tmp_path / "ride", beat(101 * SECOND, 1))
    found = read_recording(tmp_path / "ride", ROWS)
    assert (found.configuration, found.seed, found.parameters) == (b"configuration", 7, {NODE: {"a": 1}})
    assert found.topics == {row.name for row in ROWS}
    assert found.nodes() == {NODE}


def test_a_thinned_recording_has_the_parameters_and_no_configuration(tmp_path: Path) -> None:
    write(tmp_path / "ride", beat(101 * SECOND, 1), beat(102 * SECOND, 2))
    write_thinned(read_recording(tmp_path / "ride", ROWS), [topics.HEARTBEAT], tmp_path / "thin.mcap")
    found = read_recording(tmp_path / "thin.mcap", ROWS)
    assert (found.configuration, found.seed, found.parameters) == (None, 7, {NODE: {"a": 1}})
    assert found.topics == {topics.HEARTBEAT.name}
    assert len(found.of(topics.HEARTBEAT)) == 2


@pytest.mark.parametrize(("until_s", "messages"), [(0.5, 1), (1.5, 2)])
def test_only_the_begin_is_read_on_request(tmp_path: Path, until_s: float, messages: int) -> None:
    write(tmp_path / "ride", *(beat((101 + n) * SECOND, n + 1) for n in range(3)))
    assert len(read_recording(tmp_path / "ride", ROWS, until_s).of(topics.HEARTBEAT)) == messages


def test_a_file_that_is_cut_off_is_read_up_to_its_end(tmp_path: Path) -> None:
    folder = tmp_path / "ride"
    bag = BagWriter(folder, [topic_info(row) for row in ROWS], Recording.FORMAT)
    for n in range(2):
        item = beat((101 + n) * SECOND, n + 1)
        bag.write(topics.HEARTBEAT.name, item.received_ns, item.sent_ns, item.data)
        bag.flush()
    path, whole = bag.path, bag.path.stat().st_size
    bag.abandon()
    with open(path, "r+b") as file:
        file.truncate(whole - 20)
    found = read_recording(path, ROWS)
    assert found.damages
    assert found.of(topics.HEARTBEAT)


def test_a_topic_of_another_type_is_named(tmp_path: Path) -> None:
    info = topic_info(topics.EMERGENCY_STOP)
    other = type(info)(topics.CMD_VEL.name, info.type, info.type_hash, info.qos)
    bag = BagWriter(tmp_path / "ride", [other], Recording.FORMAT)
    bag.write(other.name, 1, 1, b"\x00\x01\x00\x00\x01")
    bag.close()
    found = read_recording(tmp_path / "ride", [topics.CMD_VEL])
    assert "std_msgs/msg/Bool" in found.changed[topics.CMD_VEL.name]
