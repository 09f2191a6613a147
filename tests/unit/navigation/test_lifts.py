"""Rides in lifts: the way across levels, the session in the cabin, and its failures, all of which end in standstill."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from robot_stack.contract.states import DoorMode, DoorPhase
from robot_stack.core.config import ConfigError, load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.levels import Area, Levels, Lift, Stop
from robot_stack.core.limits import NO_LIMIT, SpeedLimit
from robot_stack.core.site_map import FREE, UNKNOWN, Grid
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.controller import NavigationController, Output
from robot_stack.navigation.doors import DoorRequest, Doors, DoorState
from robot_stack.navigation.lifts import Lifts
from robot_stack.navigation.states import NavigationState
from tests.unit.navigation.plant import ROBOT, Drive, Ride, params

OPEN, CLOSED, MOVING, OFFLINE = DoorMode.OPEN, DoorMode.CLOSED, DoorMode.MOVING, DoorMode.OFFLINE
RADIUS_M = 0.3
START, GOAL, BACK = Pose2(2.0, 5.0, 0.0), Pose2(10.0, 103.0, -math.pi / 2), Pose2(4.0, 5.0, 0.0)


def door(name: str, x0: float, x1: float, y0: float, y1: float) -> Zone:
    return Zone(name, ZoneType.DOOR, (np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]),), np.inf)


def area(y_m: float) -> Area:
    return Area(min_x_m=0.0, max_x_m=30.0, min_y_m=y_m, max_y_m=y_m + 20.0)


def stop(name: str, x: float, y: float, yaw: float = 0.0) -> Stop:
    return Stop(door=name, x_m=x, y_m=y, yaw_rad=yaw)


# The cabin is entered along x at level 0, and left along -y at level 1.
DOORS = (door("a 0", 7.0, 8.5, 3.0, 7.0), door("a 1", 8.0, 12.0, 107.0, 108.5))
A = Lift(radius_m=RADIUS_M, stops={"0": stop("a 0", 10.0, 5.0), "1": stop("a 1", 10.0, 110.0, math.pi / 2)})
SITE = Levels(levels={"0": area(0.0), "1": area(100.0)}, lifts={"a": A})
FLOOR = np.full((480, 120), UNKNOWN, np.int8)
FLOOR[:80] = FLOOR[400:] = FREE
GRID = Grid(0.25, 0.0, 0.0, FLOOR)
CABIN_0, CABIN_1 = A.stops["0"].pose, A.stops["1"].pose


class Story(Ride):
    """A robot, and a building with one lift, which needs 3 s to open a door and 5 s to the other level.

    modes: changes the reports, by door and true mode; None: no report.
    """

    def __init__(
        self, start: Pose2 = START, at: str = "a 0", modes: Callable[[str, DoorMode], DoorMode | None] | None = None
    ) -> None:
        self.modes = modes or (lambda _, mode: mode)
        self.at, self.held, self.since_s, self.open = at, "", 0.0, False
        self.requests: list[tuple[float, DoorRequest]] = []
        self.lost: Callable[[DoorRequest], bool] = lambda _: False
        self.relocates = True
        self.left_wrongly = False
        super().__init__(self._navigation(), Drive(ROBOT.empty, pose=start))

    @staticmethod
    def _navigation() -> NavigationController:
        announced = Departure(load(DepartureParams, "departure"), announced=True)
        site = {"grid": GRID, "zones": DOORS, "levels": SITE}
        return NavigationController(params(use_costmap=False), ROBOT, "map", announced, **site)  # type: ignore[arg-type]

    def restart(self) -> None:
        self.controller = self._navigation()
        self.held = ""

    def tick(self) -> Output:
        if round(self.now_s * 20) % 10 == 0:
            self._report()
        output = super().tick()
        for request in output.doors:
            self.requests.append((self.now_s, request))
            if not self.lost(request):
                if request.mode is OPEN:
                    self.held = request.name
                elif self.held == request.name:
                    self.held = ""
        if output.relocated is not None and self.relocates:
            self.drive.pose = output.relocated
        self._lift()
        zones = {zone.name: zone for zone in DOORS}
        name = "a 0" if self.drive.pose.y < 50.0 else "a 1"
        inside = zones[name].contains(np.array([self.drive.pose.x]), np.array([self.drive.pose.y]))[0]
        self.left_wrongly |= bool(inside) and not (self.at == name and self.open)
        return output

    def _lift(self) -> None:
        """A door that the robot does not hold closes; a lift with closed doors goes where it is wanted."""
        if self.held == self.at:
            self.open = self.open or self.now_s - self.since_s > 3.0
        elif self.open:
            self.open, self.since_s = False, self.now_s
        elif not self.held:
            self.since_s = self.now_s
        elif self.now_s - self.since_s > 5.0:
            self.at, self.since_s = self.held, self.now_s

    def _report(self) -> None:
        for zone in DOORS:
            mode = self.modes(zone.name, OPEN if self.open and self.at == zone.name else CLOSED)
            if mode is not None:
                held = self.held == zone.name
                self.controller.around.doors.on_state(DoorState(zone.name, mode, held, self.now_s), self.now_s)

    def until(self, done: Callable[[Output], bool], limit_s: float = 120.0) -> Output:
        end_s = self.now_s + limit_s
        while self.now_s < end_s:
            output = self.tick()
            if done(output):
                return output
        raise AssertionError(f"not in {limit_s} s: {self.outputs[-1]}, {self.drive.pose}")

    def stays(self, seconds: float, text: str) -> None:
        """It stands in the cabin of the ground level with the text, and reports no new pose."""
        before = len(self.outputs)
        self.run(seconds)
        for output in self.outputs[before:]:
            assert output.twist == ZERO_TWIST
            assert output.relocated is None
        assert text in self.outputs[-1].text
        assert self.drive.pose.distance_to(CABIN_0) < RADIUS_M

    def in_cabin(self, _: Output) -> bool:
        return self.drive.pose.distance_to(CABIN_0) < 0.05 and self.controller.state is NavigationState.HELD


# --- the way ---------------------------------------------------------------------------------------------------------


def test_the_way_to_another_level_leads_to_the_cabin_first() -> None:
    lifts = Lifts(SITE)
    stage = lifts.stage(START, GOAL)
    assert stage is not None
    assert (stage.goal, stage.door, stage.ride) == (CABIN_0, "a 0", None)
    assert stage.beyond_m == pytest.approx(CABIN_0.distance_to(CABIN_1) + CABIN_1.distance_to(GOAL))
    inside = lifts.stage(Pose2(10.2, 5.1, 0.1), GOAL)
    assert inside is not None
    assert inside.ride is not None
    assert (inside.ride.level, inside.ride.end.door) == ("1", "a 1")
    arrival = inside.ride.arrival(Pose2(10.2, 5.1, 0.1))
    assert (arrival.x, arrival.y, arrival.yaw) == pytest.approx((9.9, 110.2, math.pi / 2 + 0.1))


def test_on_its_own_level_and_beside_all_levels_a_goal_has_no_stages() -> None:
    for pose, goal in ((START, BACK), (CABIN_0, BACK), (START, Pose2(0.0, 60.0, 0.0)), (Pose2(0.0, 60.0, 0.0), GOAL)):
        stage = Lifts(SITE).stage(pose, goal)
        assert stage is not None
        assert (stage.goal, stage.door, stage.ride, stage.beyond_m) == (goal, "", None, 0.0)


def test_a_way_over_two_lifts_and_one_that_is_nearer() -> None:
    b = Lift(radius_m=0.3, stops={"1": stop("b 1", 20.0, 110.0), "2": stop("b 2", 20.0, 210.0)})
    far = Lift(radius_m=0.3, stops={"0": stop("c 0", 29.0, 5.0), "1": stop("c 1", 29.0, 105.0)})
    site = Levels(levels={**SITE.levels, "2": area(200.0), "3": area(300.0)}, lifts={"c": far, "b": b, "a": A})
    lifts = Lifts(site)
    first, second = lifts.stage(START, Pose2(5.0, 205.0, 0.0)), lifts.stage(CABIN_1, Pose2(5.0, 205.0, 0.0))
    assert first is not None
    assert second is not None
    assert (first.door, second.door) == ("a 0", "b 1")
    assert lifts.stage(START, Pose2(5.0, 305.0, 0.0)) is None
    near = lifts.stage(Pose2(27.0, 5.0, 0.0), Pose2(27.0, 105.0, 0.0))
    assert near is not None
    assert near.door == "c 0"


def test_a_lift_whose_door_is_no_zone_and_a_cabin_in_its_door_are_refused() -> None:
    with pytest.raises(ConfigError, match="a 1"):
        Doors(DOORS[:1], params().door, SITE.doors)
    announced = Departure(load(DepartureParams, "departure"), announced=True)
    wide = (door("a 0", 7.0, 9.6, 3.0, 7.0), DOORS[1])
    controller = NavigationController(params(use_costmap=False), ROBOT, "map", announced, zones=wide, levels=SITE)
    assert "not clear of door 'a 0'" in Ride(controller, Drive(ROBOT.empty, pose=START)).go(GOAL)


# --- the ride --------------------------------------------------------------------------------------------------------


def test_the_robot_rides_to_another_level_and_back() -> None:
    story = Story(at="a 1")
    assert story.go(GOAL) == ""
    story.until_reached()
    assert story.drive.pose.distance_to(GOAL) < 0.05
    assert not story.left_wrongly
    assert [output.relocated for output in story.outputs].count(None) == len(story.outputs) - 1
    assert story.go(START) == ""
    story.until_reached()
    assert story.drive.pose.distance_to(START) < 0.05
    assert not story.left_wrongly
    lengths = [request.mode for _, request in story.requests[-2:]]
    assert lengths[-1] is CLOSED


def test_the_cabin_has_a_session_from_the_call_to_the_exit() -> None:
    story = Story()
    story.go(GOAL)
    story.until_reached()
    held: set[str] = set()
    empty_s = []
    for time_s, request in story.requests:
        held = held | {request.name} if request.mode is OPEN else held - {request.name}
        if not held:
            empty_s.append(time_s)
    assert len(empty_s) == 1
    assert empty_s[0] == story.requests[-1][0]
    phases = [request.phase for _, request in story.requests if request.name == "a 1"]
    assert DoorPhase.WAITING in phases
    assert DoorPhase.ASKING_STAFF not in phases


def test_the_remaining_way_is_never_less_than_the_straight_line() -> None:
    story = Story()
    story.go(GOAL)
    for _ in range(2000):
        if story.tick().reached:
            return
        if story.controller.path is not None and story.controller.state is not NavigationState.IDLE:
            assert story.controller.remaining_m >= story.drive.pose.distance_to(GOAL) - 0.1
    raise AssertionError("the goal is not reached")


def test_a_goal_on_a_level_without_a_lift_is_refused() -> None:
    site = SITE.model_copy(update={"lifts": {}})
    announced = Departure(load(DepartureParams, "departure"), announced=True)
    controller = NavigationController(params(use_costmap=False), ROBOT, "map", announced, levels=site)
    story = Ride(controller, Drive(ROBOT.empty, pose=START))
    assert "no lift leads" in story.go(GOAL)
    story.pose_known = False
    assert story.go(GOAL) == ""
    story.pose_known = True
    story.run(0.2)
    assert story.controller.state is NavigationState.IDLE


# --- failures --------------------------------------------------------------------------------------------------------


def test_a_lift_that_never_comes_keeps_the_robot_before_it() -> None:
    story = Story(modes=lambda *_: CLOSED)
    story.go(GOAL)
    story.until(lambda output: output.text == "waiting for door a 0")
    story.run(5.0)
    assert story.drive.pose.x + ROBOT.footprint.front_m < 7.0


def test_staff_are_asked_later_about_a_lift_than_about_another_door() -> None:
    doors, ahead = Doors(DOORS, params().door, SITE.doors), np.array([(6.2, 5.0, 0.0), (6.9, 5.0, 0.0)])
    phases = {
        second: doors.update(ahead, Pose2(6.2, 5.0, 0.0), ROBOT.footprint, second, stands=True)[0].phase
        for second in np.arange(1.0, params().door.lift_answer_s + 3.0)
    }
    assert phases[params().door.lift_answer_s] is DoorPhase.WAITING
    assert phases[params().door.lift_answer_s + 2.0] is DoorPhase.ASKING_STAFF


@pytest.mark.parametrize(
    "mode",
    [
        lambda name, mode: CLOSED if name == "a 1" else mode,
        lambda name, mode: None if name == "a 1" else mode,
        lambda name, mode: OFFLINE if name == "a 1" else mode,
        lambda name, mode: OPEN,  # two open doors contradict each other
    ],
)
def test_a_cabin_that_is_not_reported_at_the_wanted_level_keeps_the_robot(
    mode: Callable[[str, DoorMode], DoorMode | None],
) -> None:
    story = Story()
    story.go(GOAL)
    story.until(story.in_cabin)
    story.modes = mode
    story.stays(60.0, "waiting for door a 1")


def test_lost_requests_are_repeated_in_the_cabin() -> None:
    story = Story()
    story.go(GOAL)
    story.until(story.in_cabin)
    story.lost = lambda request: story.now_s < lost_until_s
    lost_until_s = story.now_s + 20.0
    story.stays(19.0, "waiting for door a 1")
    story.until_reached()


def test_a_door_that_closes_before_the_robot_keeps_it_in_the_cabin() -> None:
    story = Story()
    story.go(GOAL)
    story.until(lambda output: output.relocated is not None)
    story.modes = lambda *_: CLOSED
    story.run(20.0)
    assert story.drive.pose.y - ROBOT.footprint.front_m > 108.5
    assert "waiting for door a 1" in story.outputs[-1].text
    story.modes = lambda _, mode: mode
    story.until_reached()
    assert not story.left_wrongly


@pytest.mark.parametrize(("goal", "wanted"), [(GOAL, "a 1"), (BACK, "a 0")])
@pytest.mark.parametrize("at", ["a 0", "a 1"])
def test_a_restart_in_the_cabin_leaves_it_only_at_the_level_of_the_map(goal: Pose2, wanted: str, at: str) -> None:
    story = Story()
    story.go(GOAL)
    story.until(story.in_cabin)
    story.restart()
    story.at, story.open, story.since_s = at, True, story.now_s
    story.run(2.0)
    assert story.go(goal) == ""
    story.until_reached()
    assert not story.left_wrongly
    assert {request.name for time_s, request in story.requests[-3:]} == {wanted}


def test_a_restart_in_the_door_of_a_lift_waits_for_a_report() -> None:
    story = Story(start=Pose2(8.8, 5.0, 0.0), modes=lambda *_: CLOSED)
    story.go(BACK)
    story.run(10.0)
    assert story.drive.pose.distance_to(Pose2(8.8, 5.0, 0.0)) < 0.01
    assert "waiting for door a 0" in story.outputs[-1].text
    story.modes = lambda _, mode: mode
    story.until_reached()


def test_a_pose_that_does_not_change_is_published_again_and_the_robot_stays() -> None:
    story = Story()
    story.relocates = False
    story.go(GOAL)
    story.until(lambda output: output.relocated is not None)
    begun_s = story.now_s
    story.run(10.0)
    assert "changes to level 1 in the map" in story.outputs[-1].text
    again = [output.relocated for output in story.outputs if output.relocated is not None]
    assert len(again) == 1 + int((story.now_s - begun_s) / params().door.relocation_s)
    assert story.drive.pose.distance_to(CABIN_0) < RADIUS_M


def test_a_pose_that_leaves_the_cabin_during_the_ride_ends_the_goal() -> None:
    story = Story()
    story.go(GOAL)
    story.until(story.in_cabin)
    story.run(1.0)
    story.drive.pose = Pose2(20.0, 5.0, 0.0)
    output = story.tick()
    assert output.end is not None
    assert output.end.aborted
    assert "has left the cabin of lift a" in output.end.text
    story.run(2.0)
    assert story.outputs[-1].twist == ZERO_TWIST


def test_the_ride_goes_on_while_motion_is_forbidden_but_not_in_an_emergency_stop() -> None:
    story = Story()
    story.go(GOAL)
    story.until(story.in_cabin)
    story.tick()
    story.controller.set_speed_limit(SpeedLimit(0.0, 0.0))
    story.until(lambda output: output.relocated is not None)
    story.controller.set_speed_limit(NO_LIMIT)
    story.until_reached()
    story.go(START)
    story.until(lambda _: story.controller.state is NavigationState.HELD and story.drive.pose.y > 109.0)
    story.emergency_stop = True
    output = story.tick()
    assert output.end is not None
    story.run(1.0)
    assert story.requests[-1][1].mode is CLOSED


def test_staff_send_the_cabin_by_its_buttons_and_confirm_its_door() -> None:
    story = Story(modes=lambda *_: None)
    story.go(GOAL)
    for name in ("a 0", "a 1"):
        story.until(lambda output, name=name: output.text == f"waiting for door {name}")
        assert "does not wait" in story.controller.around.doors.confirm("a 1" if name == "a 0" else "a 0", story.now_s)
        assert story.controller.around.doors.confirm(name, story.now_s) == ""
    story.until_reached()
    assert story.drive.pose.distance_to(GOAL) < 0.05


def test_an_unknown_pose_in_the_cabin_keeps_the_session() -> None:
    story = Story()
    story.go(GOAL)
    story.until(story.in_cabin)
    story.run(1.0)
    before = len(story.requests)
    story.pose_known = False
    story.run(3.0)
    later = [request for _, request in story.requests[before:]]
    assert len(later) >= 2
    assert {(request.name, request.mode) for request in later} == {("a 1", OPEN)}
