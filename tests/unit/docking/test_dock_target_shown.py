"""The dock's frame in base_link, which the safety monitor excludes, is known only on the final approach."""

from __future__ import annotations

import math

from robot_stack.contract.states import SERVOED
from tests.unit.docking.bench import Bench


def test_only_while_the_robot_moves_into_the_dock() -> None:
    bench = Bench()
    shown = set()

    def docked() -> bool:
        pose = bench.controller.target(bench.situation().odom)
        if pose is not None:
            shown.add(bench.controller.state)
            assert bench.controller.tracker.estimate is not None
            assert math.hypot(pose.x, pose.y) < 3.0
            assert bench.controller.target(None) is None, "unknown without odometry"
        return not bench.controller.busy

    assert bench.controller.target(bench.situation().odom) is None
    bench.begin()
    bench.run(docked)
    assert shown == SERVOED
    assert bench.controller.target(bench.situation().odom) is None
