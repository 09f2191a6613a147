"""People: they walk along their paths, stop in front of machines, can be touched, and can be omitted."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from robot_stack.core.config import ConfigError, validate
from robot_stack.core.geometry import Pose2
from sim.plant.people import Walker, in_the_way
from sim.plant.world import Setup, World
from sim.worldfile import Person, WorldFile, load_world

from .bench import PARAMS, ROBOT
from .test_worlds import MINIMAL

FAR = Pose2(100.0, 0.0, 0.0)
ANNA = Person(name="anna", points_m=[(0.0, 0.0), (3.0, 0.0), (3.0, 4.0)], speed_mps=1.0, pause_s=2.0)


@pytest.mark.parametrize(
    ("time_s", "x", "y", "yaw"),
    [
        (0.0, 0.0, 0.0, 0.0),
        (5.0, 3.0, 2.0, 0.5 * math.pi),
        (7.0, 3.0, 4.0, 0.5 * math.pi),
        (8.9, 3.0, 4.0, 0.5 * math.pi),  # rests 2 s
        (10.0, 3.0, 3.0, -0.5 * math.pi),
        (17.0, 0.0, 0.0, math.pi),  # rests 2 s
        (19.0, 1.0, 0.0, 0.0),
    ],
)
def test_a_person_walks_to_and_fro_along_the_line(time_s: float, x: float, y: float, yaw: float) -> None:
    pose = Walker(ANNA).pose_after(time_s)
    assert (pose.x, pose.y) == pytest.approx((x, y), abs=1e-9)
    assert math.cos(pose.yaw - yaw) == pytest.approx(1.0)


def test_walker_stops_while_robot_is_close_ahead_and_resumes() -> None:
    walker = Walker(Person(name="a", points_m=[(0.0, 0.0), (9.0, 0.0)], speed_mps=1.0))
    robot = Pose2(4.0, 0.0, 0.5 * math.pi)  # across the path: its side is at x = 3.65
    for _ in range(600):
        walker.step(0.01, robot, ROBOT.footprint)
    # Radius 0.25 plus 0.6 of clearance to the side of the robot.
    assert walker.pose().x == pytest.approx(4.0 - 0.5 * ROBOT.footprint.width_m - 0.85, abs=0.02)
    for _ in range(300):
        walker.step(0.01, FAR, ROBOT.footprint)
    assert walker.pose().x == pytest.approx(5.8, abs=0.05)


def test_walker_turns_back_after_waiting() -> None:
    walker = Walker(Person(name="a", points_m=[(0.0, 0.0), (9.0, 0.0)], speed_mps=1.0, pause_s=2.0))
    robot = Pose2(4.0, 0.0, 0.5 * math.pi)
    for _ in range(690):  # 2.8 s of walking, 4 s of waiting
        walker.step(0.01, robot, ROBOT.footprint)
    stopped = walker.pose()
    assert math.cos(stopped.yaw) == pytest.approx(-1.0)
    for _ in range(100):
        walker.step(0.01, robot, ROBOT.footprint)
    assert walker.pose().x == pytest.approx(stopped.x - 1.0)
    for _ in range(400):  # returns to the start, rests there, and walks again
        walker.step(0.01, FAR, ROBOT.footprint)
    assert 0.1 < walker.pose().x < 0.5
    assert math.cos(walker.pose().yaw) == pytest.approx(1.0)


def test_robot_behind_or_beside_person_is_not_in_the_way() -> None:
    person = Pose2(0.0, 0.0, 0.0)
    assert in_the_way(person, Pose2(1.2, 0.0, 0.0), ROBOT.footprint)
    assert not in_the_way(person, Pose2(-1.2, 0.0, 0.0), ROBOT.footprint)
    assert not in_the_way(person, Pose2(0.0, 1.0, 0.0), ROBOT.footprint)
    assert not in_the_way(person, Pose2(1.5, 0.0, 0.0), ROBOT.footprint)
    # With the chair in front the outline reaches 1.4 m.
    assert in_the_way(person, Pose2(2.0, 0.0, math.pi), ROBOT.footprint_with_chair)
    assert in_the_way(person, Pose2(0.1, 0.0, 0.0), ROBOT.footprint), "inside the machine"


def test_people_are_bodies_that_move_and_can_be_left_out() -> None:
    file = load_world("yard")
    start = file.start.pose()
    quiet, busy = (World(ROBOT, PARAMS, Setup(file, 1, start, people=people)) for people in (False, True))
    for _ in range(1000):
        quiet.step()
        busy.step()
    names = {name for name, _ in busy.bodies()} - {name for name, _ in quiet.bodies()}
    assert names == {f"person_{person.name}" for person in file.people}
    for person in file.people:
        pose = dict(busy.bodies())[f"person_{person.name}"]
        wanted = Walker(person).pose_after(busy.time_s)
        assert pose[:2] == pytest.approx((wanted.x, wanted.y), abs=0.02)
        body = busy.model.body(f"person_{person.name}").id
        assert busy.data.xpos[body, :2] == pytest.approx(pose[:2], abs=0.02)
    assert np.allclose(quiet.truth().position_m, busy.truth().position_m, atol=1e-9), "far away they change nothing"


def test_world_reports_touched_objects() -> None:
    file = validate(
        WorldFile,
        {
            **MINIMAL,
            "people": [{"name": "bob", "points_m": [[0.55, 0.0]], "speed_mps": 1.0}],
            "walls": [{"name": "wall", "x_m": -0.55, "y_m": 0, "length_m": 0.2, "width_m": 2, "height_m": 1}],
            "pits": [{"name": "pit", "x_m": 0.3, "y_m": 0.25, "length_m": 0.3, "width_m": 0.2, "depth_m": 0.3}],
        },
        "test",
    )
    world = World(ROBOT, PARAMS, Setup(file, 1, Pose2(0.0, 0.0, 0.0), people=True))
    assert world.touching() == ("person_bob", "pit", "wall")
    world.step()
    assert set(world.touched) == {"person_bob", "pit", "wall"}
    free = World(ROBOT, PARAMS, Setup(load_world("flat"), 1, Pose2(0.0, 0.0, 0.0), wheelchair=True))
    free.attach_wheelchair(0.0)
    for _ in range(200):
        free.step()
    assert free.touching() == ()
    assert free.touched == {}, "ground, and robot and chair by each other, do not count"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"people": [{"name": "a", "points_m": [[0, 0], [0, 0]], "speed_mps": 1}]}, "two points that follow"),
        ({"people": [{"name": "A b", "points_m": [[0, 0]], "speed_mps": 1}]}, "people.0.name"),
        ({"people": [{"name": "a", "points_m": [[0, 0]], "speed_mps": 0}]}, "people.0.speed_mps"),
        ({"people": [{"name": "a", "points_m": [[0, 0]], "speed_mps": 1}] * 2}, "names used twice among a, a"),
        ({"surfaces": {"moon": 0.5}}, "no solid moon"),
        ({"pits": [{"name": "p", "x_m": 0, "y_m": 0, "length_m": 1, "width_m": 1, "depth_m": 0}]}, "pits.0.depth_m"),
    ],
)
def test_wrong_people_pits_and_surfaces_are_refused(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ConfigError, match=field):
        validate(WorldFile, {**MINIMAL, **change}, "test.yaml")


@pytest.mark.parametrize("walked_s", [0.0, 5.0, 9.5, 15.0])
def test_a_walk_is_resumed_where_and_how_it_was(walked_s: float) -> None:
    before, after = Walker(ANNA), Walker(ANNA)
    before.step(walked_s, FAR, ROBOT.footprint)
    after.resume_at(before.pose())
    for walker in (before, after):
        walker.step(1.0, FAR, ROBOT.footprint)
    assert after.pose().distance_to(before.pose()) < 0.06
    assert after.pose().yaw == pytest.approx(before.pose().yaw)
