"""Reads the data of a film from a recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.cli.recordings import Recorded, read_all, recording_files
from robot_stack.contract import frames, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2, planar_pose
from robot_stack.film.captions import caption
from robot_stack.film.frames import WHEELCHAIR
from robot_stack.film.tracks import Story, Track, carried

# These topics are sampled at the film's needs; all messages of the others are used.
_OFTEN = (topics.SIM_BODIES, topics.CURRENT_POSE, topics.JOINT_STATES, topics.OBSTACLES)
_MOST_OBSTACLES = 400
_OBSTACLES_HZ = 2.0
_AHEAD = Pose2(1.0, 0.0, 0.0)  # default wheelchair pose if the recording has no dock


def read_story(path: Path, sample_hz: float, progress: Callable[[int, int], None]) -> tuple[Story, list[str]]:
    """(the ride, errors of the files). progress: called with (bytes read, total bytes). Raises CommandError."""
    reader = _Reader(sample_hz)
    warnings: list[str] = []
    for item in read_all(recording_files(path), reader.topics, progress):
        if isinstance(item, str):
            warnings.append(item)
        else:
            reader.take(item)
    return reader.story(path), warnings


class _Reader:
    """Collects tracks from messages."""

    def __init__(self, sample_hz: float) -> None:
        self._take = {
            topics.SIM_BODIES.name: self._bodies,
            topics.CURRENT_POSE.name: self._pose,
            topics.JOINT_STATES.name: self._joint_states,
            topics.OBSTACLES.name: self._obstacle_points,
            topics.PASSENGER_ATTACHED.name: self._passenger,
            topics.PLAN.name: self._plan,
            topics.MISSION_STATUS.name: self._mission_status,
            topics.DOCKING_STATUS.name: self._docking_status,
        }
        self.topics = tuple(self._take)
        self._periods = {row.name: 1.0 / sample_hz for row in _OFTEN} | {topics.OBSTACLES.name: 1.0 / _OBSTACLES_HZ}
        self._due: dict[str, float] = {}
        self._tracks: dict[str, list[tuple[float, Pose2]]] = {}
        self._estimated: list[tuple[float, Pose2]] = []
        self._joints: list[tuple[float, dict[str, float]]] = []
        self._attached: list[tuple[float, bool]] = []
        self._plans: list[tuple[float, NDArray[np.float64]]] = []
        self._captions: list[tuple[float, str]] = []
        self._obstacles: list[tuple[float, NDArray[np.float64]]] = []
        self._mission: Any = None
        self._docking = ""

    def take(self, item: Recorded) -> None:
        if item.at_s < self._due.get(item.topic, 0.0):
            return
        self._due[item.topic] = item.at_s + self._periods.get(item.topic, 0.0)
        self._take[item.topic](item.at_s, item.decode())

    def story(self, path: Path) -> Story:
        """Raises CommandError if the recording lacks the robot's pose."""
        truth = self._tracks.pop(frames.BASE_LINK, [])
        robot = truth or self._estimated
        if len(robot) < 2:
            names = f"{topics.CURRENT_POSE.name} or {topics.SIM_BODIES.name}"
            raise CommandError(f"{path}: contains no ride: no message on {names}", WRONG_USE)
        track = Track(robot)
        others = {name: Track(samples) for name, samples in self._tracks.items()}
        if WHEELCHAIR not in others:
            chair = carried(track, self._attached, load_docks().latched_wheelchair() or _AHEAD)
            others |= {} if chair is None else {WHEELCHAIR: chair}
        times = np.array([time_s for time_s, _ in self._joints])
        angles = {name: np.array([item.get(name, 0.0) for _, item in self._joints]) for name in frames.JOINTS}
        return Story(
            robot=track,
            joints=(times, angles),
            attached=self._attached,
            others=others,
            plans=self._plans,
            captions=self._captions,
            obstacles=[] if truth else self._placed_obstacles(track),
        )

    def _bodies(self, at_s: float, message: Any) -> None:
        for item in message.transforms:
            pose = planar_pose(item.transform.translation, item.transform.rotation)
            self._tracks.setdefault(item.child_frame_id, []).append((at_s, pose))

    def _pose(self, at_s: float, message: Any) -> None:
        self._estimated.append((at_s, planar_pose(message.pose.position, message.pose.orientation)))

    def _joint_states(self, at_s: float, message: Any) -> None:
        self._joints.append((at_s, dict(zip(message.name, message.position, strict=False))))

    def _passenger(self, at_s: float, message: Any) -> None:
        self._attached.append((at_s, bool(message.data)))

    def _plan(self, at_s: float, message: Any) -> None:
        points = [(item.pose.position.x, item.pose.position.y) for item in message.poses]
        self._plans.append((at_s, np.array(points, dtype=np.float64).reshape(-1, 2)))

    def _mission_status(self, at_s: float, message: Any) -> None:
        self._mission = message
        self._say(at_s)

    def _docking_status(self, at_s: float, message: Any) -> None:
        if message.state != self._docking:
            self._docking = message.state
            self._say(at_s)

    def _say(self, at_s: float) -> None:
        if self._mission is None:
            return
        attached = bool(self._mission.passenger_attached)
        text = caption(self._mission.state, self._mission.current_waypoint, self._docking, attached)
        if not self._captions or self._captions[-1][1] != text:
            self._captions.append((at_s, text))

    def _obstacle_points(self, at_s: float, message: Any) -> None:
        """Stores points in base_link; see ``_placed_obstacles``."""
        if message.header.frame_id != frames.BASE_LINK:
            return
        offsets = {field.name: field.offset for field in message.fields}
        data = np.frombuffer(bytes(message.data), np.uint8).reshape(-1, message.point_step)
        xy = [data[:, offsets[name] : offsets[name] + 4].copy().view("<f4")[:, 0] for name in ("x", "y")]
        points = np.stack(xy, axis=1).astype(np.float64)
        self._obstacles.append((at_s, points[:: -(-len(points) // _MOST_OBSTACLES) or 1]))

    def _placed_obstacles(self, track: Track) -> list[tuple[float, NDArray[np.float64]]]:
        """Transforms the points to map with the robot's pose."""
        placed = []
        for at_s, points in self._obstacles:
            pose = track.at(at_s)
            c, s = np.cos(pose.yaw), np.sin(pose.yaw)
            placed.append((at_s, points @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)))
        return placed
