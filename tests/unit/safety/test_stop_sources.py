"""Sources of the emergency stop: a press ends only with a release from the same source."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.stop_presence import Presence, describe_presence, parse_presence
from robot_stack.safety.stop_sources import (
    MOST_SOURCES,
    UNKNOWN,
    Arrivals,
    Press,
    SourcePresence,
    SourceReport,
    StopSources,
)

EXPLAIN_S, DISCOVERY_S, STALE_S = 2.0, 8.0, 1.0
NO_AUTHOR = "a true on /emergency_stop whose source has not reported yet"


class Bench:
    """Up to two processes per name, which publish and report as ``StopSource`` does."""

    def __init__(self, presses: tuple[Press, ...] = ()) -> None:
        self.sources = StopSources(EXPLAIN_S, DISCOVERY_S, STALE_S, presses)
        self.now_s = 10.0
        self._presses: dict[tuple[str, int], int] = {}

    def after(self, seconds: float) -> Bench:
        self.now_s += seconds
        return self

    def says(self, name: str, pressed: bool, pid: int = 1, *, order: str = "message first") -> Bench:
        key = (name, pid)
        self._presses[key] = self._presses.get(key, 0) + pressed
        if order == "message first":
            self.sources.message(pressed, self.now_s)
        self.repeats(name, pressed, pid)
        if order == "report first":
            self.sources.message(pressed, self.now_s)
        return self

    def repeats(self, name: str, pressed: bool, pid: int = 1) -> Bench:
        self.sources.report(SourceReport(name, pid, self._presses.get((name, pid), 0), pressed), self.now_s)
        return self

    def nobody_says(self, pressed: bool) -> Bench:
        self.sources.message(pressed, self.now_s)
        return self

    @property
    def standing(self) -> str:
        return self.sources.standing(self.now_s)


@pytest.mark.parametrize("order", ["message first", "report first"])
def test_a_press_stands_until_its_own_release(order: str) -> None:
    bench = Bench().says("ui", True, order=order)
    assert bench.standing == "pressed by ui"
    assert bench.sources.presses == (Press("ui", 1),)
    assert bench.says("ui", False, order=order).standing == ""
    assert bench.after(2 * EXPLAIN_S).standing == ""


def test_release_of_another_source_ends_no_press() -> None:
    bench = Bench().says("a", True).says("b", True).says("b", False)
    assert bench.standing == "pressed by a"
    assert bench.nobody_says(False).standing == "pressed by a"
    assert bench.says("a", False).standing == ""


def test_a_press_needs_no_message_at_all() -> None:
    assert Bench().repeats("a", True).standing == "pressed by a"


def test_repeated_reports_change_no_press() -> None:
    bench = Bench().says("a", True)
    for _ in range(5):
        bench.after(0.2).repeats("a", True)
    assert bench.standing == "pressed by a"
    assert bench.nobody_says(True).standing == f"pressed by a; {NO_AUTHOR}"  # a repeated report explains no other true


def test_unexplained_true_is_unknown_and_cleared_by_name() -> None:
    bench = Bench().nobody_says(True).nobody_says(False)
    assert bench.standing == NO_AUTHOR
    assert bench.after(EXPLAIN_S).standing == NO_AUTHOR
    assert bench.after(0.01).standing == "pressed by unknown"
    assert bench.sources.presses == (Press(UNKNOWN, 0),)
    assert bench.says("a", True).says("a", False).nobody_says(False).standing == "pressed by unknown"
    assert bench.sources.clear("a", bench.now_s) == "'a' is not pressed; pressed: unknown"
    assert bench.sources.clear(UNKNOWN, bench.now_s) == ""
    assert bench.standing == ""
    assert bench.sources.clear(UNKNOWN, bench.now_s) == "'unknown' is not pressed; pressed: no source"


def test_overdue_unknown_press_is_clearable_at_once() -> None:
    bench = Bench().says("a", True).nobody_says(True).after(EXPLAIN_S + 0.01)
    assert bench.sources.clear("b", bench.now_s) == "'b' is not pressed; pressed: a, unknown"
    bench = Bench().nobody_says(True).after(EXPLAIN_S + 0.01)
    assert bench.sources.clear(UNKNOWN, bench.now_s) == ""


def test_an_explanation_may_come_late_but_in_time() -> None:
    bench = Bench().nobody_says(True).after(EXPLAIN_S)
    bench.sources.report(SourceReport("a", 1, 1, True), bench.now_s)
    assert bench.standing == "pressed by a"
    bench.sources.report(SourceReport("a", 1, 1, False), bench.now_s)
    assert bench.after(5.0).standing == ""


def test_report_without_its_true_explains_no_later_true() -> None:
    bench = Bench()
    bench.sources.report(SourceReport("a", 1, 1, True), bench.now_s)
    bench.sources.report(SourceReport("a", 1, 1, False), bench.now_s)
    bench.after(EXPLAIN_S + 0.01).nobody_says(True)
    assert bench.standing == NO_AUTHOR
    assert bench.after(EXPLAIN_S + 0.01).standing == "pressed by unknown"


def test_a_report_may_come_early_but_in_time() -> None:
    bench = Bench()
    bench.sources.report(SourceReport("a", 1, 1, True), bench.now_s)
    bench.sources.report(SourceReport("a", 1, 1, False), bench.now_s)
    assert bench.after(EXPLAIN_S).nobody_says(True).standing == ""


def test_each_true_needs_a_press_of_its_own() -> None:
    bench = Bench().says("a", True).nobody_says(True)
    bench.says("a", False).after(EXPLAIN_S + 0.01)
    assert bench.standing == "pressed by unknown"


def test_one_report_may_contain_several_presses() -> None:
    """The reports in between were lost."""
    bench = Bench().repeats("a", False).nobody_says(True).nobody_says(True)
    bench.sources.report(SourceReport("a", 1, 2, True), bench.now_s)
    assert bench.after(2 * EXPLAIN_S).standing == "pressed by a (gone)"


def test_of_a_process_from_before_only_the_retained_message_arrives() -> None:
    """The monitor has just started: three earlier presses explain only the message of the one still in force."""
    bench = Bench().nobody_says(True).nobody_says(True)
    bench.sources.report(SourceReport("a", 7, 3, True), bench.now_s)
    assert bench.after(EXPLAIN_S + 0.01).standing == "pressed by a (gone), unknown"
    bench = Bench().nobody_says(True)
    bench.sources.report(SourceReport("a", 7, 3, False), bench.now_s)
    assert bench.after(EXPLAIN_S + 0.01).standing == "pressed by unknown"


@pytest.mark.parametrize("known_before", [True, False], ids=["restarted", "new"])
@pytest.mark.parametrize("waited_s", [0.1, EXPLAIN_S + 0.1, DISCOVERY_S - 0.1])
def test_the_first_report_of_a_process_that_came_after_the_monitor_explains_all_its_presses(
    known_before: bool, waited_s: float
) -> None:
    """Its report is discovered after its messages: the process may have pressed twice and released by then."""
    bench = Bench()
    if known_before:
        bench.repeats("a", False, pid=1)
    else:
        assert bench.standing == ""  # the monitor starts
        bench.after(DISCOVERY_S + 0.1)
    bench.nobody_says(True).nobody_says(True).nobody_says(False).after(waited_s)
    assert bench.standing == (NO_AUTHOR if waited_s < EXPLAIN_S else "pressed by unknown")
    bench.sources.report(SourceReport("a", 2, 2, False), bench.now_s)
    assert bench.standing == ""
    assert bench.sources.presses == ()
    assert bench.after(2 * DISCOVERY_S).standing == ""


def test_report_explains_only_its_own_recent_presses() -> None:
    bench = Bench().repeats("a", False, pid=1).nobody_says(True).nobody_says(True).nobody_says(True)
    bench.after(EXPLAIN_S + 0.1)
    bench.sources.report(SourceReport("a", 2, 2, True), bench.now_s)
    assert bench.standing == "pressed by unknown, a"
    bench = Bench().repeats("a", False, pid=1).nobody_says(True).after(DISCOVERY_S + 0.1)
    bench.sources.report(SourceReport("a", 2, 2, False), bench.now_s)
    assert bench.standing == "pressed by unknown"
    bench = Bench((Press(UNKNOWN, 0),)).repeats("a", False, pid=1).nobody_says(True).after(EXPLAIN_S + 0.1)
    bench.sources.report(SourceReport("a", 2, 2, False), bench.now_s)
    assert bench.standing == "pressed by unknown"  # the press is older than the restart


def test_an_unknown_that_was_cleared_can_be_explained_no_more() -> None:
    bench = Bench().repeats("a", False, pid=1).nobody_says(True).after(EXPLAIN_S + 0.1)
    assert bench.sources.clear(UNKNOWN, bench.now_s) == ""
    bench.nobody_says(True)
    bench.sources.report(SourceReport("a", 2, 1, False), bench.now_s)
    assert bench.after(EXPLAIN_S + 0.1).standing == ""
    bench = Bench((Press(UNKNOWN, 0),))
    assert bench.sources.clear(UNKNOWN, bench.now_s) == ""
    bench.nobody_says(True).after(EXPLAIN_S + 0.1)
    bench.sources.report(SourceReport("a", 2, 1, True), bench.now_s)
    assert bench.standing == "pressed by a"


def test_exactly_the_time_of_discovery_is_enough_and_exactly_so_long_is_not_after_the_monitor() -> None:
    bench = Bench().repeats("a", False, pid=1).nobody_says(True).after(DISCOVERY_S)
    bench.sources.report(SourceReport("a", 2, 1, False), bench.now_s)
    assert bench.standing == ""
    bench = Bench()
    assert bench.standing == ""
    bench.after(DISCOVERY_S).nobody_says(True)
    bench.sources.report(SourceReport("a", 2, 1, False), bench.now_s)
    assert bench.standing == NO_AUTHOR


def test_the_first_report_may_come_before_its_message() -> None:
    bench = Bench().repeats("a", False, pid=1)
    bench.sources.report(SourceReport("a", 2, 1, True), bench.now_s)
    assert bench.nobody_says(True).standing == "pressed by a"
    assert bench.after(EXPLAIN_S + 0.1).standing == "pressed by a (gone)"


def test_silent_source_stays_pressed_until_cleared_by_name() -> None:
    bench = Bench().says("ui", True)
    assert bench.sources.clear("ui", bench.now_s) == "ui is running and reports that it is pressed: release it there"
    assert bench.after(STALE_S).standing == "pressed by ui"
    assert bench.sources.clear("ui", bench.now_s) != ""
    assert bench.after(0.01).standing == "pressed by ui (gone)"
    assert bench.after(1e6).standing == "pressed by ui (gone)"
    assert bench.sources.clear("ui", bench.now_s) == ""
    assert bench.standing == ""


def test_presence_of_the_source_is_reported_with_each_press() -> None:
    bench = Bench().says("ui", True).says("panel", True).says("button", False).nobody_says(True).after(STALE_S)
    assert bench.sources.presence(bench.now_s) == {"ui": Presence.THERE, "panel": Presence.THERE}
    bench.repeats("ui", True).after(EXPLAIN_S).repeats("ui", True)
    wanted = {"ui": Presence.THERE, "panel": Presence.GONE, UNKNOWN: Presence.UNKNOWN}
    assert bench.sources.presence(bench.now_s) == wanted
    assert parse_presence({"rows": "IMU_TIMEOUT", **describe_presence(wanted)}) == wanted


def test_unknown_presence_value_is_not_clearable() -> None:
    described = describe_presence({"ui": Presence.GONE})
    assert parse_presence(dict.fromkeys(described, "?")) == {"ui": Presence.THERE}


def test_restarted_source_has_not_released() -> None:
    bench = Bench().says("ui", True).after(STALE_S + 0.01).repeats("ui", False, pid=2)
    assert bench.standing == "pressed by ui (gone)"
    assert bench.sources.clear("ui", bench.now_s) == ""


def test_restarted_source_releases_only_its_own_press() -> None:
    """Process A exits while pressed; process B of the same name presses and releases."""
    bench = Bench().says("ui", True).after(STALE_S + 0.01).says("ui", True, pid=2)
    assert bench.standing == "pressed by ui (gone), ui"
    assert bench.sources.presence(bench.now_s) == {"ui": Presence.GONE}
    assert bench.says("ui", False, pid=2).standing == "pressed by ui (gone)"
    assert bench.sources.clear("ui", bench.now_s) == ""
    assert bench.standing == ""


def test_two_processes_of_one_name_are_two_sources() -> None:
    bench = Bench().says("ui", True).says("ui", True, pid=2)
    assert bench.standing == "pressed by ui, ui"
    assert bench.sources.presence(bench.now_s) == {"ui": Presence.THERE}
    assert bench.says("ui", False, pid=1).standing == "pressed by ui"
    assert bench.sources.clear("ui", bench.now_s) == "ui is running and reports that it is pressed: release it there"
    assert bench.says("ui", False, pid=2).standing == ""


def test_clearing_a_name_affects_only_ended_processes() -> None:
    bench = Bench().says("ui", True).after(STALE_S + 0.01).says("ui", True, pid=2)
    assert bench.sources.clear("ui", bench.now_s) == ""
    assert bench.standing == "pressed by ui"


def test_a_process_that_has_the_number_of_one_before_is_another() -> None:
    """After a reboot the first processes get the same process ids again."""
    bench = Bench((Press("ui", 1, 100),))
    bench.sources.report(SourceReport("ui", 1, 0, False, 200), bench.now_s)
    assert bench.standing == "pressed by ui (gone)"
    bench.sources.report(SourceReport("ui", 1, 0, False, 100), bench.now_s)
    assert bench.standing == ""


@pytest.mark.timeout(20)
@pytest.mark.parametrize("known", [True, False])
def test_a_report_of_any_number_of_presses_takes_no_longer(known: bool) -> None:
    bench = Bench()
    if known:
        bench.repeats("a", False)
    for _ in range(100):
        bench.after(0.001)
        bench.sources.report(SourceReport("a", 1 + known, 1, True), bench.now_s)
        bench.sources.report(SourceReport("a", 1, 2**32 - 1, True), bench.now_s)
        bench.sources.report(SourceReport("a", 1, 0, True), bench.now_s)
        bench.nobody_says(True)
    assert "pressed by a" in bench.standing


def test_announced_presses_explain_as_many_trues_as_they_are() -> None:
    bench = Bench().repeats("a", False)
    bench.sources.report(SourceReport("a", 1, 2, True), bench.now_s)
    assert bench.nobody_says(True).nobody_says(True).standing == "pressed by a"
    assert bench.nobody_says(True).standing == f"pressed by a; {NO_AUTHOR}"


def test_sources_without_number_are_bounded_and_none_of_their_presses_is_lost() -> None:
    bench = Bench()
    for index in range(2 * MOST_SOURCES):
        bench.after(0.01).repeats(f"source {index}", True)
    assert len(bench.sources.presses) == MOST_SOURCES + 1
    assert bench.sources.presses[-1].name == UNKNOWN
    assert bench.sources.age_s("source 0", bench.now_s) == math.inf
    assert bench.sources.age_s(f"source {2 * MOST_SOURCES - 1}", bench.now_s) == 0.0
    for index in range(2 * MOST_SOURCES):
        bench.repeats(f"source {index}", False)
    assert bench.standing == "pressed by unknown"
    assert bench.sources.clear(UNKNOWN, bench.now_s) == ""


def test_lower_press_count_explains_no_press() -> None:
    bench = Bench().says("a", True).nobody_says(True)
    bench.sources.report(SourceReport("a", 1, 0, True), bench.now_s)
    assert bench.standing == f"pressed by a; {NO_AUTHOR}"


def test_presses_survive_a_restart() -> None:
    bench = Bench((Press("ui", 1), Press(UNKNOWN, 0)))
    assert bench.standing == "pressed by ui (gone), unknown"
    assert bench.repeats("ui", True).standing == "pressed by ui, unknown"
    assert bench.says("ui", False).standing == "pressed by unknown"


def test_age() -> None:
    bench = Bench()
    assert bench.sources.age_s("a", bench.now_s) == math.inf
    assert bench.repeats("a", False).after(0.5).sources.age_s("a", bench.now_s) == 0.5


@given(
    st.lists(
        st.tuples(st.sampled_from("abc"), st.booleans(), st.sampled_from(["message first", "report first"])),
        max_size=30,
    )
)
def test_pressed_sources_are_those_with_a_last_true_in_any_order(words: list[tuple[str, bool, str]]) -> None:
    bench = Bench()
    last: dict[str, bool] = {}
    for name, pressed, order in words:
        bench.after(0.05).says(name, pressed, order=order)
        last[name] = pressed
    assert {press.name for press in bench.sources.presses} == {name for name, pressed in last.items() if pressed}
    bench.after(2 * EXPLAIN_S)
    assert UNKNOWN not in bench.standing


def test_presence_is_evaluated_only_after_settling() -> None:
    presence = SourcePresence(silence_s=0.5, settle_s=1.0)
    assert presence.missing(math.inf, True, 0.0) is False
    assert not presence.missing(0.0, False, 1.0)  # still starting
    assert not presence.missing(0.0, True, 2.0)
    assert not presence.missing(0.0, True, 2.75)
    assert not presence.missing(0.6, True, 2.9)  # not yet settled
    assert not presence.missing(0.0, True, 3.0)
    assert not presence.missing(0.0, True, 3.5)
    assert not presence.missing(0.5, True, 4.0)  # just settled and just within the limit
    assert presence.missing(0.51, True, 4.1)
    assert presence.missing(math.inf, False, 4.2)
    assert not presence.missing(0.1, True, 4.3)


# --- what a report explains, at its limits ---------------------------------------------------------------------------


def test_no_arrival_is_none() -> None:
    arrivals = Arrivals()
    arrivals.add(1.0, 0)
    assert not arrivals


def test_a_report_explains_a_true_once() -> None:
    """The true that came before the report is no reason to expect another."""
    bench = Bench().repeats("a", False).says("a", True)
    assert bench.nobody_says(True).standing == f"pressed by a; {NO_AUTHOR}"


def test_a_new_process_explains_earlier_trues_once() -> None:
    """One has become unknown and one still waits: both are its own, and no third is expected."""
    bench = Bench().repeats("a", False).after(DISCOVERY_S + 0.1).nobody_says(True).after(EXPLAIN_S + 0.1)
    bench.repeats("a", False).nobody_says(True)
    assert bench.standing == f"pressed by unknown; {NO_AUTHOR}"
    bench.sources.report(SourceReport("b", 1, 2, True), bench.now_s)
    assert bench.standing == "pressed by b"
    assert bench.nobody_says(True).standing == f"pressed by b; {NO_AUTHOR}"


def test_as_many_sources_as_fit_are_all_present() -> None:
    bench = Bench()
    for index in range(MOST_SOURCES):
        bench.repeats(f"source {index:03}", True)
        bench.after(0.001)
    assert set(bench.sources.presence(bench.now_s).values()) == {Presence.THERE}
    assert bench.sources.age_s("source 000", bench.now_s) == pytest.approx(0.001 * MOST_SOURCES)


def test_the_sources_that_have_been_silent_longest_make_room() -> None:
    """They are neither the first nor the last by name."""
    bench, names = Bench(), [f"source {index:03}" for index in range(MOST_SOURCES + 2)]
    oldest = [names[9], names[3]]
    for name in (*oldest, *(name for name in names if name not in oldest)):
        bench.repeats(name, True)
        bench.after(0.001)
    found = bench.sources.presence(bench.now_s)
    assert {name for name, presence in found.items() if presence is Presence.GONE} == set(oldest)
