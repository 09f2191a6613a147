"""Which commands count as a lack of progress."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2
from robot_stack.navigation.progress_checker import ProgressChecker

_ALLOWANCE_S = 12.0
_FORWARD = Twist2(0.15, 0.0, 0.0)


def stalled_after_s(pose: Callable[[int], Pose2], command: Callable[[int], Twist2]) -> float:
    """Time of the first report in 60 s, by pose and command at each tick; infinite without one."""
    checker = ProgressChecker(_ALLOWANCE_S)
    return next((0.05 * i for i in range(1200) if checker.is_stalled(pose(i), command(i), 0.05)), math.inf)


@pytest.mark.parametrize("command", [_FORWARD, Twist2(0.0, -0.06, 0.0), Twist2(0.0, 0.0, 2.0)])
def test_a_robot_that_stays_where_it_is_commanded_away_is_stalled(command: Twist2) -> None:
    assert stalled_after_s(lambda _: IDENTITY, lambda _: command) == pytest.approx(_ALLOWANCE_S, abs=0.1)


@pytest.mark.parametrize(
    ("pose", "command"),
    [
        (lambda i: Pose2(0.001 * i, 0.0, 0.0), lambda _: Twist2(0.02, 0.0, 0.0)),
        (lambda i: Pose2(0.0, 0.0, 0.001 * i), lambda _: Twist2(0.0, 0.0, 0.02)),
        (lambda _: Pose2(math.nan, 0.0, 0.0), lambda _: _FORWARD),
        (lambda _: IDENTITY, lambda _: ZERO_TWIST),
        (lambda _: IDENTITY, lambda i: _FORWARD.scaled((-1.0) ** i)),
        (lambda _: IDENTITY, lambda i: _FORWARD if i % 20 == 0 else ZERO_TWIST),
    ],
    ids=["slow motion", "slow turn", "no pose", "waiting", "small motions to and fro", "short starts"],
)
def test_motion_and_waiting_are_no_lack_of_progress(
    pose: Callable[[int], Pose2], command: Callable[[int], Twist2]
) -> None:
    assert stalled_after_s(pose, command) == math.inf
