"""Records of rides: from observations, from messages, and on the disk."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import pytest

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.rides import RideRecord, delete_rides, read_rides, why_standing, write_ride
from robot_stack.recording.nodes.ride_log import RideLog
from robot_stack.recording.ride_messages import RideMessages
from robot_stack.recording.rides import Observation, RideWatch

_STEP_S = 0.2
_RIDING = Observation(
    id="", at_s=0.0, time_s=0.0, mission_id="tour", mission_name="Tour", state="RUNNING", waypoint="gate", x=0.0, y=0.0,
    speed_mps=1.0, allowed_mps=1.5, battery=0.8,
)  # fmt: skip


class Day:
    """Observations in steps of 0.2 s: the robot moves along x at its speed."""

    def __init__(self) -> None:
        self.watch, self.time_s, self.x = RideWatch((1.4, 0.0, 0.5)), 100.0, 0.0
        self.records: list[RideRecord] = []

    def run(self, duration_s: float, seen: Observation = _RIDING) -> None:
        for _ in range(round(duration_s / _STEP_S)):
            self.time_s += _STEP_S
            self.x += _STEP_S * (seen.speed_mps if math.isfinite(seen.speed_mps) else 0.0)
            at_s = 1e9 + self.time_s
            now = replace(seen, id=f"{at_s:.1f}", at_s=at_s, time_s=self.time_s, x=self.x if seen.x == 0.0 else seen.x)
            record = self.watch.step(now)
            self.records += [record] if record else []

    def last(self) -> RideRecord:
        assert self.records
        return self.records[-1]


def seen(**changes: Any) -> Observation:
    return replace(_RIDING, **changes)


def test_a_ride_from_start_to_end() -> None:
    day = Day()
    day.run(5.0, seen(state="IDLE", mission_id=""))
    assert not day.records
    day.run(10.0)
    day.run(0.2, seen(waypoint="", state="COMPLETED", battery=0.75))
    ride = day.last()
    assert (ride.mission_id, ride.mission_name, ride.state) == ("tour", "Tour", "COMPLETED")
    assert ride.id == f"{ride.began_s:.1f}" == "1000000105.2"
    assert ride.duration_s == pytest.approx(10.0)
    assert ride.distance_m == pytest.approx(10.0)
    assert (ride.carried_m, ride.top_speed_mps, ride.battery) == (0.0, 1.0, (0.8, 0.75))
    assert [(item.name, item.done_s) for item in ride.waypoints] == [("gate", 10.0)]
    assert [point.at_s for point in ride.path] == pytest.approx([float(second) for second in range(11)])
    count = len(day.records)
    day.run(30.0, seen(state="COMPLETED"))
    assert len(day.records) == count


def test_a_ride_under_way_is_written_at_its_begin_and_every_ten_seconds() -> None:
    day = Day()
    day.run(25.0)
    assert [record.duration_s for record in day.records] == pytest.approx([0.0, 10.0, 20.0])
    assert len({record.id for record in day.records}) == 1
    assert {record.state for record in day.records} == {"RUNNING"}


def test_the_comfort_counts_while_the_robot_drives_and_the_charge_where_it_changes() -> None:
    watch, record = RideWatch((1.2, 0.0, 0.5)), None
    for count in range(200):
        at_s = 0.2 * count
        drives = 10.0 <= at_s < 30.0
        seen = Observation(
            "ride", at_s, at_s, "tour", "Tour", "RUNNING", speed_mps=1.0 if drives else 0.0, battery=0.9 - 0.001 * at_s
        )
        record = watch.step(seen) or record
        for sample in range(20):
            now_s = at_s + 0.01 * sample
            up = math.sqrt(2.0) * math.sin(math.tau * 8.0 * now_s) * (1.0 if drives else 9.0)
            watch.add_motion(now_s, (0.0, 0.0, 9.81 + up), (0.0, 0.0, 0.0))
    record = watch.end()
    assert record.comfort.weighted_mps2[2] == pytest.approx(1.036, rel=0.02)
    assert 15.0 < record.comfort.duration_s < 20.5
    assert [item.charge for item in record.charges] == pytest.approx([0.9 - 0.005 * n for n in range(8)], abs=1e-3)


def test_a_clock_that_is_set_back_costs_nothing_of_a_ride() -> None:
    day = Day()
    day.run(12.0)
    day.time_s -= 3600.0
    day.run(15.0)
    day.run(0.2, seen(state="COMPLETED"))
    ride = day.last()
    assert [record.duration_s for record in day.records] == pytest.approx([0.0, 10.0, 20.0, 27.0], abs=0.3)
    assert ride.distance_m == pytest.approx(27.0, abs=0.5)
    assert ride.path[-1].at_s == pytest.approx(26.0, abs=1.0)


def test_a_stop_whose_reason_changes_all_night_stays_readable() -> None:
    day = Day()
    for number in range(300):
        day.run(0.2, seen(speed_mps=0.0, allowed_mps=0.0 if number % 2 else 1.0, limited_by=f"LIMIT_{number}"))
        day.run(0.2, seen(speed_mps=0.0, state="PAUSED", reason=f"{number}.2 m before the waypoint"))
    assert len(day.watch.end().stops[0].why) < 1000  # type: ignore[union-attr]
    day.run(0.4, seen(speed_mps=0.0, waypoint="gate"))
    for number in range(300):
        day.run(0.2, seen(speed_mps=0.0, state="PAUSED", reason=f"{number}.2 m before the waypoint"))
    assert len(day.watch.end().stops[0].why) < 1000  # type: ignore[union-attr]


def test_two_rides_of_one_second_are_two_records() -> None:
    messages = RideMessages()
    ids = [messages.observation(1_777_636_800.0 + part_s, 0.0).id for part_s in (0.0, 0.2, 0.9999)]
    assert ids == ["20260501-120000-000", "20260501-120000-200", "20260501-120000-999"]


def test_stops_have_place_and_reason() -> None:
    day = Day()
    day.run(5.0)
    day.run(1.0, seen(speed_mps=0.0))
    day.run(1.0)
    day.run(4.0, seen(speed_mps=0.0, allowed_mps=0.0, limited_by="OBSTACLE_STOP"))
    day.run(1.0)
    day.run(3.0, seen(speed_mps=0.01, state="WAITING", waypoint="gate", reason="waiting 3 s"))
    day.run(1.0)
    day.run(3.0, seen(speed_mps=0.0, state="PAUSED", reason="paused by command", x=math.nan))
    day.run(0.2, seen(speed_mps=0.0, state="ABORTED", reason="aborted by command", x=math.nan))
    stops = day.last().stops
    assert [stop.why for stop in stops] == [
        "stopped: OBSTACLE_STOP",
        "waiting 3 s",
        "paused by command; aborted by command",
    ]
    assert stops[0].begin_s == pytest.approx(7.0)
    assert stops[0].duration_s == pytest.approx(3.8)
    assert stops[0].x == pytest.approx(6.0)
    assert stops[2].x is None
    assert day.last().stood_s == pytest.approx(sum(stop.duration_s for stop in stops))


def test_the_path_shows_where_the_robot_came_to_rest() -> None:
    day = Day()
    day.run(2.6)
    day.run(4.0, seen(speed_mps=0.0))
    day.run(1.0)
    day.run(0.2, seen(state="COMPLETED"))
    speeds = [(point.at_s, point.speed_mps) for point in day.last().path]
    assert (2.6, 0.0) in speeds
    assert len([speed for _, speed in speeds if speed == 0.0]) == 1


def test_a_docking_has_the_error_before_the_latch_closes_and_the_wheelchair_its_way() -> None:
    day = Day()
    day.run(2.0)
    day.run(3.0, seen(speed_mps=0.0, docking="FINE_ALIGN", docking_error_m=0.0008, docking_error_rad=-0.001))
    day.run(1.0, seen(speed_mps=0.0, docking="DOCKED", docking_error_m=0.0001, docking_error_rad=0.0))
    day.run(2.0, seen(docking="DOCKED", attached=True))
    day.run(3.0, seen(speed_mps=0.0, docking="SERVOING", attached=True))
    day.run(1.0, seen(speed_mps=0.0, docking="DOCKED", attached=True))
    day.run(0.2, seen(state="FAILED", reason="no marker in sight"))
    (docking,) = day.last().dockings
    assert docking.error_m == pytest.approx(0.0008)
    assert docking.error_deg == pytest.approx(0.057, abs=1e-3)
    assert day.last().carried_m == pytest.approx(2.0)
    assert day.last().stops[0].why == "docking: FINE_ALIGN"
    assert (day.last().state, day.last().reason) == ("FAILED", "no marker in sight")


def test_a_silent_mission_manager_does_not_end_the_ride() -> None:
    day = Day()
    day.run(3.0)
    day.run(30.0, seen(state="", mission_id=""))
    day.run(3.0, seen(state="PAUSED"))
    day.run(0.2, seen(state="ABORTED"))
    assert len({record.id for record in day.records}) == 1
    # Of the silence one second counts: odometry was not followed in between.
    assert day.last().distance_m == pytest.approx(7.0, abs=0.3)


@pytest.mark.parametrize("after", [{"state": "IDLE", "mission_id": ""}, {"mission_id": "short_hop"}])
def test_a_ride_whose_end_was_not_seen_keeps_its_last_state(after: dict[str, str]) -> None:
    day = Day()
    day.run(3.0)
    day.run(0.2, seen(**after))
    assert (day.last().mission_id, day.last().state) == ("tour", "RUNNING")
    day.run(0.4, seen(**after))
    rides = {record.id for record in day.records}
    assert len(rides) == (2 if after["mission_id"] else 1)


def test_unknown_numbers_are_left_out() -> None:
    day = Day()
    day.run(3.0, seen(speed_mps=math.nan, x=math.nan, battery=math.nan))
    record = day.watch.end()
    assert (record.distance_m, record.path, record.stops, record.battery) == (0.0, (), (), (None, None))
    assert day.watch.end() is None


def test_a_clock_that_jumps_adds_no_distance() -> None:
    day = Day()
    day.run(2.0)
    before = day.watch.step(replace(_RIDING, time_s=day.time_s + 3600.0))
    assert before.distance_m == pytest.approx(2.8, abs=0.3)
    day.watch.step(replace(_RIDING, time_s=5.0))
    record = day.watch.end()
    assert record.distance_m == before.distance_m


@pytest.mark.parametrize(
    ("limits", "docking", "mission", "why"),
    [
        (["TILT", "TILT", ""], ["SEARCH"], [("RUNNING", "gate", "x")], "stopped: TILT"),
        ([""], [], [], "stopped: no reason given"),
        ([], ["IDLE", "SEARCH", "SERVOING"], [("RUNNING", "gate", "")], "docking: SEARCH -> SERVOING"),
        ([], ["DOCKED"], [("RUNNING", "gate", ""), ("WAITING", "gate", "")], "waiting at gate"),
        ([], [], [("RUNNING", "gate", "")], "running at gate"),
        ([], [], [], ""),
    ],
)
def test_why_standing(limits: list[str], docking: list[str], mission: list[tuple[str, str, str]], why: str) -> None:
    assert why_standing(limits, docking, mission) == why


def test_records_on_the_disk(tmp_path: Path) -> None:
    day = Day()
    day.run(12.0)
    folder = tmp_path / "rides"
    for record in day.records:
        write_ride(folder, record)
    (folder / "torn.json").write_text("{")
    began_s = day.last().began_s
    rides, damaged = read_rides(folder, began_s, began_s + 1.0)
    assert rides == [day.last()]
    assert damaged == [folder / "torn.json"]
    assert read_rides(folder, began_s + 1.0, began_s + 2.0)[0] == []
    os.utime(folder / "torn.json", (0.0, 0.0))
    delete_rides(folder, 1.0)
    assert [path.stem for path in folder.iterdir()] == [day.last().id]
    assert read_rides(tmp_path / "none", 0.0, 1.0) == ([], [])


class Node:
    """What ``RideLog`` needs of a node: clocks, and a worker that works at once."""

    system_at_s, steady_at_s = 1e9, 0.0

    def __init__(self) -> None:
        self.listened: dict[str, Any] = {}
        self.port = Message(system_s=lambda: self.system_at_s)

    def steady_s(self) -> float:
        return self.steady_at_s

    def listen(self, row: Topic, function: Any, **_: Any) -> None:
        self.listened[row.name] = function

    def every(self, _hz: float, function: Any) -> None:
        self.step = function

    def worker(self, _name: str) -> Any:
        return Message(submit=lambda job, done: done(job()))

    def log_throttled(self, problem: str) -> None:
        raise AssertionError(problem)


def test_a_clock_that_is_set_forward_deletes_no_rides(tmp_path: Path) -> None:
    node = Node()
    RideLog(node, tmp_path, 400.0)
    left = []
    for after_s, day in ((0.0, 0), (10.0, 500), (6 * 3600.0, 500)):
        node.steady_at_s += after_s
        node.system_at_s = 1e9 + 86_400.0 * day + node.steady_at_s
        if not left:
            (tmp_path / "ride.json").write_text("{}")
            os.utime(tmp_path / "ride.json", (1e9, 1e9))
        status = {"mission_id": str(after_s), "mission_name": "", "current_waypoint": "", "reason": ""}
        node.listened[topics.MISSION_STATUS.name](Message(state="RUNNING", passenger_attached=False, **status))
        node.step()
        left.append((tmp_path / "ride.json").exists())
    assert left == [True, True, False], "six hours later it counts"


def test_messages_become_observations_and_grow_stale() -> None:
    messages = RideMessages()
    assert messages.observation(0.0, 0.0).state == ""
    mission = Message(
        mission_id="tour",
        mission_name="Tour",
        state="RUNNING",
        current_waypoint="gate",
        reason="",
        passenger_attached=True,
    )
    messages.take(topics.MISSION_STATUS.name, mission, 10.0)
    position = Message(position=Message(x=1.0, y=2.0))
    messages.take(topics.ROBOT_STATUS.name, Message(pose=position, battery_percent=80.0), 10.0)
    linear = Message(linear=Message(x=0.3, y=-0.4))
    messages.take(topics.ODOM.name, Message(twist=Message(twist=linear)), 10.0)
    messages.take(topics.VELOCITY_LIMIT.name, Message(max_linear_velocity=0.5, reason="PASSENGER_ONBOARD"), 10.0)
    docking = Message(state="SEARCH", position_error=0.1, orientation_error=0.2)
    messages.take(topics.DOCKING_STATUS.name, docking, 10.0)
    assert messages.observation(1e9, 10.05) == Observation(
        "20010909-014640-000", 1e9, 10.05, "tour", "Tour", "RUNNING", "gate", "", True, 1.0, 2.0, 0.5, 0.5,
        "PASSENGER_ONBOARD", "SEARCH", 0.1, 0.2, 0.8,
    )  # fmt: skip
    later = messages.observation(1e9, 60.0)
    assert (later.state, later.docking, later.limited_by) == ("RUNNING", "", "")
    assert math.isnan(later.speed_mps)
    assert math.isnan(later.x)
