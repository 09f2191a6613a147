"""The content of pages, and that only changes are sent."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.contract import topics
from robot_stack.contract.faults import FAULTS
from robot_stack.contract.states import DoorPhase
from robot_stack.core.geometry import Pose2
from robot_stack.ui import frames, view
from robot_stack.ui.audit import Entry, line, read
from robot_stack.ui.changes import Changes
from robot_stack.ui.diagnostics import Diagnostics
from robot_stack.ui.protocol import Layer
from robot_stack.ui.snapshot import Docking, Limit, Marker, Order, Queue, Ride, Safety, Snapshot

NORMAL = Safety("NORMAL", (), math.inf, pressed=False)
RIDE = Ride("RUNNING", "tour", "gate", 1, 4, 0.25, 62.0, False, "", "START_MISSION", True)
WELL = Snapshot(safety=NORMAL, ride=RIDE, limit=Limit(1.5, 1.0, ()), pose=Pose2(1.0, 2.0, 0.5), battery=0.8)
SILENT = Safety("DEGRADED", ("BATTERY_LOW", "LIDAR_TIMEOUT"), 1.0, pressed=False)
EMPTY = Safety("DEGRADED", ("BATTERY_CRITICAL",), 2.0, pressed=False)
HELD = Limit(0.0, 0.0, ("LIDAR_TIMEOUT", "BATTERY_LOW"))


@pytest.mark.parametrize(
    ("snapshot", "reasons"),
    [
        (Snapshot(), ["NO_SAFETY"]),
        (WELL, []),
        (replace(WELL, ride=None), ["NO_MISSION_MANAGER"]),
        (replace(WELL, ride=replace(RIDE, state="PAUSED")), ["PAUSED"]),
        (replace(WELL, ride=replace(RIDE, state="WAITING", waypoint="bench")), ["WAITING"]),
        (replace(WELL, ride=replace(RIDE, state="WAITING", waypoint="")), ["AWAITS_ROUTE"]),
        (replace(WELL, door=("hall", DoorPhase.WAITING)), ["DOOR"]),
        (replace(WELL, door=("hall", DoorPhase.ASKING_STAFF)), ["DOOR_UNANSWERED"]),
        (replace(WELL, safety=EMPTY), []),
        (replace(WELL, safety=EMPTY, ride=replace(RIDE, state="PAUSED")), ["BATTERY_CRITICAL", "PAUSED"]),
        (replace(WELL, ride=replace(RIDE, state="FAILED")), ["RIDE_FAILED"]),
        (replace(WELL, driven_by_hand=True), ["BY_HAND"]),
        (replace(WELL, emergency_stop=True), ["ESTOP_PRESSED"]),
        (replace(WELL, safety=Safety("EMERGENCY_STOP", ("TILT", "CPU_HIGH"), 1.0, False)), ["TILT"]),
        (replace(WELL, safety=SILENT, limit=HELD), ["LIDAR_TIMEOUT"]),
        (replace(WELL, safety=Safety("DEGRADED", ("BATTERY_LOW",), 1.0, False)), []),
        (replace(WELL, limit=Limit(0.0, 0.0, ("SOMETHING_NEW",))), ["STOPPED"]),
    ],
)  # fmt: skip
def test_why_the_robot_stands(snapshot: Snapshot, reasons: list[str]) -> None:
    assert view.standing_reasons(snapshot) == reasons


def test_every_stopping_fault_is_a_standing_reason() -> None:
    for fault in FAULTS:
        state = fault.state.name
        stopped = Snapshot(
            safety=Safety(state, (fault.code,), 1.0, False), limit=Limit(0.0, 0.0, (fault.code,)), ride=RIDE
        )
        assert view.standing_reasons(stopped) == [fault.code]


def test_sections_are_json_whatever_is_unknown() -> None:
    nan = math.nan
    for snapshot in (
        Snapshot(),
        WELL,
        replace(
            WELL,
            battery=nan,
            quality=nan,
            docking=Docking("SERVOING", nan, nan, 0, nan),
            ride=replace(RIDE, eta_s=nan, progress=nan, reason="x" * 999),
            pose=Pose2(nan, 0.0, 0.0),
            speed=(nan, nan),
            markers=(Marker(1, "front_camera", nan, nan, 0.0, 1.0),),
        ),
    ):
        reported = [view.sections(snapshot), view.plan_section(snapshot), view.marker_section(snapshot)]
        json.dumps(reported, allow_nan=False)


def test_orders_are_told_with_their_times_and_what_holds_them() -> None:
    waiting = Order("b", "tour", "fleet", 200, 1_700_000_000.4, True)
    queue = Queue("BATTERY_LOW", "queue held: " + "x" * 999, (waiting,), Order("a", "hop", "cli", 100, 0.0))
    reported = view.sections(replace(WELL, queue=queue))["queue"]
    assert (reported["known"], reported["held_by"], len(reported["reason"])) == (True, "BATTERY_LOW", 300)
    order = {"id": "b", "mission": "tour", "origin": "fleet", "priority": 200, "earliest_s": 1_700_000_000.0}
    assert reported["orders"] == [{**order, "open": True}]
    assert (reported["current"]["earliest_s"], reported["current"]["open"], reported["paused_by"]) == (None, False, "")
    assert view.sections(WELL)["queue"]["known"] is False


@pytest.mark.parametrize(("paused_by", "reason"), [("fleet", "PAUSED_BY_FLEET"), ("cli", "PAUSED"), ("", "PAUSED")])
def test_a_pause_of_the_fleet_says_so(paused_by: str, reason: str) -> None:
    queue = Queue("NOTHING", "", (), Order("a", "tour", "fleet", 100, 0.0, True), paused_by)
    paused = replace(WELL, ride=replace(RIDE, state="PAUSED"), queue=queue)
    assert view.standing_reasons(paused) == [reason]
    assert view.sections(paused)["queue"]["paused_by"] == paused_by


def test_time_of_arrival_comes_in_steps() -> None:
    def reported(eta_s: float) -> int | None:
        eta = view.sections(replace(WELL, ride=replace(RIDE, eta_s=eta_s)))["ride"]["eta_s"]
        return None if eta is None else int(eta)

    assert [reported(value) for value in (0.0, 1.0, 5.0, 59.0, 61.0, 3599.0)] == [0, 5, 5, 60, 75, 3600]
    assert reported(math.nan) is None
    assert reported(-1.0) is None


def test_a_long_plan_is_thinned_and_keeps_its_end() -> None:
    plan = tuple((0.1 * i, 0.0) for i in range(1234))
    points = view.plan_section(replace(WELL, plan=plan))["points"]
    assert len(points) <= 201
    assert points[0] == [0.0, 0.0]
    assert points[-1] == [123.3, 0.0]
    assert view.plan_section(WELL) == {"points": []}


def test_page_updates_are_limited_to_five_per_second() -> None:
    changes = Changes(5.0)
    assert changes.wait_s(0.0) == math.inf
    changes.offer({"a": 1, "b": 2})
    assert changes.take(0.0) == {"a": 1, "b": 2}
    changes.offer({"a": 1, "b": 3})
    assert changes.wait_s(0.05) == pytest.approx(0.15)
    assert changes.take(0.19) == {}
    changes.offer({"b": 4})
    assert changes.take(0.2) == {"b": 4}
    changes.offer({"b": 5})
    changes.offer({"b": 4})  # restored before the next update is sent
    assert changes.wait_s(9.0) == math.inf
    changes.forget("b")
    changes.offer({"b": 4})
    assert changes.take(9.0) == {"b": 4}
    changes.offer({"b": 5})
    assert changes.take(1.0) == {}  # the clock jumped backwards: sending resumes after one period
    assert 0.0 < changes.wait_s(1.0) <= 0.2


def test_costmap_frame() -> None:
    costs = np.array([[0, 100, -1], [1, 2, 3]], np.int8)
    frame = frames.costmap(costs, 0.05, Pose2(1.0, 2.0, 0.5))
    assert struct.unpack_from("<BBHHHffff", frame) == (
        frames.NUMBERS[Layer.COSTMAP], 0, 0, 3, 2, pytest.approx(0.05), 1.0, 2.0, 0.5,
    )  # fmt: skip
    assert list(frame[24:]) == [0, 100, frames.UNKNOWN, 1, 2, 3]


def test_obstacle_frame() -> None:
    points = np.array([[1.0, -2.0], [np.nan, 0.0], [1e6, -1e6]])
    frame = frames.obstacles(points, Pose2(1.0, 2.0, 0.5), 100)
    assert struct.unpack_from("<BBHfffI", frame) == (frames.NUMBERS[Layer.OBSTACLES], 0, 0, 1.0, 2.0, 0.5, 2)
    assert np.frombuffer(frame[20:], "<i2").tolist() == [100, -200, 32_767, -32_768]
    many = frames.obstacles(np.zeros((1001, 2)), Pose2(0.0, 0.0, 0.0), 500)
    assert struct.unpack_from("<I", many, 16)[0] <= 500
    assert frames.obstacles(np.zeros((0, 2)), Pose2(0.0, 0.0, 0.0), 500)[16:] == b"\0\0\0\0"


def test_image_frame() -> None:
    assert frames.image(Layer.REAR_IMAGE, b"jpeg") == bytes([frames.NUMBERS[Layer.REAR_IMAGE], 0, 0, 0]) + b"jpeg"
    assert len(set(frames.NUMBERS.values())) == 4


def test_rate_and_age_of_topic_come_from_freshest_subscriber() -> None:
    diagnostics = Diagnostics()
    rows = (topics.CURRENT_POSE, topics.ODOM, topics.TELEOP_CMD_VEL, topics.UI_COMMAND)
    pose = f"input {topics.CURRENT_POSE.name}"
    diagnostics.update("a", 0, "well", {pose: "received=9 rate_hz=9.9 age_s=0.30 fresh=True", "other": "1"}, 0.0)
    diagnostics.update("b", 1, "hm", {pose: "received=9 rate_hz=10.1 age_s=0.10 fresh=True"}, 0.0)
    odom = f"input {topics.ODOM.name}"
    teleop = f"input {topics.TELEOP_CMD_VEL.name}"
    nothing = "received=0 rate_hz=nan age_s=inf fresh=False"
    stale = "received=3 rate_hz=0.0 age_s={age_s} fresh=False"
    diagnostics.update("c", 7, "", {odom: nothing, teleop: stale.format(age_s=9.0)}, 0.0)
    section = diagnostics.section(rows, 1.0)
    assert [(item["state"], item["by"]) for item in section["topics"]] == [
        ("OK", "b"), ("SILENT", ""), ("OK", "c"), ("NONE", ""),
    ]  # fmt: skip
    assert [(item["name"], item["level"]) for item in section["nodes"]] == [("a", "OK"), ("b", "WARN"), ("c", "ERROR")]
    assert diagnostics.section(rows, 60.0)["nodes"] == []
    diagnostics.update("b", 2, "", {pose: stale.format(age_s=2.0)}, 60.0)
    assert diagnostics.section(rows, 60.0)["topics"][0]["state"] == "STALE"


@settings(max_examples=30)
@given(st.text(), st.text(), st.text())
def test_an_audit_line_is_one_line(who: str, what: str, outcome: str) -> None:
    entry = Entry("2025-06-15T12:00:00Z", who[:200], what[:200], outcome[:200])
    text = line(entry)
    assert len(text.splitlines()) == 1
    assert text.isascii()
    assert read(text, 10) == [entry]


def test_a_cut_audit_log_is_read_as_far_as_it_goes() -> None:
    entries = [Entry(str(i), "a", "b", "ok") for i in range(5)]
    text = "\n".join(line(entry) for entry in entries) + '\n{"at": "2025'
    assert read(text, 3) == entries[3:]
    assert read("[]\n1\n{}", 3) == []
