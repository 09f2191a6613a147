"""From the messages of a recording to a ride."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.robot import load_robot
from robot_stack.mapping.collector import Collector
from robot_stack.mapping.ride import driven
from tests.unit.mapping import site

RESTART_S = 15.0


def driven_with(silent_s: float, restarted: bool, growth: float) -> tuple[np.ndarray, Collector]:
    """The path by the wheels, with odometry that is silent from 15 s on. growth: of its variance, per second."""
    collector = Collector(site.params().sweeps, load_robot())
    end_s = RESTART_S + silent_s
    for time_s, points, pose in site.in_order(site.recorded()):
        if pose is None:
            collector.sweep(time_s, points)
            continue
        since_s = time_s
        if restarted and time_s >= end_s:
            pose, since_s = pose.relative_to(site.odometry_pose(end_s)), time_s - end_s
        if not RESTART_S <= time_s < end_s:
            collector.odometry(time_s, pose.x, pose.y, pose.yaw, growth * since_s)
    return driven(collector.finish()), collector


@pytest.mark.parametrize(("silent_s", "growth"), [(0.02, 0.0), (4.0, 0.01)])
def test_odometry_restart_is_no_motion(silent_s: float, growth: float) -> None:
    poses, collector = driven_with(silent_s, True, growth)
    assert collector.restarts_s == [pytest.approx(RESTART_S + silent_s, abs=0.03)]
    # Two places are 0.4 s apart at 0.8 m/s.
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() < 0.7


def test_lost_odometry_messages_are_no_restart() -> None:
    poses, collector = driven_with(4.0, False, 0.01)
    assert collector.restarts_s == []
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() > 2.0
