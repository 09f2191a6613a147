"""The picture of a kept event: costmap and camera images of the moment of its first trigger."""

from __future__ import annotations

import shutil
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture
from sensor_msgs.msg import Image

from robot_stack.cli.event_picture import event_picture
from robot_stack.contract import topics
from robot_stack.core.kept_events import EventRecord, EventState, Software, Trigger
from robot_stack.recording.writer import BagWriter, topic_info
from robot_stack.ros.serialization import serialize_message
from sim.replay.recorded import read_recording
from sim.scheduler.observers import Recording

RIDE = Path(__file__).parents[2] / "rides" / "goal_ahead.mcap"


def event(ros_s: float) -> EventRecord:
    trigger = Trigger(at_s=ros_s, ros_s=ros_s, reasons=("TILT",))
    software = Software(version="1", sha256="")
    return EventRecord(id="e", state=EventState.COMPLETE, triggers=(trigger,), software=software, map=None, nodes=())


def size(png: bytes | None) -> tuple[int, int]:
    assert png is not None
    found: tuple[int, int] = Picture.open(BytesIO(png)).size
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(RIDE, tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def begin_s() -> float:
    return 1e-9 * read_recording(RIDE, ()).begin_ns


def test_the_costmap_is_drawn_and_changes_as_the_robot_drives(folder: Path, begin_s: float) -> None:
    first, later = (event_picture(folder, event(begin_s + at_s)) for at_s in (6.0, 12.0))
    width, height = size(first)
    assert abs(width - height) <= 2
    assert first != later


def test_a_moment_without_pictures_has_none(folder: Path, begin_s: float) -> None:
    assert event_picture(folder, event(begin_s + 1e4)) is None


def test_a_camera_image_stands_beside_the_costmap(folder: Path, begin_s: float) -> None:
    pixels = np.full((30, 40, 3), (200, 20, 20), np.uint8)
    image = Image(height=30, width=40, encoding="bgr8", step=120, data=pixels.tobytes())
    bag = BagWriter(folder / "images", [topic_info(topics.FRONT_IMAGE)], Recording.FORMAT)
    at_ns = round(1e9 * (begin_s + 5.5))
    bag.write(topics.FRONT_IMAGE.name, at_ns, at_ns, bytes(serialize_message(image)))
    bag.close()
    for file in (folder / "images").glob("*.mcap"):
        shutil.move(file, folder)
    without, with_image = (size(event_picture(folder, event(begin_s + at_s))) for at_s in (12.0, 6.0))
    assert with_image[0] > 1.8 * without[0]


def test_a_file_that_was_cut_off_is_left_out(folder: Path, begin_s: float) -> None:
    with open(folder / RIDE.name, "r+b") as file:
        file.truncate(1000)
    assert event_picture(folder, event(begin_s + 6.0)) is None
