"""Several rides in one map: placed by what their LiDAR saw, judged by their walls, named if they do not meet."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.cli.map_build import lines_of, recognition, wall_warnings
from robot_stack.core.robot import load_robot
from robot_stack.core.site_map import SiteMap
from robot_stack.mapping.build import build_map
from robot_stack.mapping.course import Course
from robot_stack.mapping.joining import joined
from robot_stack.mapping.pose_graph import Levels
from robot_stack.mapping.poses import planar
from robot_stack.mapping.report import drift, rides_of
from robot_stack.mapping.ride import RideError
from robot_stack.mapping.trajectory import Knowledge
from tests.unit.mapping import site

START = np.eye(4)
ANYWHERE = planar(40.0, -7.0, 2.0)
CUPBOARDS = [((-6.0, -4.0, 0.0), (-4.6, 1.0, 2.0)), ((-2.0, 4.0, 0.0), (2.5, 5.0, 2.0))]


@pytest.fixture(scope="module")
def built():
    """The second ride begins half a round later than the first, and ends where that one began.

    Without cupboards on two sides the room looks alike from both ends.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(site, "BOXES", [*site.BOXES, *CUPBOARDS])
        whole = site.recorded.__wrapped__()
    times = {"a": (0.0, 18.0), "b": (13.0, 31.0)}
    rides = {name: site.collected(site.part(whole, *between)) for name, between in times.items()}
    return build_map(rides, site.params(), load_robot(), site.START, recognition(), lambda *_: None)


def test_both_rides_are_in_place(built):
    truth = [site.true_pose(stamp - site.EPOCH_S) for stamp in built.course.stamps_s]
    apart = np.linalg.norm(built.course.poses[:, :2, 3] - [[pose.x, pose.y] for pose in truth], axis=1)
    assert set(built.course.ride) == {0, 1}
    assert apart.max() < 0.05


def test_how_the_rides_fit_is_reported(built):
    first, second = rides_of(built)
    assert first["recording"] == "a"
    assert second["recording"] == "b"
    assert second["loops_with_those_before"] >= 3
    assert second["walls_of_both"] >= 10
    assert second["walls_apart_rms_m"] < 0.02
    assert any(loop["from_ride"] == 1 and loop["to_ride"] == 2 for loop in drift(built)["loops"])
    about = {"rides": [first, second], "drift": drift(built)}
    assert f"ride 2: b, {second['sweeps']} sweeps, joined by" in "\n".join(
        lines_of(SiteMap("room", built.cells, built.grid, about))
    )


def test_rides_whose_walls_do_not_agree_are_doubted(built):
    settings = site.params().joining
    assert wall_warnings(built, settings) == []
    assert wall_warnings(built, settings.model_copy(update={"wall_warning_m": 1e-4}))[0].startswith("b: its walls are")


# --- without sweeps: the finder alone decides -------------------------------------------------------------------------


def straight(count: int = 12) -> Course:
    """A ride of a metre between two sweeps."""
    poses = np.array([planar(float(k), 0.0, 0.0) for k in range(count)])
    nothing = Knowledge((), Levels())
    return Course([np.zeros((0, 3))] * count, np.arange(count), np.zeros(count, int), poses, poses, nothing, poses)


def refused(*found) -> str:
    """Returns why a ride is refused whose k-th search finds the k-th of ``found``, and nothing later."""
    answers = iter(found)
    with pytest.raises(RideError) as error:
        joined(
            {"monday": straight(), "tuesday": straight()},
            START,
            site.params(),
            lambda cells: lambda points, up: next(answers, []),
            lambda *_: None,
        )
    return str(error.value)


def along(k: float, frame=ANYWHERE):
    """Returns where the ride's sweep ``k`` is in the map if its start is at ``frame``."""
    return frame @ planar(float(k), 0.0, 0.0)


def test_a_ride_in_which_nothing_is_recognised_is_named():
    why = refused()
    assert "not connected with monday: tuesday (0 of 12 places recognised" in why


def test_places_that_disagree_connect_nothing():
    assert "3 of 12 places recognised, 2 of them agree" in refused([along(0)], [along(1)], [along(9)])
    turned = [along(1) @ planar(0.0, 0.0, 0.5)]
    assert "3 of 12 places recognised, 2 of them agree" in refused([along(0)], turned, [along(2)])


def test_a_site_that_looks_alike_in_two_places_connects_nothing():
    other = planar(-5.0, 3.0, 0.0)
    why = refused(*[[along(k), along(k, other)] for k in range(4)])
    assert "4 places fit in one place, 4 in another" in why
    # A few wrong places among many right ones are no rival.
    why = refused(*[[along(k), along(k, other)] for k in range(2)], *[[along(k)] for k in range(2, 8)])
    assert "no loop fits" in why
