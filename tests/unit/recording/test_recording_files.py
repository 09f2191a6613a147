"""Recordings as other tools read them: complete, split, cut at any byte, and on a full disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from robot_stack.contract import topics
from robot_stack.core.config import ConfigError, config_dir, load, read_yaml, validate
from robot_stack.core.message_definitions import message_definition
from robot_stack.recording import metadata
from robot_stack.recording.background import BackgroundWriter, disk_use
from robot_stack.recording.params import RecorderParams
from robot_stack.recording.recovery import (
    InUse,
    NotRecoverable,
    is_complete,
    main,
    recording_files,
    recover_all,
    recover_file,
    recover_folder,
)
from robot_stack.recording.writer import BagWriter, Format, topic_info
from tests.support.waiting import wait_for

ROWS = (topics.MISSION_STATUS, topics.ODOM, topics.EMERGENCY_STOP, topics.PASSENGER_ATTACHED)
FORM = Format(split_bytes=10_000_000, chunk_bytes=4_000, compress=True)
START_NS = 1_700_000_000_000_000_000

STORE = get_typestore(Stores.ROS2_JAZZY)
STORE.register(get_types_from_msg(message_definition("custom_msgs/msg/MissionStatus"), "custom_msgs/msg/MissionStatus"))
Status = STORE.types["custom_msgs/msg/MissionStatus"]
Header = STORE.types["std_msgs/msg/Header"]
Time = STORE.types["builtin_interfaces/msg/Time"]
Bool = STORE.types["std_msgs/msg/Bool"]


def status(number: int) -> bytes:
    header = Header(stamp=Time(sec=number, nanosec=0), frame_id="map")
    fields = ("RUNNING", "ride", "走行", f"w{number}", number % 200, 200, 0.5, 1.5, True, "理由" * 20, "PAUSE", False)
    return bytes(STORE.serialize_cdr(Status(header, *fields), Status.__msgtype__))


def boolean(value: bool) -> bytes:
    return bytes(STORE.serialize_cdr(Bool(data=value), Bool.__msgtype__))


def make_bag(folder: Path, form: Format = FORM, rows=ROWS) -> BagWriter:
    return BagWriter(folder, [topic_info(row) for row in rows], form)


def fill(bag: BagWriter, count: int, first: int = 0) -> None:
    for number in range(first, first + count):
        log_ns = START_NS + number * 1_000_000
        bag.write("/mission/status", log_ns, log_ns - 500, status(number))
        if number % 10 == 0:
            bag.write("/emergency_stop", log_ns + 1, log_ns, boolean(number % 20 == 0))


def waypoints(folder: Path) -> list[str]:
    """Returns the mission waypoints of a recording as rosbags reads them."""
    with AnyReader([folder]) as reader:
        connections = [item for item in reader.connections if item.topic == "/mission/status"]
        rows = reader.messages(connections=connections)
        return [reader.deserialize(data, connection.msgtype).current_waypoint for connection, _, data in rows]


def expected(count: int) -> list[str]:
    return [f"w{number}" for number in range(count)]


# --- complete recordings ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("compress", [True, False])
def test_rosbags_reads_the_folder(tmp_path, compress):
    bag = make_bag(tmp_path / "ride", Format(10_000_000, 4_000, compress))
    fill(bag, 100)
    bag.close()
    assert waypoints(tmp_path / "ride") == expected(100)
    with Reader(tmp_path / "ride") as reader:
        assert reader.message_count == 110
        assert reader.start_time == START_NS
        assert reader.duration == 99_000_000 + 1
        assert {name: info.msgcount for name, info in reader.topics.items()} == {
            "/mission/status": 100, "/odom": 0, "/emergency_stop": 10, "/passenger_attached": 0,
        }  # fmt: skip
        stop = next(item for item in reader.connections if item.topic == "/emergency_stop")
        (qos,) = stop.ext.offered_qos_profiles
        assert (qos.reliability.name, qos.durability.name, qos.depth) == ("RELIABLE", "TRANSIENT_LOCAL", 1)
        assert stop.digest.startswith("RIHS01_")


def test_mcap_and_its_ros2_decoder_read_the_file(tmp_path):
    bag = make_bag(tmp_path / "ride")
    fill(bag, 100)
    bag.close()
    with open(tmp_path / "ride" / "ride_0.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        header = reader.get_header()
        assert (header.profile, header.library) == ("ros2", "robot_stack recorder")
        rows = list(reader.iter_decoded_messages(topics=["/mission/status"]))
    assert [decoded.current_waypoint for _, _, _, decoded in rows] == expected(100)
    schema, channel, message, decoded = rows[7]
    assert schema.name == "custom_msgs/msg/MissionStatus"
    assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
    assert (message.sequence, message.log_time, message.publish_time) == (7, START_NS + 7_000_000, START_NS + 6_999_500)
    assert (decoded.mission_name, decoded.header.stamp.sec, decoded.passenger_attached) == ("走行", 7, True)


def test_metadata_yaml_is_rosbag2s(tmp_path):
    bag = make_bag(tmp_path / "ride")
    fill(bag, 5)
    bag.close()
    text = (tmp_path / "ride" / "metadata.yaml").read_text(encoding="utf-8")
    data = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert data["storage_identifier"] == "mcap"
    assert data["relative_file_paths"] == ["ride_0.mcap"]
    assert data["starting_time"] == {"nanoseconds_since_epoch": START_NS}
    assert data["files"][0]["message_count"] == 6
    assert "&id" not in text, "no anchors"
    stop = next(row for row in data["topics_with_message_count"] if row["topic_metadata"]["name"] == "/emergency_stop")
    profile = stop["topic_metadata"]["offered_qos_profiles"][0]
    assert profile["deadline"] == {"sec": 9_223_372_036, "nsec": 854_775_807}
    with open(tmp_path / "ride" / "ride_0.mcap", "rb") as file:  # which carries its metadata too
        records = {item.name: item.metadata for item in make_reader(file).iter_metadata()}
    inside = yaml.safe_load(records["rosbag2"]["serialized_metadata"])
    assert (inside["version"], inside["message_count"], inside["ros_distro"]) == (9, 6, "jazzy")


def test_an_empty_recording_is_readable_and_a_folder_that_exists_is_not_touched(tmp_path):
    make_bag(tmp_path / "ride").close()
    with Reader(tmp_path / "ride") as reader:
        assert reader.message_count == 0
    with pytest.raises(FileExistsError):
        make_bag(tmp_path / "ride")


def test_a_long_recording_is_split_and_read_as_one(tmp_path):
    bag = make_bag(tmp_path / "ride", Format(split_bytes=20_000, chunk_bytes=2_000, compress=False))
    fill(bag, 400)
    bag.close()
    files = sorted((tmp_path / "ride").glob("*.mcap"))
    assert len(files) > 3
    assert all(path.stat().st_size < 40_000 + 20_000 for path in files)
    assert waypoints(tmp_path / "ride") == expected(400)
    with Reader(tmp_path / "ride") as reader:
        assert reader.message_count == 440


# --- cut off ---------------------------------------------------------------------------------------------------------


def flushed_bag(folder: Path, parts=(30, 30, 30), **form) -> bytes:
    """Returns the bytes of a file flushed after each part but never completed, with the recorder's lock released."""
    bag = make_bag(folder, Format(**{"split_bytes": 10_000_000, "chunk_bytes": 100_000, "compress": True, **form}))
    done = 0
    for count in parts:
        fill(bag, count, done)
        bag.flush()
        done += count
    data = bag.path.read_bytes()
    bag.abandon()
    (folder / "ride_0.mcap").write_bytes(data)
    return data


def test_flushed_recording_without_end_is_readable_and_recoverable(tmp_path):
    data = flushed_bag(tmp_path / "ride")
    path = tmp_path / "ride" / "ride_0.mcap"
    assert not is_complete(path)
    messages = 0
    with open(path, "rb") as file, suppress(Exception):
        for record in StreamReader(file).records:
            messages += type(record).__name__ == "Message"
    assert messages == 99
    assert recover_file(path) == 99
    assert path.read_bytes()[: len(data)] == data, "nothing is rewritten, only the end is added"


def test_recovery_completes_recording_folder(tmp_path):
    flushed_bag(tmp_path / "ride")
    done = recover_folder(tmp_path / "ride")
    assert done == [f"{tmp_path / 'ride' / 'ride_0.mcap'}: completed with 99 messages"]
    assert waypoints(tmp_path / "ride") == expected(90)
    with Reader(tmp_path / "ride") as reader:
        assert reader.message_count == 99
        assert next(item for item in reader.connections if item.topic == "/odom").digest.startswith("RIHS01_")
    with open(tmp_path / "ride" / "ride_0.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        assert len(list(reader.iter_decoded_messages(topics=["/mission/status"]))) == 90
        summary = reader.get_summary()
    assert summary.statistics.message_count == 99
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) == 3
    assert recover_folder(tmp_path / "ride") == [], "a second time there is nothing to do"


def test_recovery_of_split_recording_leaves_complete_files_unchanged(tmp_path):
    bag = make_bag(tmp_path / "ride", Format(split_bytes=20_000, chunk_bytes=2_000, compress=False))
    fill(bag, 200)
    bag.flush()
    bag.abandon()
    before = (tmp_path / "ride" / "ride_0.mcap").read_bytes()
    recover_folder(tmp_path / "ride")
    assert (tmp_path / "ride" / "ride_0.mcap").read_bytes() == before
    assert waypoints(tmp_path / "ride") == expected(200)


def test_a_file_that_a_power_failure_left_empty_is_no_part_of_the_recording(tmp_path):
    folder = tmp_path / "ride"
    bag = make_bag(folder)
    fill(bag, 10)
    bag.close()
    before = recording_files(folder)
    (folder / "ride_1.mcap").touch()
    assert recording_files(folder) == before
    assert len(waypoints(folder)) == 10


@pytest.fixture(scope="module")
def cut_off(tmp_path_factory) -> bytes:
    return flushed_bag(tmp_path_factory.mktemp("cut") / "ride", parts=(1, 5, 5))


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, 1.0))
def test_a_file_cut_at_any_byte_keeps_its_whole_chunks(tmp_path_factory, cut_off, share):
    size = round(share * len(cut_off))
    path = tmp_path_factory.mktemp("any") / "ride" / "ride_0.mcap"
    path.parent.mkdir()
    path.write_bytes(cut_off[:size])
    if size < 8:
        with pytest.raises(NotRecoverable):
            recover_file(path)
        return
    count = recover_file(path)
    recover_folder(path.parent)
    names = waypoints(path.parent) if count else []
    assert names == expected(len(names))
    assert len(names) in (0, 1, 6, 11), "a chunk is there as a whole or not at all"
    with open(path, "rb") as file:
        assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages()) == count


def test_a_power_cut_that_leaves_zeros_loses_the_last_chunk_only(tmp_path):
    data = flushed_bag(tmp_path / "ride", parts=(30, 30, 30))
    path = tmp_path / "ride" / "ride_0.mcap"
    with open(path, "rb") as file:
        starts = [position for position in range(len(data)) if data[position] == 6 and _is_chunk(data, position)]
        assert file
    begin = starts[-1] + 60
    path.write_bytes(data[:begin] + bytes(40) + data[begin + 40 :])
    assert recover_file(path) == 66
    recover_folder(tmp_path / "ride")
    (tmp_path / "ride" / "metadata.yaml").unlink()
    recover_folder(tmp_path / "ride")
    assert waypoints(tmp_path / "ride") == expected(60)


def _is_chunk(data: bytes, position: int) -> bool:
    """Returns whether a chunk record with the test's times begins here."""
    return int.from_bytes(data[position + 9 : position + 17], "little") // 10**18 == START_NS // 10**18


def test_damaged_first_chunk_is_reported_and_file_left_unchanged(tmp_path):
    data = flushed_bag(tmp_path / "ride")
    path = tmp_path / "ride" / "ride_0.mcap"
    start = next(position for position in range(len(data)) if data[position] == 6 and _is_chunk(data, position))
    damaged = data[: start + 80] + bytes(200) + data[start + 280 :]
    path.write_bytes(damaged)
    with pytest.raises(NotRecoverable, match="first chunk is damaged"):
        recover_file(path)
    assert path.read_bytes() == damaged
    assert "first chunk is damaged" in recover_folder(tmp_path / "ride")[0]
    path.write_bytes(b"something else entirely")
    with pytest.raises(NotRecoverable, match="does not begin as an MCAP file"):
        recover_file(path)


def test_a_recording_in_progress_is_left_alone(tmp_path):
    bag = make_bag(tmp_path / "ride")
    fill(bag, 10)
    bag.flush()
    with pytest.raises(InUse):
        recover_file(bag.path)
    assert recover_all(tmp_path) == []
    bag.close()
    assert waypoints(tmp_path / "ride") == expected(10)


def test_all_recordings_of_a_folder(tmp_path):
    flushed_bag(tmp_path / "a")
    (tmp_path / "a" / "a_0.mcap").unlink()
    whole = make_bag(tmp_path / "b")
    whole.close()
    (tmp_path / "c").mkdir()
    (tmp_path / "notes.txt").write_text("not a recording")
    assert recover_all(tmp_path) == [f"{tmp_path / 'a' / 'ride_0.mcap'}: completed with 99 messages"]
    assert recover_all(tmp_path) == []


def test_recovery_from_the_command_line(tmp_path, capsys):
    flushed_bag(tmp_path / "ride")
    assert main([str(tmp_path / "ride")]) == 0
    assert "completed with 99 messages" in capsys.readouterr().out
    assert main([str(tmp_path / "ride")]) == 0
    assert "is complete" in capsys.readouterr().out
    assert main([]) == 2


# --- the thread ------------------------------------------------------------------------------------------------------


def background(tmp_path: Path, **changes) -> BackgroundWriter:
    options = {"flush_period_s": 0.05, "max_disk_use": 0.99, "queue_bytes": 1_000_000, **changes}
    return BackgroundWriter(make_bag(tmp_path / "ride"), tmp_path, **options)


@pytest.fixture
def roomy_disk(monkeypatch):
    """Makes the tests independent of the disk use of the machine."""
    use = {"share": 0.5}
    monkeypatch.setattr("robot_stack.recording.background.disk_use", lambda folder: use["share"])
    return use


def test_the_thread_writes_and_completes(tmp_path, roomy_disk):
    writer = background(tmp_path)
    for number in range(50):
        writer.add("/mission/status", START_NS + number, START_NS, status(number))
    writer.close()
    assert waypoints(tmp_path / "ride") == expected(50)
    counts = writer.counts()
    assert (counts.messages, counts.lost, counts.bytes) == (50, 0, sum(len(status(number)) for number in range(50)))


def test_a_disk_that_fills_ends_the_recording_in_order(tmp_path, roomy_disk):
    writer = background(tmp_path, max_disk_use=0.9)
    writer.add("/mission/status", START_NS, START_NS, status(0))
    roomy_disk["share"] = 0.91
    wait_for(lambda: writer.problem, "the end of the recording")
    assert writer.problem == f"the disk of {tmp_path} is 91% full, limit max_disk_use 90%"
    writer.add("/mission/status", START_NS + 1, START_NS, status(1))
    writer.close()
    assert waypoints(tmp_path / "ride") == expected(1)
    assert writer.counts().lost == 1


def test_a_slow_disk_loses_messages_and_counts_them(tmp_path, roomy_disk, monkeypatch):
    released = []
    real = BagWriter.write

    def slow(self, *arguments):
        wait_for(lambda: released, "the test's word")
        real(self, *arguments)

    monkeypatch.setattr(BagWriter, "write", slow)
    writer = background(tmp_path, queue_bytes=3 * len(status(0)))
    for number in range(10):
        writer.add("/mission/status", START_NS + number, START_NS, status(0))
    lost = writer.counts().lost
    released.append(True)
    writer.close()
    assert 6 <= lost <= 7
    assert len(waypoints(tmp_path / "ride")) == 10 - lost


def test_disk_use_is_a_share(tmp_path):
    assert 0.0 <= disk_use(tmp_path) <= 1.0
    with pytest.raises(OSError, match="No such file"):
        disk_use(tmp_path / "nowhere")


_FILL_THE_DISK = """
import resource, sys, time
from pathlib import Path
from tests.unit.recording import test_recording_files as test
resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, resource.RLIM_INFINITY))
writer = test.background(Path(sys.argv[1]))
number, end_s = 0, time.monotonic() + 20.0
while not writer.problem and time.monotonic() < end_s:
    writer.add("/odom", test.START_NS + number, 0, bytes([0, 1, 0, 0]) + number.to_bytes(8, "little") * 40)
    number += 1
    time.sleep(0.0005)
writer.close()
print(writer.problem)
"""


def test_full_disk_ends_recording_and_keeps_written_messages(tmp_path):
    """The operating system really refuses to extend the file. Normally max_disk_use stops the recording earlier."""
    code = "import robot_stack.recording.background as b; b.disk_use = lambda folder: 0.5\n" + _FILL_THE_DISK
    command = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=os.getcwd(), check=False)
    assert done.returncode == 0, done.stderr
    assert "ride_0.mcap cannot be written: " in done.stdout
    recover_folder(tmp_path / "ride")
    with Reader(tmp_path / "ride") as reader:
        assert reader.message_count > 10


# --- SIGKILL ---------------------------------------------------------------------------------------------------------

# After each flush, prints the number of messages written before it.
_RECORD_FOR_EVER = """
import sys, threading
from pathlib import Path
from tests.unit.recording import test_recording_files as test
import robot_stack.recording.background as background
from robot_stack.recording.writer import BagWriter
background.disk_use = lambda folder: 0.5
flush, write, written = BagWriter.flush, BagWriter.write, []
turns = threading.Semaphore(0)

def counted(bag, *message):
    write(bag, *message)
    written.append(message)

def reported(bag):
    flush(bag)
    print(len(written), flush=True)
    turns.release()

BagWriter.write, BagWriter.flush = counted, reported
writer = test.background(Path(sys.argv[1]), flush_period_s=0.01)
number = 0
while True:
    writer.add("/mission/status", test.START_NS + number, test.START_NS, test.status(number))
    number += 1
    if number % 10 == 0:
        turns.acquire()
"""


def test_a_killed_recorder_loses_nothing_that_was_flushed(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", _RECORD_FOR_EVER, str(tmp_path)], stdout=subprocess.PIPE, text=True, cwd=os.getcwd()
    )
    try:
        flushed = 0
        while flushed < 200:
            flushed = int(process.stdout.readline())
    finally:
        process.send_signal(signal.SIGKILL)
        rest, _ = process.communicate(timeout=30)
    # The last line may be incomplete.
    flushed = max([flushed, *map(int, rest.splitlines()[:-1])])
    recover_folder(tmp_path / "ride")
    names = waypoints(tmp_path / "ride")
    assert names == expected(len(names)), "without a gap"
    assert len(names) >= flushed


# --- parameters ------------------------------------------------------------------------------------------------------


def test_the_shipped_parameters_are_valid():
    assert load(RecorderParams, "recorder").max_disk_use < 0.95, "below DISK_FULL of the safety monitor"
    assert load(RecorderParams, "recorder").flush_period_s < 1.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("systems", ["robot", "wmx"]),
        ("systems", []),
        ("systems", ["moon"]),
        ("split_size_mb", float("nan")),
        ("name", "../elsewhere"),
        ("name", ".hidden"),
    ],
)
def test_parameters_out_of_range_are_refused(name, value):
    data = read_yaml(config_dir() / "recorder.yaml")
    with pytest.raises(ConfigError):
        validate(RecorderParams, {**data, name: value}, "recorder.yaml")


def test_qos_survives_as_text():
    qos = metadata.offered_qos(topics.TF.qos)
    assert metadata.qos_from_text(metadata.qos_text(qos)) == qos
    assert metadata.qos_from_text("") == ()
