"""Doors of the site: the requests, when the robot may enter, and that it stops before the zone until then."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.contract.states import DoorMode, DoorPhase
from robot_stack.core.geometry import Pose2
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.controller import Output, Situation
from robot_stack.navigation.doors import DoorRequest, Doors, DoorState
from tests.unit.navigation.plant import ROBOT, params
from tests.unit.navigation.test_among_obstacles import Story, box, corridor, nothing, reached
from tests.unit.navigation.test_zones_in_navigation import outlines, zone

Array = npt.NDArray[np.float64]
STOP_M, ANSWER_S = params().door.stop_m, params().door.answer_s
HALL = Zone("hall", ZoneType.DOOR, zone(ZoneType.DOOR, 7.0, 9.0, 0.0, 10.0).rings, np.inf)
BEFORE, AT, BEHIND = Pose2(4.0, 5.0, 0.0), Pose2(8.0, 5.0, 0.0), Pose2(11.0, 5.0, 0.0)
OPEN, CLOSED, MOVING, OFFLINE = DoorMode.OPEN, DoorMode.CLOSED, DoorMode.MOVING, DoorMode.OFFLINE


class Approach:
    """The kernel alone: the robot at a pose on a straight route to x = 12."""

    def __init__(self) -> None:
        self.doors, self.now_s = Doors((HALL,), params().door), 100.0

    def tick(self, here: Pose2 = BEFORE, *, stands: bool = False, goal: bool = True) -> tuple[DoorRequest, ...]:
        self.now_s += 0.05
        x = np.arange(here.x, 12.0, 0.1) if goal else np.empty(0)
        ahead = np.column_stack((x, np.full(len(x), 5.0), np.zeros(len(x))))
        return self.doors.update(ahead, here, ROBOT.footprint, self.now_s, stands=stands)

    def run(self, seconds: float, here: Pose2 = BEFORE, *, stands: bool = False) -> list[DoorRequest]:
        return [item for _ in range(round(seconds / 0.05)) for item in self.tick(here, stands=stands)]

    def report(self, mode: int = OPEN, *, name: str = "hall", held: bool = True, age_s: float = 0.1) -> None:
        self.doors.on_state(DoorState(name, mode, held, self.now_s - age_s), self.now_s)

    def reports(self, seconds: float, *modes: int, **fields: object) -> None:
        """A report every 0.5 s, of the modes in turn."""
        for step in range(round(seconds / 0.5)):
            self.report(modes[step % len(modes)], **fields)  # type: ignore[arg-type]
            self.run(0.5)

    def closed(self) -> bool:
        return self.doors.closed_from(ROBOT.footprint, np.array([(8.0, 5.0, 0.0)])) == 0


def test_the_building_is_asked_again_and_again_and_released_once() -> None:
    approach = Approach()
    asked = approach.run(2.95)
    assert [(item.mode, item.phase) for item in asked] == [(OPEN, DoorPhase.APPROACHING)] * 3
    approach.reports(2.0, OPEN)
    inside = approach.run(2.0, AT)
    assert {(item.mode, item.phase) for item in inside} == {(OPEN, DoorPhase.PASSING)}
    assert len(inside) >= 2
    left = approach.run(3.0, BEHIND)
    assert left == [DoorRequest("hall", asked[0].passage, CLOSED, DoorPhase.LEFT)]
    assert approach.tick()[0].passage == asked[0].passage + 1


def test_a_goal_that_is_dropped_ends_the_session_except_in_the_door() -> None:
    approach = Approach()
    approach.run(1.0)
    assert [item.mode for item in approach.tick(goal=False)] == [CLOSED]
    approach.run(1.0, AT)
    assert all(item.mode == OPEN for _ in range(50) for item in approach.tick(AT, goal=False))


def test_a_door_that_is_reported_open_for_the_robot_lets_it_pass() -> None:
    approach = Approach()
    approach.run(0.5)
    approach.report()
    approach.run(0.9)
    assert approach.closed(), "one report does not show that the door stays open"
    approach.reports(1.5, OPEN)
    assert not approach.closed()
    approach.run(2.6)
    assert approach.closed(), "the reports have ended"


@pytest.mark.parametrize(
    ("modes", "fields"),
    [
        ((CLOSED,), {}),
        ((OFFLINE,), {}),
        ((77,), {}),
        ((OPEN, CLOSED), {}),
        ((OPEN, OPEN, OFFLINE), {}),
        ((OPEN,), {"held": False}),
        ((OPEN,), {"name": "lobby"}),
        ((OPEN,), {"age_s": 3.0}),
        ((OPEN,), {"age_s": -1.0}),
        ((OPEN,), {"age_s": math.nan}),
    ],
)
def test_stale_foreign_and_contradicting_reports_let_no_robot_pass(
    modes: tuple[int, ...], fields: dict[str, object]
) -> None:
    approach = Approach()
    for _ in range(8):
        approach.reports(0.5 * len(modes), *modes, **fields)
        assert approach.closed()


def test_a_step_of_the_clock_opens_no_door() -> None:
    approach = Approach()
    approach.reports(2.0, OPEN)
    approach.now_s -= 3600.0
    approach.run(0.1)
    assert approach.closed()


def test_the_robot_in_the_door_goes_on_if_it_closes_and_one_before_it_waits() -> None:
    approach = Approach()
    approach.reports(2.0, OPEN)
    approach.run(0.1, AT)
    approach.report(CLOSED)
    approach.run(0.5, AT)
    assert not approach.closed()
    approach.run(0.1, BEFORE)
    assert approach.closed(), "it has left the zone to where it came from"


def test_staff_are_asked_when_no_answer_comes_and_their_answer_counts_once() -> None:
    approach = Approach()
    here = Pose2(7.0 - ROBOT.footprint.front_m - STOP_M, 5.0, 0.0)
    assert "does not wait" in approach.doors.confirm("hall", approach.now_s)
    approach.run(1.0)
    assert approach.doors.text == ""
    approach.run(ANSWER_S - 0.1, here, stands=True)
    assert approach.doors.text == "waiting for door hall"
    asked = approach.run(0.2, here, stands=True)
    assert asked[-1].phase is DoorPhase.ASKING_STAFF
    assert "open it and confirm" in approach.doors.text
    assert "no door 'lobby'" in approach.doors.confirm("lobby", approach.now_s)
    assert approach.doors.confirm("hall", approach.now_s) == ""
    approach.run(5.0, here)
    assert not approach.closed()
    assert approach.doors.text == ""
    approach.run(1.0, AT)
    approach.run(1.0, BEHIND)
    approach.run(1.0)
    assert approach.closed(), "for one passage only"


def test_a_robot_that_is_moved_away_from_the_door_does_not_wait_for_it() -> None:
    approach = Approach()
    approach.run(1.0, Pose2(7.0 - ROBOT.footprint.front_m - STOP_M, 5.0, 0.0), stands=True)
    assert approach.doors.text == "waiting for door hall"
    approach.run(0.1, BEFORE, stands=True)
    assert approach.doors.text == ""


def test_a_report_that_the_door_is_shut_ends_the_answer_of_staff() -> None:
    approach = Approach()
    here = Pose2(7.0 - ROBOT.footprint.front_m - STOP_M, 5.0, 0.0)
    approach.run(1.0, here, stands=True)
    approach.report(CLOSED)
    assert "not open" in approach.doors.confirm("hall", approach.now_s)
    approach.run(3.0, here, stands=True)
    assert approach.doors.confirm("hall", approach.now_s) == ""
    approach.report(MOVING)
    approach.run(0.1, here, stands=True)
    assert approach.closed()


# --- in navigation ---------------------------------------------------------------------------------------------------


class Ride(Story):
    """In a corridor with a door at x 7 to 9 whose panel at x = 8 is an obstacle while it is closed."""

    def __init__(self, answers: Callable[[float], bool], *, panel: bool = True) -> None:
        def paint(now_s: float, x: Array, y: Array) -> npt.NDArray[np.bool_]:
            shut = panel and not answers(now_s)
            return box(7.9, 8.1, 0.0, 10.0)(now_s, x, y) if shut else nothing(now_s, x, y)

        super().__init__(paint, corridor(), zones=(HALL,))
        self.answers = answers
        self.requests: list[DoorRequest] = []

    def tick(self) -> Output:
        if round(self.now_s * 20) % 10 == 0 and self.requests:
            mode = OPEN if self.answers(self.now_s) else CLOSED
            self.controller.around.doors.on_state(DoorState("hall", mode, True, self.now_s), self.now_s)
        output = super().tick()
        self.requests += output.doors
        return output

    def entered(self) -> bool:
        edge = outlines(self)
        return bool(HALL.contains(edge[:, 0], edge[:, 1]).any())


@pytest.mark.parametrize("panel", [True, False])
def test_the_robot_waits_before_the_zone_until_the_door_is_open(panel: bool) -> None:
    opens_s = 25.0
    ride = Ride(lambda now_s: now_s > opens_s, panel=panel)
    assert ride.go(Pose2(13.0, 5.0, 0.0)) == ""
    ride.until(lambda _: ride.now_s > opens_s)
    assert not ride.entered()
    front_m = ride.drive.pose.x + ROBOT.footprint.front_m
    assert 7.0 - STOP_M - 0.3 < front_m < 7.0 - 0.6 * STOP_M
    assert ride.outputs[-1].text == "waiting for door hall"
    ride.until(reached)
    assert ride.requests[-1].mode == CLOSED


def test_an_unknown_pose_neither_ends_the_session_nor_opens_the_door() -> None:
    ride = Ride(lambda _: True)
    ride.go(Pose2(13.0, 5.0, 0.0))
    ride.until(lambda _: len(ride.requests) > 0)
    for located in (None, None, ride.located()):
        output = ride.controller.tick(Situation(ride.now_s, located))
        assert all(request.mode == OPEN for request in output.doors)
    assert ride.controller.around.doors.closed_from(ROBOT.footprint, np.array([(8.0, 5.0, 0.0)])) == 0


def test_a_door_that_is_open_in_time_costs_no_stop() -> None:
    ride = Ride(lambda _: True)
    ride.go(Pose2(13.0, 5.0, 0.0))
    ride.until(reached)
    passing = [out.twist.speed() for pose, out in zip(ride.poses, ride.outputs, strict=True) if 3.5 < pose.x < 11.0]
    assert min(passing) > 0.3
