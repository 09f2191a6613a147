"""The diff-drive controller on a motion engine with two wheels: its publishing rates."""

from __future__ import annotations

import pytest
from geometry_msgs.msg import Twist

from robot_stack.contract import topics
from robot_stack.middleware.conversions import time_to_s
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench


def test_speeds_and_odometry_come_100_times_a_second_with_the_time_of_the_engines_status(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(ENGINE_CONFIG_VARIABLE, "wmx_engine_diff_drive")
    speeds, odometry = bench.listen(topics.WMX_WHEEL_VELOCITIES), bench.listen(topics.WMX_ODOM_ENC)
    bench.engine.run()
    bench.start("diff_drive_controller")
    bench.repeat(topics.WMX_CMD_VEL, Twist, 20.0)
    speeds.wait()
    bench.run(3.0)
    for received in (speeds, odometry):
        assert received.period_s(100) == pytest.approx(0.01, abs=1e-4)
    age_s = bench.stamp_s() - time_to_s(odometry.last.header.stamp)
    assert 0.0 <= age_s <= 0.01 + 0.005 + COMPUTE_S + LATENCY_S + 1e-6
