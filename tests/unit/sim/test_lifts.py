"""The simulated building's lift: one open door, the oldest call first, and what rides in the cabin."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from robot_stack.contract.states import DoorMode
from robot_stack.core.geometry import Pose2
from sim.plant.doors import Building, Transfer
from sim.plant.interpolation import interpolate
from sim.plant.setup import Setup
from sim.plant.world import World
from sim.worldfile import Door, LiftCar, LiftStop, WorldFile, load_world
from tests.unit.sim.bench import PARAMS, ROBOT

STOPS = [LiftStop(door=f"lift_{level}", x_m=0.0, y_m=40.0 * level) for level in range(3)]
LIFT = LiftCar(name="lift", half_m=1.0, travel_s=2.0, stops=STOPS)


def doors() -> list[Door]:
    panel = {"length_m": 1.4, "width_m": 0.1, "height_m": 2.0, "travel_s": 0.5, "delay_s": 0.1}
    return [Door(name=stop.door, x_m=stop.x_m + 3.0, y_m=stop.y_m, yaw_deg=90.0, **panel) for stop in STOPS]


class Story:
    def __init__(self) -> None:
        self.building = Building(doors(), [LIFT])
        self.now_s = 0.0
        self.transfers: list[tuple[float, float]] = []
        self.most_open = 0

    def run(self, seconds: float, *wanted: str) -> dict[str, DoorMode]:
        for _ in range(round(seconds * 100)):
            self.now_s += 0.01
            for name in wanted:
                self.building.request(name, f"robot of {name}", True)
            arrived = self.building.step(self.now_s, 0.01)
            self.transfers += [(one.start.y_m, one.end.y_m) for one in arrived]
            modes = {report.name: report.mode for report in self.building.reports()}
            self.most_open = max(self.most_open, sum(mode is not DoorMode.CLOSED for mode in modes.values()))
        return modes


def test_the_cabin_goes_to_the_oldest_call_and_stays_while_it_lasts() -> None:
    story = Story()
    assert story.run(1.0, "lift_0")["lift_0"] is DoorMode.OPEN
    assert story.run(20.0, "lift_0", "lift_2")["lift_0"] is DoorMode.OPEN
    story.building.request("lift_0", "robot of lift_0", False)
    assert story.run(0.4, "lift_2", "lift_1")["lift_0"] is DoorMode.MOVING
    assert story.run(3.5, "lift_2", "lift_1")["lift_2"] is DoorMode.CLOSED
    assert story.run(2.0, "lift_2", "lift_1")["lift_2"] is DoorMode.OPEN
    assert story.transfers == [(0.0, 80.0)]
    story.run(20.0, "lift_1")
    assert story.transfers == [(0.0, 80.0), (80.0, 40.0)]
    assert story.most_open == 1


def test_a_lift_without_calls_stays_with_closed_doors() -> None:
    story = Story()
    assert set(story.run(20.0).values()) == {DoorMode.CLOSED}
    assert story.transfers == []


def test_what_is_in_the_cabin_rides() -> None:
    transfer = Transfer(STOPS[0], STOPS[1], LIFT.half_m)
    assert transfer.moves(0.9, -0.9)
    assert not transfer.moves(1.1, 0.0)
    assert not transfer.moves(0.0, 40.0)


def world(start: Pose2, *, attached: bool = False) -> World:
    file = load_world("flat").model_copy(update={"doors": doors(), "lifts": [LIFT]})
    chair = Pose2(3.0, 20.0, 0.0)
    return World(
        ROBOT, PARAMS, Setup(file, 1, start, wheelchair=True, wheelchair_pose=chair, attached_at_start=attached)
    )


@pytest.mark.parametrize("attached", [False, True])
def test_the_robot_rides_with_the_wheelchair_that_it_holds(attached: bool) -> None:
    sim = world(Pose2(0.0, 0.0, 0.0), attached=attached)
    for _ in range(100):
        sim.step()
    before, chair = sim.truth().pose(), sim.wheelchair_pose()
    sim.building.request("lift_1", "robot", True)
    for _ in range(3000):
        sim.step()
    after, there = sim.truth().pose(), sim.wheelchair_pose()
    assert chair is not None
    assert there is not None
    assert (after.x, after.y) == pytest.approx((before.x, before.y + 40.0), abs=0.02)
    assert there[1, 3] - chair[1, 3] == pytest.approx(40.0 if attached else 0.0, abs=0.02)
    assert np.abs(sim.data.qvel[:6]).max() < 0.05


def test_a_robot_beside_the_cabin_stays() -> None:
    sim = world(Pose2(2.0, 0.0, 0.0))
    sim.building.request("lift_1", "robot", True)
    for _ in range(3000):
        sim.step()
    assert sim.truth().pose().y == pytest.approx(0.0, abs=0.02)


def test_a_leap_of_a_body_is_not_interpolated() -> None:
    poses = np.stack([np.eye(4), np.eye(4)])
    poses[1, 1, 3] = 40.0
    place, turn = np.empty((3, 3)), np.empty((3, 3, 3))
    interpolate(np.array([0.0, 1.0]), poses, np.array([0.0, 0.5, 1.0]), np.eye(4), place, turn)
    assert place[:, 1].tolist() == [0.0, 0.0, 40.0]


@pytest.mark.parametrize("names", [["lift_0", "lift_0"], ["lift_0", "cellar"]])
def test_each_stop_of_a_lift_needs_a_door_of_its_own(names: list[str]) -> None:
    stops = [{"door": name, "x_m": 0.0, "y_m": 0.0} for name in names]
    content = load_world("flat").model_dump(exclude={"doors", "lifts"})
    lift = {"name": "lift", "half_m": 1.0, "travel_s": 2.0, "stops": stops}
    with pytest.raises(ValidationError, match="needs a door of its own"):
        WorldFile(**content, doors=[door.model_dump() for door in doors()], lifts=[lift])
