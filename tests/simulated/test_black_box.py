"""The black box of the whole robot: stops and faults are kept with what came before and after them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest
from rosbags.highlevel import AnyReader

from robot_stack.core.kept_events import EventRecord, EventState, events_dir, read_events
from robot_stack.core.rides import read_rides, rides_dir
from tests.simulated.shared import shareable, shared
from tests.simulated.stage import Stage, staged


@pytest.fixture(autouse=True)
def roomy_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk of the test machine may be nearly full."""
    monkeypatch.setattr("robot_stack.recording.background.disk_use", lambda folder: 0.5)


# Shorter than in config/black_box.yaml, where an event holds a minute.
BEFORE_S, AFTER_S = 5.0, 3.0
SETTINGS = (f"black_box.before_s={BEFORE_S}", f"black_box.after_s={AFTER_S}", "black_box.segment_s=2.0")


@shareable
@contextmanager
def recorded() -> Iterator[Stage]:
    with staged("flat", *SETTINGS, black_box=True) as stage:
        stage.run(2.0)
        assert events() == [], "a start-up is no event"
        yield stage


pytestmark = shared(recorded)


def events() -> list[EventRecord]:
    return read_events(events_dir())


def kept_event(stage: Stage) -> EventRecord:
    """The one event, complete."""
    stage.run(AFTER_S + 4.0)
    (event,) = events()
    assert event.state is EventState.COMPLETE
    return event


def times_s(event: EventRecord, topic: str) -> list[float]:
    """ROS times of a topic's messages in an event."""
    with AnyReader([events_dir() / event.id]) as reader:
        rows = [item for item in reader.connections if item.topic == topic]
        return [1e-9 * at_ns for _, at_ns, _ in reader.messages(connections=rows)]


def longest_gap_s(times: list[float]) -> float:
    return max(after - before for before, after in pairwise(times))


def test_a_contact_is_kept_with_its_past_and_future() -> None:
    with recorded() as stage:
        stage.drive_at(0.4)
        stage.run(BEFORE_S)
        stage.inject("edge_pressed", "rear")
        stage.wait_safety("EMERGENCY_STOP", "CONTACT", 1.0)
        stage.wait_stands(2.0)
        event = kept_event(stage)
        assert {"CONTACT", "EMERGENCY_STOP"} <= set(event.reasons)
        at_s = event.triggers[0].ros_s
        for topic in ("/safety/status", "/odom", "/swerve/wheel_commands"):
            times = times_s(event, topic)
            assert times[0] < at_s - BEFORE_S, topic
            assert times[-1] > at_s + AFTER_S - 0.5, topic
            assert longest_gap_s(times) < 0.3, topic
        sweeps = times_s(event, "/sensors/lidar/points")
        assert sweeps[0] < at_s - BEFORE_S + 1.0
        assert sweeps[-1] > at_s
        assert not times_s(event, "/sensors/camera/front/image_raw"), "images are left out"
        nodes = {node.name: node for node in event.nodes}
        assert {"safety_monitor", "swerve_controller", "navigation_controller", "black_box"} <= set(nodes)
        assert nodes["safety_monitor"].ready
        assert nodes["safety_monitor"].silent_s < 1.0
        assert event.map is None, "this world has no map"


def test_a_killed_safety_monitor_is_an_event() -> None:
    with recorded() as stage:
        stage.hang("safety_monitor", 5.0)
        stage.run(4.0)
        (event,) = events()
        assert event.reasons[0] in ("SAFETY_SILENT", "EMERGENCY_STOP")
        assert event.state is EventState.OPEN


def test_a_mission_leaves_a_record() -> None:
    with recorded() as stage:
        stage.command("START_MISSION", "short_hop")
        stage.wait_mission("RUNNING")
        stage.run(4.0)
        stage.command("ABORT")
        stage.wait_mission("ABORTED")
        stage.run(2.0)
        rides, damaged = read_rides(rides_dir(), 0.0, math.inf)
        assert not damaged
        (ride,) = rides
        assert (ride.mission_id, ride.state) == ("short_hop", "ABORTED")
        assert "aborted by command" in ride.reason
        assert 4.0 <= ride.duration_s < 6.0
        assert ride.battery[0] is not None
