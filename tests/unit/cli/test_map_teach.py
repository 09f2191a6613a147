"""robot-stack map teach without ROS: its behaviour if the ride ends unexpectedly."""

from __future__ import annotations

import os
import shutil
import signal
import threading
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

from robot_stack.cli import map_teach
from robot_stack.cli.errors import CommandError
from robot_stack.cli.map_recording import read_ride
from robot_stack.cli.map_teach_picture import taught_picture, write_picture
from robot_stack.cli.nodes.taught_topics import ROWS, Taken
from robot_stack.contract import topics
from robot_stack.core.config import config_dir
from robot_stack.core.robot import load_robot
from robot_stack.mapping.collector import Collector
from robot_stack.mapping.teaching import GrowingMap
from robot_stack.recording import background
from tests.unit.cli.test_map import write_ride
from tests.unit.mapping import site
from tests.unit.mapping.test_teaching import taught

_AT_ONCE = 40


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """A recording of the ride with all its sweeps."""
    folder = tmp_path_factory.mktemp("rides") / "ride"
    write_ride(folder)
    return folder


@pytest.fixture(scope="module")
def messages(everything):
    rows = {row.name: row for row in ROWS}
    with open(everything / "ride_0.mcap", "rb") as file:
        found = make_reader(file).iter_messages(topics=list(rows), log_time_order=False)
        return [Taken(rows[c.topic], m.data, m.log_time, m.publish_time) for _, c, m in found]


@pytest.fixture(params=["goes on"])
def received(messages, monkeypatch, request):
    """Every take returns the next messages of the ride. The event is set once all of them are taken."""
    all_taken = threading.Event()

    class Received:
        def __init__(self) -> None:
            self._begin = 0

        def __enter__(self) -> Received:
            return self

        def __exit__(self, *_: object) -> None: ...

        def published(self) -> bool:
            return True

        def take(self) -> list[Taken]:
            self._begin += _AT_ONCE
            if self._begin - _AT_ONCE >= len(messages):
                all_taken.set()
                if request.param == "ends":
                    os.kill(os.getpid(), signal.SIGTERM)
            return messages[self._begin - _AT_ONCE : self._begin]

    monkeypatch.setattr(map_teach, "TaughtTopics", Received)
    monkeypatch.setattr(map_teach, "_stack_runs", lambda: True)
    monkeypatch.setattr(map_teach, "ask", lambda *_, **__: {"safety": None})
    return all_taken


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Iterator:
    own = tmp_path / "config"
    shutil.copytree(config_dir(), own, ignore=shutil.ignore_patterns("maps"))
    (own / "mapping.yaml").write_text(yaml.safe_dump(site.params().model_dump(mode="json")), encoding="utf-8")
    recorder = yaml.safe_load((own / "recorder.yaml").read_text(encoding="utf-8"))
    (own / "recorder.yaml").write_text(yaml.safe_dump({**recorder, "max_disk_use": 0.99}), encoding="utf-8")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(own))
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield tmp_path
    for number, handler in before.items():
        signal.signal(number, handler)


def ride_of(recording):
    ride, warnings = read_ride(recording, site.params().sweeps, load_robot(), lambda *_: None)
    assert warnings == []
    return ride


@pytest.mark.parametrize("received", ["ends"], indirect=True)
def test_taught_recording_yields_same_ride_as_full_recording(received, folder, everything):
    with pytest.raises(CommandError, match="ended; to build the map of this ride"):
        map_teach.teach_map("room", folder / "maps", None, folder / "ride", None)
    taught, whole = ride_of(folder / "ride"), ride_of(everything)
    # The first messages only show that a stack runs: the ride starts with the second sweep, at standstill.
    assert [sweep.stamp_s for sweep in taught.sweeps[1:]] == [sweep.stamp_s for sweep in whole.sweeps[1:]]
    for one, other in zip(taught.sweeps[1:], whole.sweeps[1:], strict=True):
        np.testing.assert_array_equal(one.points, other.points)
    for name in ("odometry", "attitude", "turn_rate"):
        kept = getattr(taught, name)
        np.testing.assert_array_equal(kept.values, getattr(whole, name).values[-len(kept.values) :])
        assert len(kept.values) > 0.9 * len(getattr(whole, name).values)
    counted = sum(1 for line in messages_of(folder / "ride") if line == topics.LIDAR_POINTS.name)
    assert counted == len(taught.sweeps) < len(site.recorded().sweeps), "those that do not count are left out"


def messages_of(recording) -> list[str]:
    """Returns the topics of a recording's messages."""
    with open(recording / "ride_0.mcap", "rb") as file:
        return [channel.topic for _, channel, _ in make_reader(file).iter_messages()]


def test_full_disk_ends_teaching_and_keeps_recording(received, folder, monkeypatch):
    monkeypatch.setattr(background, "disk_use", lambda _: 1.0 if received.is_set() else 0.5)
    with pytest.raises(CommandError, match=r"recording has stopped: the disk of .* is 100% full") as refused:
        map_teach.teach_map("room", folder / "maps", (3.0, 0.0, 1.5), folder / "ride", None)
    assert f"map build {folder / 'ride'} --name room --output {folder / 'maps'} --origin 3.0 0.0 1.5" in str(
        refused.value
    )
    assert not (folder / "maps").exists()
    assert len(ride_of(folder / "ride").sweeps) >= site.params().sweeps.fewest
    assert (folder / "ride" / "growing.png").is_file()


def test_unwritable_picture_is_reported_before_teaching(received, folder):
    with pytest.raises(CommandError, match=r"growing.png cannot be written: there is no folder .*nowhere"):
        map_teach.teach_map("room", folder / "maps", None, folder / "ride", folder / "nowhere" / "growing.png")
    assert not (folder / "ride").exists()


@pytest.mark.parametrize(
    ("safety", "words"),
    [
        ({"emergency": True, "faults": ["ESTOP_PRESSED"]}, "emergency stop: the robot does not move"),
        ({"emergency": False, "faults": ["LOCALIZATION_LOST", "SLOPE"]}, "LOCALIZATION_LOST stops the robot"),
        ({"emergency": False, "faults": ["SLOPE"]}, ""),
        (None, ""),
    ],
)
def test_why_the_robot_does_not_obey(monkeypatch, safety, words):
    monkeypatch.setattr(map_teach, "ask", lambda *_, **__: {"safety": safety})
    assert words in "".join(map_teach._held_by_safety())
    assert bool(words) == bool(map_teach._held_by_safety())


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_unwritable_map_folder_is_reported_before_teaching(received, folder):
    (folder / "maps").mkdir(mode=0o500)
    with pytest.raises(CommandError, match="no right to write"):
        map_teach.teach_map("room", folder / "maps", None, folder / "ride", None)


def test_picture_shows_walls_free_space_and_path_at_their_positions(tmp_path):
    growing = taught(Collector(site.params().sweeps, load_robot()))
    size_m = site.params().grid.resolution_m
    file = tmp_path / "growing.png"
    write_picture(taught_picture(growing, size_m, 640), file)
    picture = cv2.imread(str(file))
    assert max(picture.shape) == 640
    dark, light = (picture < 60).all(axis=2), (picture > 230).all(axis=2)
    # x points right, y up: the box at (-5, 4) is in the upper left corner, and the path leads round the centre.
    low = growing.seen.min(axis=0) - 5
    pixel_m = (growing.seen[:, 0].max() + 6 - low[0]) * size_m / picture.shape[1]

    def at(x_m: float, y_m: float) -> tuple[slice, slice]:
        column = round((x_m - low[0] * size_m) / pixel_m)
        row = picture.shape[0] - round((y_m - low[1] * size_m) / pixel_m)
        return slice(row - 6, row + 7), slice(column - 6, column + 7)

    assert dark[at(-4.0, 3.7)].any()
    assert dark[at(0.0, 5.1)].any()
    assert light[at(-2.0, 0.5)].all()
    assert (picture[at(-3.0, 0.0)] == (14, 127, 255)).all(axis=2).any(), "the way"


def test_picture_of_empty_map_is_uniform():
    picture = taught_picture(GrowingMap(site.params(), None), 0.1, 400)
    assert picture.shape == (100, 100, 3)
    assert np.ptp(picture) == 0


def test_a_terminal_shows_one_line_and_keeps_warnings(capsys, monkeypatch):
    monkeypatch.setattr(map_teach.sys.stdout, "isatty", lambda: True, raising=False)
    terminal = map_teach._Terminal()
    for now_s in (0.0, 1.0, 2.0):
        terminal.warn(["too fast"] if now_s < 2.0 else [], now_s)
        terminal.line(f"{now_s:g} m")
    terminal.warn(["too fast"], 3.0)
    terminal.warn(["too fast"], 12.0)
    terminal.warn(["too fast"], 13.5)
    terminal.end()
    shown = capsys.readouterr().out
    clear = "\r\x1b[K"
    warning = f"{clear}warning: too fast\n"
    assert shown == f"{warning}{clear}0 m{clear}1 m{clear}2 m{warning}{warning}\n"
