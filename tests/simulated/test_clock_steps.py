"""The system clock, and with it the ROS clock, is stepped during a mission and while the robot stands."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.kept_events import events_dir, read_events
from robot_stack.core.rides import read_rides, rides_dir
from tests.simulated.stage import Stage, staged

HOUR_S = 3600.0


def step_clock(stage: Stage, step_s: float) -> None:
    stage.stack.faults.inject("clock_step", "", step_s, 0.0)


def test_a_stepped_clock_neither_ends_a_mission_nor_moves_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mission takes 15 s without the steps, forward while the robot drives and back while it waits."""
    monkeypatch.setattr("robot_stack.recording.background.disk_use", lambda folder: 0.5)
    with staged(black_box=True) as stage:
        stage.run(2.0)
        stage.command("START_MISSION", "short_hop")
        stage.wait_faster(0.3, 20.0)
        begun_s = stage.now_s
        step_clock(stage, HOUR_S)
        stage.wait_mission("WAITING", 15.0)
        step_clock(stage, -2.0 * HOUR_S)
        stage.wait_mission("COMPLETED", 15.0)
        stage.run(1.0)
        assert {message.state for message in stage.mission.since(begun_s)} == {"RUNNING", "WAITING", "COMPLETED"}
        assert stage.safety_states(begun_s) == {"NORMAL"}
        assert read_events(events_dir()) == []
        (ride,), _ = read_rides(rides_dir(), -math.inf, math.inf)
        assert (ride.state, len(ride.waypoints)) == ("COMPLETED", 3)
        assert 12.0 < ride.duration_s < 25.0
        assert [point.at_s for point in ride.path] == sorted(point.at_s for point in ride.path)
        assert ride.path[-1].at_s <= ride.duration_s
        assert sum(stop.duration_s for stop in ride.stops) < 8.0

        step_clock(stage, HOUR_S)
        standing_s = stage.now_s
        stage.assert_wheels_rest(2.0)
        assert stage.safety_states(standing_s) == {"NORMAL"}
        stage.drive_at(0.3)
        stage.inject("edge_pressed", "rear")
        stage.wait_safety("EMERGENCY_STOP", "CONTACT", 1.0)
        stage.run(1.0)
        (event,) = read_events(events_dir())
        assert "CONTACT" in event.reasons
