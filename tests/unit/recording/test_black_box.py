"""What the black box keeps, when a segment ends, and which events it deletes."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.contract.faults import FAULTS
from robot_stack.core.config import ConfigError, config_dir, load, read_yaml, validate
from robot_stack.recording.black_box import (
    EMERGENCY_STOP,
    NODE_RESTARTED,
    SAFETY_SILENT,
    Retention,
    Step,
    Stored,
    Timing,
    TriggerWatch,
    Window,
    to_delete,
)
from robot_stack.recording.params import BlackBoxParams

TIMING = Timing(before_s=60.0, after_s=10.0, segment_s=10.0, segment_bytes=1000, event_max_s=300.0)
DAY_S = 86_400.0


def watch(*ignored: str) -> TriggerWatch:
    """A watch that has seen a quiet status at 0 s."""
    made = TriggerWatch(ignored, silence_s=3.0, settle_s=60.0)
    assert made.on_status((), False, 0.0) == ()
    return made


# --- triggers --------------------------------------------------------------------------------------------------------


def test_each_fault_is_a_reason_once_until_it_is_gone() -> None:
    seen = watch()
    for fault in FAULTS:
        assert seen.on_status((fault.code,), False, 1.0) == (fault.code,)
        assert seen.on_status((fault.code,), False, 2.0) == ()
        assert seen.on_status((), False, 3.0) == ()
    assert seen.on_status(("LIDAR_TIMEOUT",), False, 4.0) == ("LIDAR_TIMEOUT",)
    assert seen.on_status(("CONTACT", "LIDAR_TIMEOUT", "TILT"), False, 4.1) == ("CONTACT", "TILT")


def test_ignored_faults_are_no_reason() -> None:
    seen = watch("OBSTACLE_NEAR")
    assert seen.on_status(("OBSTACLE_NEAR",), False, 1.0) == ()
    assert seen.on_status(("COLLISION_IMMINENT", "OBSTACLE_NEAR"), False, 1.1) == ("COLLISION_IMMINENT",)


def test_an_emergency_stop_is_a_reason_once_until_released() -> None:
    seen = watch()
    assert seen.on_emergency_stop(True) == (EMERGENCY_STOP,)
    assert seen.on_emergency_stop(True) == ()
    assert seen.on_status(("ESTOP_PRESSED",), True, 1.0) == ("ESTOP_PRESSED",)
    assert seen.on_emergency_stop(False) == ()
    assert seen.on_status((), True, 2.0) == (EMERGENCY_STOP,)


def test_a_silent_safety_monitor_is_a_reason_once() -> None:
    seen = watch()
    assert seen.check(3.0) == ()
    assert seen.check(3.1) == (SAFETY_SILENT,)
    assert seen.check(9.0) == ()
    assert seen.on_status((), False, 10.0) == ()
    assert seen.check(13.1) == (SAFETY_SILENT,)


def test_a_restarted_node_is_a_reason() -> None:
    seen = watch()
    assert seen.on_nodes({"a": 1, "b": 2}) == ()
    assert seen.on_nodes({"a": 1, "b": 2, "c": 3}) == (), "another node is no restart"
    assert seen.on_nodes({"a": 1, "b": 4, "c": 3}) == (NODE_RESTARTED,)
    assert seen.on_nodes({"a": 1, "b": 4, "c": 3}) == ()
    assert seen.on_nodes({"recorder": 5}) == seen.on_nodes({"recorder": 6}) == (), "a person starts it again"


def test_a_node_restarted_during_start_up_is_no_reason() -> None:
    seen = TriggerWatch((), silence_s=3.0, settle_s=60.0)
    seen.on_nodes({"a": 1})
    assert seen.on_nodes({"a": 2}) == ()
    seen.on_status((), False, 0.0)
    assert seen.on_nodes({"a": 2}) == ()


def test_a_start_up_is_no_event() -> None:
    seen = TriggerWatch((), silence_s=3.0, settle_s=60.0)
    assert seen.check(100.0) == (), "nothing has arrived yet"
    assert seen.on_emergency_stop(True) == ()
    assert seen.on_status(("ESTOP_PRESSED", "LIDAR_TIMEOUT"), True, 100.0) == ()
    assert seen.on_status(("NODE_DEAD", "LIDAR_TIMEOUT"), False, 110.0) == (), "still starting"
    assert seen.on_status(("BATTERY_LOW",), False, 111.0) == (), "no stop: from here on faults count"
    assert seen.on_status(("BATTERY_LOW", "LIDAR_TIMEOUT"), False, 112.0) == ("LIDAR_TIMEOUT",)


def test_a_start_up_that_stays_stopped_counts_after_a_minute() -> None:
    seen = TriggerWatch((), silence_s=3.0, settle_s=60.0)
    assert seen.on_status(("ESTOP_PRESSED",), True, 0.0) == ()
    assert seen.on_status(("ESTOP_PRESSED",), True, 60.0) == ()
    assert seen.on_status(("CONTACT", "ESTOP_PRESSED"), True, 60.1) == ("CONTACT",)


def test_an_unknown_code_counts_as_a_stop() -> None:
    seen = TriggerWatch((), silence_s=3.0, settle_s=60.0)
    assert seen.on_status(("FROM_THE_FUTURE",), False, 0.0) == ()
    assert seen.on_status(("FROM_THE_FUTURE", "CONTACT"), False, 1.0) == (), "not armed"


# --- segments --------------------------------------------------------------------------------------------------------


class Disk:
    """The segments of a window with their times, and the segments that each event has been given."""

    def __init__(self, timing: Timing = TIMING) -> None:
        self.window = Window(timing)
        self.spans: dict[str, list[float]] = {}
        self.dropped: set[str] = set()
        self.events: list[list[str]] = []
        self.closed_events = 0
        self._open(0.0)

    def _open(self, now_s: float) -> None:
        name = f"s{len(self.spans)}"
        for span in self.spans.values():
            span[1] = min(span[1], now_s)
        self.spans[name] = [now_s, float("inf")]
        self.window.opened(name, now_s)
        if self.window.in_event and len(self.events) > self.closed_events:
            self.events[-1].append(name)

    def step(self, now_s: float, triggered: bool = False, size: int = 0) -> Step:
        step = self.window.step(now_s, size, triggered)
        if step.end:
            self.closed_events += 1
        if step.cut:
            self._open(now_s)
        if step.begin:
            self.events.append(list(self.window.segments))
        self.dropped.update(step.drop)
        return step

    def covers(self, event: int, begin_s: float, end_s: float) -> bool:
        """Whether the event's segments follow each other without a gap from begin_s to end_s."""
        spans = sorted(self.spans[name] for name in self.events[event])
        whole = all(before[1] == after[0] for before, after in pairwise(spans))
        return whole and spans[0][0] <= max(begin_s, 0.0) and spans[-1][1] >= end_s


def run(disk: Disk, until_s: float, triggers: frozenset[int] = frozenset(), step_s: float = 0.5) -> None:
    for tick in range(1, round(until_s / step_s) + 1):
        disk.step(tick * step_s, tick in triggers)


def test_segments_last_ten_seconds_or_to_their_size_and_a_minute_stays() -> None:
    disk = Disk()
    assert not disk.step(1.0, size=999).cut
    assert disk.step(1.5, size=1000).cut
    disk = Disk()
    run(disk, 200.0)
    kept = [disk.spans[name] for name in disk.window.segments]
    assert [end - begin for begin, end in kept[:-1]] == [10.0] * (len(kept) - 1)
    assert kept[0][0] <= 140.0
    assert kept[0][0] >= 200.0 - 60.0 - 2 * 10.0, "not much more than needed"
    assert disk.events == []


def test_an_event_keeps_a_minute_before_and_ten_seconds_after() -> None:
    disk = Disk()
    run(disk, 200.0, frozenset({300}))
    assert len(disk.events) == disk.closed_events == 1
    assert disk.covers(0, 150.0 - 60.0, 150.0 + 10.0)
    assert disk.spans[disk.events[0][-1]][1] == 160.0, "and nothing that comes later"


def test_an_endless_event_is_continued_by_another_one() -> None:
    disk = Disk()
    run(disk, 1000.0, frozenset(range(200, 1800)))
    assert len(disk.events) == 3
    assert disk.closed_events == 3
    for number, begin_s in enumerate((100.0, 400.0, 700.0)):
        assert disk.covers(number, begin_s - 60.0, min(begin_s + 300.0, 900.0))


def test_without_an_open_segment_there_is_nothing_to_cut() -> None:
    disk = Disk()
    disk.window.closed(5.0)
    assert not disk.step(20.0).cut
    assert disk.step(65.5).drop == ("s0",), "old segments give room nevertheless"


@given(st.sets(st.integers(1, 1200), max_size=12))
def test_every_trigger_lies_in_an_event_with_all_that_belongs_to_it(ticks: set[int]) -> None:
    disk = Disk()
    run(disk, 700.0, frozenset(ticks))
    assert disk.closed_events == len(disk.events)
    for tick in ticks:
        at_s = 0.5 * tick
        assert any(disk.covers(number, at_s - 60.0, at_s + 10.0) for number in range(len(disk.events)))


# --- retention -------------------------------------------------------------------------------------------------------


OLD_S = -30.0 * DAY_S


def stored(*ages_days: float, size: float = 1e9) -> list[Stored]:
    return [Stored(f"e{age:g}", 0, -age * DAY_S, round(size)) for age in ages_days]


def test_events_beyond_their_days_are_deleted() -> None:
    assert to_delete(stored(1, 29, 31, 40), OLD_S, 20.0, -1.0) == ("e40", "e31")


def test_beyond_the_gigabytes_the_oldest_are_deleted() -> None:
    assert to_delete(stored(1, 2, 3, 4, 5, size=5e9), OLD_S, 20.0, -1.0) == ("e5",)


def test_a_full_disk_takes_the_oldest_events_and_no_more_than_needed() -> None:
    assert to_delete(stored(3, 1, 2), OLD_S, 20.0, 1.5e9) == ("e3", "e2")
    assert to_delete(stored(3, 1, 2), OLD_S, 20.0, 0.0) == ()
    assert to_delete(stored(3, 1, 2), OLD_S, 20.0, 2e9) == ("e3", "e2")


def test_a_disk_that_others_have_filled_costs_no_events() -> None:
    assert to_delete(stored(3, 1, 2), OLD_S, 20.0, 2.1e9) == (), "the newest stays, and the others do not suffice"
    assert to_delete(stored(1), OLD_S, 20.0, 1.0) == ()
    assert to_delete(stored(1, 31), OLD_S, 20.0, 1e12) == ("e31",), "days count nevertheless"


def test_the_order_of_events_is_that_of_their_numbers() -> None:
    """The clock was 40 days ahead during e2, and a year behind during e3."""
    events = [Stored(f"e{n}", n, -age * DAY_S, 10**10) for n, age in ((3, 365), (2, -40), (1, 31))]
    assert to_delete(events, OLD_S, 50.0, -1.0) == ("e1",)
    assert to_delete(events, OLD_S, 20.0, -1.0) == ("e1",)
    assert to_delete(events, -math.inf, 10.0, -1.0) == ("e1", "e2")


def test_a_clock_counts_after_six_hours_without_a_step() -> None:
    hour_s = 3600.0
    retention = Retention(30.0)
    assert retention.before_s(100.0 * DAY_S, 0.0) == -math.inf
    assert retention.before_s(100.0 * DAY_S + 6.0 * hour_s + 30.0, 6.0 * hour_s) == 70.0 * DAY_S + 6.0 * hour_s + 30.0
    assert retention.before_s(140.0 * DAY_S, 6.5 * hour_s) == -math.inf
    assert retention.before_s(140.0 * DAY_S + 5.9 * hour_s, 12.4 * hour_s) == -math.inf
    assert retention.before_s(140.0 * DAY_S + 6.0 * hour_s, 12.5 * hour_s) == 110.0 * DAY_S + 6.0 * hour_s
    assert retention.before_s(100.0 * DAY_S, 13.0 * hour_s) == -math.inf


@given(st.lists(st.tuples(st.floats(0.0, 60.0), st.integers(0, 10**10)), max_size=8), st.floats(-1.0, 1e10))
def test_what_stays_is_young_fits_and_is_newer_than_what_goes(
    made: list[tuple[float, int]], missing_bytes: float
) -> None:
    events = [Stored(str(number), 0, -age * DAY_S, size) for number, (age, size) in enumerate(made)]
    gone = set(to_delete(events, OLD_S, 20.0, missing_bytes))
    left = [event for event in events if event.id not in gone]
    deleted = [event for event in events if event.id in gone]
    assert all(-event.at_s <= 30.0 * DAY_S for event in left)
    assert sum(event.bytes for event in left) <= 20e9
    spare = sorted(events, key=lambda event: (event.at_s, event.id))[:-1]
    if missing_bytes <= sum(event.bytes for event in spare):
        assert sum(event.bytes for event in deleted) >= missing_bytes
    assert all(old.at_s <= young.at_s for old in deleted for young in left)


# --- parameters ------------------------------------------------------------------------------------------------------


def test_the_shipped_parameters_keep_what_is_promised_and_no_images() -> None:
    params = load(BlackBoxParams, "black_box")
    assert (params.before_s, params.after_s) == (60.0, 10.0)
    assert params.flush_period_s <= 0.5
    assert params.max_disk_use < 0.95, "below DISK_FULL of the safety monitor"
    assert params.images == "never"
    assert params.image_block_px > 0, "with images chosen, they are blurred"


@pytest.mark.parametrize(
    ("name", "value"),
    [("ignored_faults", ["NOTHING"]), ("before_s", 0.0), ("retention_gb", 0.0), ("systems", ["robot", "wmx"])],
)
def test_parameters_out_of_range_are_refused(name: str, value: object) -> None:
    data = read_yaml(config_dir() / "black_box.yaml")
    with pytest.raises(ConfigError, match=name):
        validate(BlackBoxParams, {**data, name: value}, "black_box.yaml")
