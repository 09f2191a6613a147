"""`robot-stack film` on recordings made by the project's own writer."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Path as PlanMessage
from PIL import Image
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from typer.testing import CliRunner

from custom_msgs.msg import DockingStatus, MissionStatus
from robot_stack.cli.app import app
from robot_stack.cli.errors import exit_code
from robot_stack.cli.film_recording import read_story
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import XYZ
from robot_stack.middleware.conversions import pose_to_msg, time_from_s
from robot_stack.middleware.point_cloud import cloud_message
from robot_stack.recording.writer import BagWriter, Format, topic_info
from tf2_msgs.msg import TFMessage

BEGUN_S = 1.7e9
ROWS = (
    topics.CURRENT_POSE,
    topics.SIM_BODIES,
    topics.JOINT_STATES,
    topics.PASSENGER_ATTACHED,
    topics.PLAN,
    topics.MISSION_STATUS,
    topics.DOCKING_STATUS,
    topics.OBSTACLES,
)
Item = tuple[float, Topic, Any]


def write(folder: Path, items: Iterable[Item]) -> Path:
    bag = BagWriter(
        folder, [topic_info(row) for row in ROWS], Format(split_bytes=10**9, chunk_bytes=2**16, compress=True)
    )
    for at_s, row, message in sorted(items, key=lambda item: item[0]):
        at_ns = round(1e9 * (BEGUN_S + at_s))
        bag.write(row.name, at_ns, at_ns, serialize_message(message))
    bag.close()
    return folder


def pose_at(time_s: float) -> Pose2:
    """Returns the pose on a line north from (0, 3) at 1 m/s."""
    return Pose2(0.0, 3.0 + time_s, 0.5 * math.pi)


def assumed(time_s: float) -> PoseStamped:
    message = PoseStamped(pose=pose_to_msg(pose_at(time_s)))
    message.header.frame_id, message.header.stamp = "map", time_from_s(BEGUN_S + time_s)
    return message


def bodies(time_s: float) -> TFMessage:
    chair = Pose2(-4.5, 11.0, math.pi) if time_s < 4.0 else pose_at(time_s).compose(Pose2(0.95, 0.0, 0.0))
    poses = {"base_link": pose_at(time_s), "wheelchair": chair, "person_anna": Pose2(2.0, 8.0, 0.0)}
    transforms = []
    for name, pose in poses.items():
        item = TransformStamped(child_frame_id=name)
        item.header.frame_id = "map"
        made = pose_to_msg(pose)
        item.transform.translation.x, item.transform.translation.y = made.position.x, made.position.y
        item.transform.rotation = made.orientation
        transforms.append(item)
    return TFMessage(transforms=transforms)


def ride(*, truth: bool) -> list[Item]:
    """Returns the messages of a ride of 6 s. At 4 s a wheelchair is attached."""
    items: list[Item] = []
    for index in range(60):
        time_s = 0.1 * index
        items.append((time_s, topics.CURRENT_POSE, assumed(time_s)))
        items.append((time_s, topics.JOINT_STATES, JointState(name=["fl_drive"], position=[12.0 * time_s])))
        if truth:
            items.append((time_s, topics.SIM_BODIES, bodies(time_s)))
        else:
            points = np.zeros(3, XYZ)
            points["x"], points["y"] = (2.0, 2.0, 3.0), (1.0, 1.1, -1.0)
            items.append((time_s, topics.OBSTACLES, cloud_message(points, "base_link")))
    plan = PlanMessage(poses=[assumed(0.0), assumed(6.0)])
    running = MissionStatus(state="RUNNING", current_waypoint="gate")
    return [
        *items,
        (0.0, topics.PASSENGER_ATTACHED, Bool(data=False)),
        (4.0, topics.PASSENGER_ATTACHED, Bool(data=True)),
        (0.0, topics.PLAN, plan),
        (0.0, topics.MISSION_STATUS, running),
        (3.0, topics.DOCKING_STATUS, DockingStatus(state="FINE_ALIGN")),
        (4.0, topics.DOCKING_STATUS, DockingStatus(state="DOCKED")),
        (4.0, topics.MISSION_STATUS, MissionStatus(state="RUNNING", current_waypoint="home", passenger_attached=True)),
    ]


def film(*arguments: object) -> tuple[int, str]:
    """(exit code of the command line, output or error)"""
    done = CliRunner().invoke(app, ["film", *map(str, arguments)])
    code = None if done.exception is None else exit_code(done.exception)
    return (done.exit_code, done.output) if code is None else (code, str(done.exception))


def quiet(_done: int, _total: int) -> None:
    pass


def test_story_of_a_simulated_ride_is_its_ground_truth(tmp_path: Path) -> None:
    story, warnings = read_story(write(tmp_path / "ride", ride(truth=True)), 20.0, quiet)
    assert warnings == []
    assert story.robot.at(BEGUN_S + 3.0).y == pytest.approx(6.0, abs=1e-6)
    assert set(story.others) == {"wheelchair", "person_anna"}
    assert story.others["wheelchair"].at(BEGUN_S).x == pytest.approx(-4.5)
    assert story.joints_at(BEGUN_S + 2.0)["fl_drive"] == pytest.approx(24.0, abs=0.1)
    assert story.obstacles == []
    texts = [text for _, text in story.captions]
    assert texts == [
        "driving to: gate",
        "docking, the last centimetres",
        "driving to: gate",
        "carrying the passenger to: home",
    ]
    assert len(story.plans[0][1]) == 2


def test_story_of_real_ride_is_built_from_estimates(tmp_path: Path) -> None:
    """Without ground truth the pose is localization's, the wheelchair is at the latch, and obstacles are in map."""
    story, _ = read_story(write(tmp_path / "ride", ride(truth=False)), 20.0, quiet)
    assert story.robot.at(BEGUN_S + 3.0).y == pytest.approx(6.0, abs=1e-6)
    chair = story.others["wheelchair"]
    assert (chair.at(BEGUN_S).y, chair.at(BEGUN_S + 5.0).y) == pytest.approx((7.95, 8.95), abs=0.06)
    at_s, points = story.obstacles[0]
    assert len(story.obstacles) > 5
    here = pose_at(at_s - BEGUN_S)  # facing north: ahead is +y, left is -x
    assert points[0] == pytest.approx((here.x - 1.0, here.y + 2.0), abs=1e-3)


@pytest.mark.parametrize("truth", [True, False])
def test_a_film_shows_a_robot_that_moves(tmp_path: Path, truth: bool) -> None:
    recording = write(tmp_path / "ride", ride(truth=truth))
    code, shown = film(recording, "--seconds", 2, "--width", 320)
    assert code == 0, shown
    path = recording / "film.gif"
    assert str(path) in shown.replace("\n", "")
    with Image.open(path) as gif:
        assert (gif.n_frames, gif.size[0]) == (20, 320)
        assert gif.info["duration"] == 100
        first = np.asarray(gif.convert("RGB")).astype(int)
        gif.seek(19)
        last = np.asarray(gif.convert("RGB")).astype(int)
    teal = np.array([31, 184, 174])
    assert (np.abs(first - teal).max(axis=2) < 40).sum() > 100  # the robot's lid, and its plan
    assert (np.abs(first - last).max(axis=2) > 40).mean() > 0.02


def test_mp4_is_read_by_others(tmp_path: Path) -> None:
    recording = write(tmp_path / "ride", ride(truth=True))
    path = tmp_path / "out" / "ride.mp4"
    code, shown = film(recording, "--seconds", 1, "-o", path, "--map", "")
    assert code == 0, shown
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 10
    seen, picture = video.read()
    assert seen
    assert picture.std() > 10.0


def test_a_damaged_recording_is_shown_as_far_as_it_goes(tmp_path: Path) -> None:
    recording = write(tmp_path / "ride", ride(truth=True))
    file = recording / "ride_0.mcap"
    file.write_bytes(file.read_bytes()[: int(0.7 * file.stat().st_size)])
    code, shown = film(recording, "--seconds", 1, "--width", 200, "--map", "")
    assert code == 0, shown
    assert "is cut off or damaged" in shown
    assert (recording / "film.gif").is_file()


@pytest.mark.parametrize(
    ("items", "arguments", "why"),
    [
        ([], (), ""),
        ([(0.0, topics.PASSENGER_ATTACHED, Bool(data=False))], (), "contains no ride"),
        (ride(truth=True), ("--map", "nowhere"), "no map 'nowhere'"),
        (ride(truth=True), ("-o", "film.avi"), "a film ends in .gif or .mp4"),
    ],
    ids=["no recording", "no ride", "no map", "no film"],
)
def test_what_makes_no_film_is_wrong_use(tmp_path: Path, items: list[Item], arguments: tuple[str], why: str) -> None:
    recording = write(tmp_path / "ride", items) if items else tmp_path
    code, error = film(recording, *arguments)
    assert (code, why in error) == (2, True), error
