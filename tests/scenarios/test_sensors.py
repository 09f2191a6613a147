"""A LiDAR that fails, a robot that is carried off, a place that is taken: the whole stack on the site and its map."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from robot_stack.core.geometry import Pose2
from tests.support.environment import stack_environment
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.site_stack import SiteUnderTest

pytestmark = pytest.mark.timeout(900)
START = Pose2(2.0, 0.0, 0.0)  # along the south way


@pytest.fixture(scope="module")
def module_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SiteUnderTest]:
    folder = tmp_path_factory.mktemp("site")
    with stack_environment(folder):
        from tests.support.site_stack import SiteUnderTest

        stack = SiteUnderTest(folder / "logs", START, wrong_by=Pose2(0.8, -0.6, math.radians(10.0)))
        yield stack
        stack.close()


@pytest.fixture
def site(module_site: SiteUnderTest) -> SiteUnderTest:
    module_site.make_ready()
    return module_site


def test_a_start_that_is_wrong_by_a_metre_is_put_right(site: SiteUnderTest) -> None:
    wait_for(lambda: site.estimate_error_m() < 0.05, "the pose by the map")
    assert site.quality.last.data > 0.5


def test_a_person_drives_at_a_wall_and_the_robot_stops_before_it(site: SiteUnderTest) -> None:
    site.place(Pose2(0.0, 2.0, math.pi))  # the depot's wall stands at x = -3.5
    site.drive(0.8)
    site.wait_safety("COLLISION_AVOIDANCE", "OBSTACLE_NEAR")
    site.wait_safety("COLLISION_AVOIDANCE", "COLLISION_IMMINENT")
    site.wait_stands(6.0)
    site.let_go()
    gap_m = site.at().x - 0.5 + 3.5
    assert 0.10 < gap_m < 0.6
    assert site.touched() == ""
    site.drive(-0.4)
    wait_for(lambda: site.speed_mps > 0.3, "the way back is free")


@pytest.mark.parametrize(("kind", "value"), [("silent", 0.0), ("frozen", 0.0), ("covered", 1.0)])
def test_a_lidar_that_does_not_see_stops_the_robot(site: SiteUnderTest, kind: str, value: float) -> None:
    site.place(START)
    site.drive_at(0.6)
    site.inject_lidar(kind, value)
    site.wait_safety("DEGRADED", "LIDAR_TIMEOUT")
    site.wait_stands(5.0)
    assert "OBSTACLES_TIMEOUT" in site.safety.last.active_faults
    site.let_go()
    site.inject_lidar("clear")
    site.wait_safety("NORMAL", deadline_s=60.0)


def test_a_robot_that_is_carried_off_stops_and_finds_itself(site: SiteUnderTest) -> None:
    site.place(START)
    site.drive_at(0.4)
    site.inject("robot_moved", "12,3,60")
    site.wait_safety("DEGRADED", "LOCALIZATION_LOST", deadline_s=60.0)
    site.wait_stands(5.0)
    site.let_go()
    site.wait_safety("NORMAL", deadline_s=60.0)
    assert site.estimate_error_m() < 0.10


def test_a_place_that_is_taken_is_not_driven_into(site: SiteUnderTest) -> None:
    """The wheelchair, which is in no map, stands where the robot is sent."""
    site.place(Pose2(0.0, 11.0, math.pi))
    chair = site.wheelchair()
    site.go(Pose2(chair.x, chair.y, math.pi))
    site.navigation.wait(lambda message: message.data.startswith("gave up"), "navigation gives up", 150.0)
    site.wait_stands()
    assert len(site.plan.last.poses) == 0
    assert site.at().distance_to(chair) > 0.9
    assert site.touched() == ""
