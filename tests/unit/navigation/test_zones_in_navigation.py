"""Navigation keeps to the zones of the site."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.goal import GoalCode
from robot_stack.navigation.states import NavigationState
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


@pytest.mark.parametrize("chair", [False, True])
@pytest.mark.parametrize("seen", [nothing, box(6.8, 7.4, 4.6, 5.4)])
def test_the_footprint_stays_outside_a_keepout_zone(chair: bool, seen: Painter) -> None:
    lawn = zone(ZoneType.KEEPOUT, 6.0, 8.0, 3.5, 6.5)
    story = Story(seen, corridor(), chair=chair, zones=(lawn,))
    assert story.go(Pose2(12.0, 5.0, 0.0)) == ""
    story.until(reached)
    edge = outlines(story)
    assert not lawn.contains(edge[:, 0], edge[:, 1]).any()
    without = Story(nothing, corridor(), chair=chair)
    without.go(Pose2(12.0, 5.0, 0.0))
    without.until(reached)
    edge = outlines(without)
    assert lawn.contains(edge[:, 0], edge[:, 1]).any(), "without the zone the way leads through it"


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
    assert max(speed for x, speed in speeds if 7.0 <= x <= 10.0) <= 0.4 + 0.02
    assert max(speed for x, speed in speeds if x < 6.5) > 0.5
    assert max(speed for x, speed in speeds if x > 10.5) > 0.6


def test_the_slower_of_two_zones_counts() -> None:
    zones = (zone(ZoneType.SPEED, 0.0, 9.0, 0.0, 9.0, 0.4), zone(ZoneType.SPEED, 5.0, 9.0, 0.0, 9.0, 0.6))
    story = Story(nothing, corridor(), zones=zones)
    poses = np.array([(6.0, 5.0, 0.0), (9.5, 5.0, 0.0)])
    assert story.controller.around.zone_speed_mps(poses).tolist() == [0.4, np.inf]
