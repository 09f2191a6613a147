"""Navigation keeps to the zones of the site."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.controller import NavigationController, Situation
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.goal import GoalCode
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.states import NavigationState
from robot_stack.navigation.world_model import WorldModel
from tests.unit.navigation.plant import ROBOT, Drive, params, request
from tests.unit.navigation.test_among_obstacles import Painter, Story, box, corridor, nothing, reached

Array = npt.NDArray[np.float64]


def zone(kind: ZoneType, x0: float, x1: float, y0: float, y1: float, speed_mps: float = np.inf) -> Zone:
    ring = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])
    return Zone(f"{kind.value} {x0:.0f}", kind, (ring,), speed_mps)


def outlines(story: Story) -> Array:
    """(n, 2) corners of the footprint at every pose of the ride, map."""
    edge = outline(story.footprint)
    c, s = np.cos([pose.yaw for pose in story.poses]), np.sin([pose.yaw for pose in story.poses])
    x = np.array([pose.x for pose in story.poses])[:, None] + c[:, None] * edge[:, 0] - s[:, None] * edge[:, 1]
    y = np.array([pose.y for pose in story.poses])[:, None] + s[:, None] * edge[:, 0] + c[:, None] * edge[:, 1]
    return np.column_stack((x.ravel(), y.ravel()))


@pytest.mark.parametrize(("chair", "seen"), [(False, nothing), (True, box(6.8, 7.4, 4.6, 5.4))])
def test_the_footprint_stays_outside_a_keepout_zone(chair: bool, seen: Painter) -> None:
    lawn = zone(ZoneType.KEEPOUT, 6.0, 8.0, 3.5, 6.5)
    story = Story(seen, corridor(), chair=chair, zones=(lawn,))
    assert story.go(Pose2(12.0, 5.0, 0.0)) == ""
    story.until(reached)
    edge = outlines(story)
    assert not lawn.contains(edge[:, 0], edge[:, 1]).any()


def test_a_goal_in_a_keepout_zone_is_refused() -> None:
    story = Story(nothing, corridor(), zones=(zone(ZoneType.KEEPOUT, 6.0, 8.0, 3.5, 6.5),))
    assert "keepout zone" in story.go(Pose2(7.0, 5.0, 0.0))
    end = story.controller.take_end()
    assert end is not None
    assert end.aborted
    assert end.code is GoalCode.GOAL_OCCUPIED
    assert "obstacle of the map" in story.go(Pose2(0.2, 5.0, 0.0))


def test_no_way_but_through_a_keepout_zone() -> None:
    story = Story(nothing, corridor(), zones=(zone(ZoneType.KEEPOUT, 6.0, 8.0, 0.0, 10.0),))
    story.go(Pose2(12.0, 5.0, 0.0))
    output = story.until(lambda output: output.state is NavigationState.IDLE, 60.0)
    assert not output.reached
    assert max(pose.x for pose in story.poses) < 6.0


def test_a_person_in_a_keepout_zone_is_tracked() -> None:
    """The zone is not an obstacle of the map that would explain what the costmap sees there."""

    def walker(now_s: float, x: Array, y: Array) -> npt.NDArray[np.bool_]:
        return np.hypot(x - 6.5, y - (2.0 + 0.8 * (now_s - 10.0))) < 0.25

    story = Story(walker, corridor(), zones=(zone(ZoneType.KEEPOUT, 6.0, 9.0, 1.0, 9.0),))
    story.look()
    question = story.controller.around.question(story.drive.pose, story.drive.pose, story.footprint)
    assert len(question.seen) == 0, "a zone leaves no memory of obstacles"
    for _ in range(40):
        story.tick()
    assert any(person.walks for person in story.controller.around.everybody)


@pytest.mark.parametrize("seen", [nothing, box(3.5, 4.2, 4.6, 5.4)])
def test_a_speed_zone_is_entered_at_its_speed(seen: Painter) -> None:
    ward = zone(ZoneType.SPEED, 7.0, 10.0, 0.0, 10.0, 0.4)
    story = Story(seen, corridor(), zones=(ward,))
    assert story.go(Pose2(14.0, 5.0, 0.0)) == ""
    story.until(reached)
    speeds = [(pose.x, output.twist.speed()) for pose, output in zip(story.poses, story.outputs, strict=True)]
    inside = [speed for x, speed in speeds if 7.0 <= x <= 10.0]
    assert max(inside) <= 0.4 + 0.02
    assert np.median(inside) == pytest.approx(0.95 * 0.4, abs=0.02), "it is used in full"
    assert max(speed for x, speed in speeds if x < 6.5) > 0.5
    assert max(speed for x, speed in speeds if x > 10.5) > 0.6


def test_of_many_speed_zones_those_near_the_poses_are_examined(monkeypatch: pytest.MonkeyPatch) -> None:
    squares = [np.array([(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 1.0), (x, 1.0), (x, 0.0)]) for x in range(1000)]
    zones = tuple(Zone(f"{i}", ZoneType.SPEED, (ring,), 0.1 + 0.001 * i) for i, ring in enumerate(squares))
    around = WorldModel(params(), None, zones)
    examined: list[str] = []
    contains = Zone.contains

    def counted(zone: Zone, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        examined.append(zone.name)
        return contains(zone, x, y)

    monkeypatch.setattr(Zone, "contains", counted)
    poses = np.array([(500.5, 0.5, 0.0), (501.5, 0.5, 0.0), (501.5, 1.5, 0.0)])
    assert around.zone_speed_mps(poses).tolist() == pytest.approx([0.6, 0.601, np.inf])
    assert examined == ["500", "501"]


def walker(x_m: float, y_m: float, speed_mps: float) -> Painter:
    return lambda now_s, x, y: np.hypot(x - x_m - speed_mps * (now_s - 10.0), y - y_m) < 0.25


def inside_keepout(seen: Painter, zones: tuple[Zone, ...], *, chair: bool, seconds: float) -> int:
    story = Story(seen, corridor(), chair=chair, zones=zones)
    story.go(Pose2(13.0, 5.0, 0.0))
    for _ in range(round(seconds / 0.05)):
        story.tick()
    assert max(pose.x for pose in story.poses) > 4.0
    edge = outlines(story)
    return sum(int(closed.contains(edge[:, 0], edge[:, 1]).sum()) for closed in zones)


@pytest.mark.parametrize(("chair", "seen"), [(False, box(7.2, 7.8, 4.0, 4.6)), (True, walker(13.0, 5.0, -0.7))])
def test_the_robot_avoids_what_it_sees_without_entering_a_keepout_zone(chair: bool, seen: Painter) -> None:
    """The costmap does not see the zones, so that a way around would lead through them."""
    lane = (zone(ZoneType.KEEPOUT, 4.0, 12.0, 5.9, 9.0), zone(ZoneType.KEEPOUT, 4.0, 12.0, 1.0, 4.1))
    assert inside_keepout(seen, lane, chair=chair, seconds=25.0) == 0


def appearing(now_s: float, x: Array, y: Array) -> npt.NDArray[np.bool_]:
    return box(7.2, 7.8, 4.0, 5.2)(now_s, x, y) & (now_s > 12.5)


@pytest.mark.parametrize(("seen", "from_y_m"), [(appearing, 5.3), (walker(13.0, 4.85, -0.7), 5.15)])
def test_a_robot_beside_its_route_keeps_to_a_zone_there(seen: Painter, from_y_m: float) -> None:
    """An obstacle, or a person to make room for, moves it into a zone that its route had passed by."""
    ward = zone(ZoneType.SPEED, 5.0, 11.0, from_y_m, 10.0, 0.15)
    story = Story(seen, corridor(), zones=(ward,))
    story.go(Pose2(13.0, 5.0, 0.0))
    for _ in range(round(11.0 / 0.05)):
        story.tick()
    x, y = (np.array([getattr(pose, axis) for pose in story.poses]) for axis in "xy")
    speeds = np.array([output.twist.speed() for output in story.outputs])[ward.contains(x, y)]
    assert len(speeds) > 10
    assert speeds.max() < 0.2


def test_zones_limit_the_motion_and_what_lies_ahead_of_it() -> None:
    ward = zone(ZoneType.SPEED, 7.0, 10.0, 0.0, 10.0, 0.4)
    around = Story(nothing, corridor(), zones=(ward,)).controller.around
    fast, slow = Twist2(1.2, 0.0, 0.0), Twist2(0.2, 0.0, 0.0)
    assert around.zone_limit_mps(Located(Pose2(8.0, 5.0, 0.0), fast, IDENTITY), fast, 0.5) == pytest.approx(0.4)
    ahead = around.zone_limit_mps(Located(Pose2(6.0, 5.0, 0.0), fast, IDENTITY), fast, 0.5)
    assert 0.4 < ahead < 1.2
    assert around.zone_limit_mps(Located(Pose2(6.0, 5.0, 0.0), slow, IDENTITY), slow, 0.5) == np.inf
    back = Located(Pose2(6.0, 5.0, np.pi), fast, IDENTITY)
    assert around.zone_limit_mps(back, fast, 0.5) == np.inf
    both = (zone(ZoneType.SPEED, 0.0, 9.0, 0.0, 9.0, 0.4), zone(ZoneType.SPEED, 5.0, 9.0, 0.0, 9.0, 0.6))
    slower = Story(nothing, corridor(), zones=both).controller.around
    assert slower.zone_speed_mps(np.array([(6.0, 5.0, 0.0), (9.5, 5.0, 0.0)])).tolist() == [0.4, np.inf]
    assert Story(nothing, corridor()).controller.around.zone_limit_mps(back, fast, 0.5) == np.inf


def test_zones_are_kept_without_a_costmap() -> None:
    ward = zone(ZoneType.SPEED, 7.0, 10.0, 0.0, 10.0, 0.4)
    departure = Departure(load(DepartureParams, "departure"), announced=True)
    controller = NavigationController(params(use_costmap=False), ROBOT, "map", departure, corridor(), zones=(ward,))
    drive, now_s, inside = Drive(ROBOT.motion(False), pose=Pose2(2.0, 5.0, 0.0)), 10.0, []
    controller.request(request(Pose2(14.0, 5.0, 0.0)), now_s, Located(drive.pose, drive.twist, IDENTITY))
    while drive.pose.x < 10.5 and now_s < 60.0:
        output = controller.tick(Situation(now_s, Located(drive.pose, drive.twist, IDENTITY)))
        for _ in range(5):
            drive.step(output.twist)
            now_s += 0.01
        if 7.0 <= drive.pose.x <= 10.0:
            inside.append(output.twist.speed())
    assert drive.pose.x >= 10.5
    assert max(inside) <= 0.4 + 0.02
