"""Stories of the link in fake time: a display that answers, is late, refuses, is silent, unplugged or reconnected."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.config import load
from robot_stack.ehmi import codec
from robot_stack.ehmi.codec import Decoder
from robot_stack.ehmi.link import Link, Shown
from robot_stack.ehmi.params import EhmiParams, LinkParams

PARAMS: LinkParams = load(EhmiParams, "ehmi_bridge").link
IDLE = Shown(1, "ja", 5)


class Story:
    """A link and a simulated display. ``received``: every line that the display received."""

    def __init__(self, shown: Shown = IDLE) -> None:
        self.link = Link(PARAMS, shown)
        self.now_s = 100.0
        self.received: list[str] = []
        self.sent_s: list[float] = []
        self.opens = self.closes = 0
        self.answering = True
        self.decoder = Decoder()

    def act(self) -> Story:
        """Executes the orders of the link until there are none."""
        for _ in range(50):
            order = self.link.step(self.now_s)
            self.closes += order.close
            self.opens += order.open
            lines = self.decoder.feed(order.data)
            self.received += lines
            self.sent_s += [self.now_s] * len(lines)
            if self.answering:
                for line in lines:
                    self.says(f"OK {line}")
            if not (order.close or order.data):
                return self
        raise AssertionError(f"it never stops sending: {self.received[-5:]}")

    def says(self, *lines: str) -> Story:
        for line in lines:
            self.link.received(codec.encode(line), self.now_s)
        return self

    def open(self) -> Story:
        self.act()
        assert self.opens == 1
        self.link.opened(self.now_s)
        return self.act()

    def wait(self, seconds: float) -> Story:
        """Advances the time and steps the link whenever it is due."""
        end_s = self.now_s + seconds
        while self.link.next_due_s() <= end_s:
            self.now_s = max(self.now_s, self.link.next_due_s())
            before = self.link.next_due_s()
            self.act()
            assert self.link.next_due_s() > before or self.link.next_due_s() > self.now_s, "it would spin"
        self.now_s = end_s
        return self

    def show(self, state: int, language: str = "ja", volume: int = 5) -> Story:
        self.link.show(Shown(state, language, volume), self.now_s)
        return self.act()

    def silent(self) -> Story:
        self.answering = False
        return self

    def clear(self) -> Story:
        self.received.clear()
        self.sent_s.clear()
        return self

    @property
    def linked(self) -> bool:
        return self.link.status.linked


@pytest.fixture
def story() -> Story:
    return Story()


# --- a display that answers ------------------------------------------------------------------------------------------


def test_before_the_port_is_open_nothing_is_known(story):
    status = story.link.status
    assert (status.linked, status.acknowledged_state, status.fault) == (False, None, "")
    story.act()
    assert (story.opens, story.received) == (1, [])
    assert story.link.next_due_s() == math.inf, "an open is under way"
    story.wait(60.0)
    assert story.opens == 1


def test_first_connection_sends_ping_then_all_values_and_then_the_state_once_a_second(story):
    story.open()
    assert story.received == ["PING", "LANG ja", "VOL 5", "STATE 1"]
    status = story.link.status
    assert (status.linked, status.acknowledged_state, status.text) == (True, 1, "the display acknowledges")
    assert story.clear().wait(10.05).received == ["STATE 1"] * 10
    assert story.clear().says("ERROR not a line").act().received == [], "which was not asked for"


def test_the_first_bytes_end_whatever_half_line_the_display_still_holds(story):
    story.act()
    story.link.opened(story.now_s)
    assert story.link.step(story.now_s).data == b"\n" + codec.encode("PING")
    story.answering = True
    story.says("OK PING")
    assert story.link.step(story.now_s).data == codec.encode("LANG ja")


def test_only_changed_values_are_sent_and_an_emergency_stop_first(story):
    story.open().clear().show(1, "en")
    assert story.received == ["LANG en"]
    story.clear().show(1, "en", 9)
    assert story.received == ["VOL 9"]
    story.clear().show(25, "zh", 0)
    assert story.received == ["LANG zh", "VOL 0", "STATE 25"]
    story.clear().show(6, "en", 9)
    assert story.received == ["STATE 6", "LANG en", "VOL 9"]


def test_the_time_from_wish_to_acknowledge(story):
    story.open().silent().show(2)
    assert math.isnan(story.link.status.state_to_ack_s)
    story.now_s += 0.03
    story.says("OK STATE 2")
    assert story.link.status.state_to_ack_s == pytest.approx(0.03)
    story.wait(0.5).says("OK STATE 2")
    assert story.link.status.state_to_ack_s == pytest.approx(0.03), "of the first acknowledge"


def test_values_out_of_range_are_rejected_and_not_sent(story):
    story.open().clear()
    for wrong in (Shown(11, "ja", 5), Shown(1, "de", 5), Shown(1, "ja", 11)):
        with pytest.raises(ValueError, match="no command"):
            story.link.show(wrong, story.now_s)
    assert story.act().received == []


# --- late, lost and garbled ------------------------------------------------------------------------------------------


def test_three_tries_200_ms_apart_then_the_link_is_lost(story):
    story.open().silent().clear().show(2).wait(0.61)
    assert story.received[:3] == ["STATE 2"] * 3
    assert story.sent_s[1] - story.sent_s[0] == pytest.approx(0.2)
    assert story.sent_s[2] - story.sent_s[1] == pytest.approx(0.2)
    assert not story.linked
    assert story.link.status.text == "no acknowledgement of 'STATE 2' after 3 tries"
    assert story.link.status.acknowledged_state == 1, "what it acknowledged last"


@pytest.mark.parametrize("at_s", [0.1, 0.5])
def test_an_answer_to_any_try_will_do(story, at_s):
    story.open().silent().show(2).wait(at_s).says("OK STATE 2").act()
    assert story.linked
    assert story.link.status.acknowledged_state == 2
    story.answering = True
    assert story.clear().wait(3.0).linked


def test_retry_sends_latest_value(story):
    story.open().silent().show(1, "en").clear()
    story.link.show(Shown(1, "zh", 5), story.now_s)
    story.now_s += 0.2
    assert story.act().received == ["LANG zh"]


def test_echo_of_other_state_is_not_an_acknowledgement(story):
    story.open().silent().show(23).clear().says("OK STATE 10")
    assert story.link.status.acknowledged_state == 10, "that is what it shows"
    story.wait(0.25)
    assert story.received == ["STATE 23"]
    story.says("OK STATE 23").act()
    assert story.link.status.acknowledged_state == 23
    story.show(2).clear().show(3).says("OK STATE 2")
    assert story.received == ["STATE 3"], "a state overtakes one that waits for its answer"
    story.wait(0.25)
    assert story.received == ["STATE 3"] * 2


def test_a_state_waits_for_the_language_but_a_stop_does_not(story):
    story.open().silent().clear().show(2, "en")
    assert story.received == ["LANG en"]
    story.show(6, "en")
    assert story.received == ["LANG en", "STATE 6"]


def test_garbage_is_counted_and_harms_nothing(story):
    story.open().clear()
    story.link.received(b"\xff\x00noise\nOK STATE 7\nOK STATE 7*00\n", story.now_s)
    story.says("HELLO", "OK FLY", "OK STATE 12").wait(2.05)
    assert story.linked
    assert story.link.status.acknowledged_state == 1
    assert story.link.rejected == {"not ASCII": 1, "no checksum": 1, "wrong checksum": 1, "unknown answer": 3}


def test_corrupt_answer_triggers_one_immediate_retry(story):
    story.open().silent().clear().show(2)
    story.link.received(b"OK STA?E 2*4C\n", story.now_s)
    story.act()
    assert story.received == ["STATE 2"] * 2
    story.link.received(b"OK STA?E 2*4C\n", story.now_s)
    story.act().wait(0.15)
    assert story.received == ["STATE 2"] * 2
    story.wait(0.1)
    assert story.received == ["STATE 2"] * 3
    assert story.linked


# --- ERROR, FAULT, READY ---------------------------------------------------------------------------------------------


def test_error_answer_is_retried_up_to_three_attempts(story):
    story.open().silent().clear().show(2).says("ERROR not a line").act().says("ERROR not a line").act()
    assert story.received == ["STATE 2"] * 3
    story.says("ERROR unknown command").act()
    assert story.linked, "it is there"
    assert story.link.status.text == "the display refuses 'STATE 2': unknown command"
    assert story.received == ["STATE 2"] * 3


def test_rejected_state_is_sent_again_at_next_repetition(story):
    story.open().silent().clear().show(2)
    for _ in range(3):
        story.says("ERROR").act()
    assert story.link.status.text.endswith("no reason given")
    story.clear().wait(0.9)
    assert story.received == []
    story.answering = True
    story.wait(0.2)
    assert story.received == ["STATE 2"]
    assert story.link.status.text == "the display acknowledges"


def test_a_refused_language_does_not_hold_the_state_back(story):
    story.open().silent().clear().show(2, "en")
    for _ in range(3):
        story.says("ERROR no such font").act()
    assert story.received == ["LANG en"] * 3 + ["STATE 2"]
    for _ in range(3):
        story.says("ERROR").act()
    assert story.clear().show(3, "en").received[0] == "STATE 3", "nor does a refused state"


def test_ready_message_triggers_resend_of_all_values(story):
    story.show(25).open().wait(0.3).clear().says("READY").act()
    assert story.received == ["LANG ja", "VOL 5", "STATE 25"]
    story.silent().show(2).clear()
    story.answering = True
    story.says("READY").act()
    assert story.received == ["LANG ja", "VOL 5", "STATE 2"], "also while a command waits"


def test_ready_of_a_display_that_was_silent_is_answered_at_once_and_is_no_acknowledgement(story):
    story.silent().open().says("READY").act().wait(0.7)
    assert not story.linked
    story.clear()
    story.answering = True
    story.says("READY").act()
    assert story.received == ["LANG ja", "VOL 5", "STATE 1"]
    assert story.linked


def test_a_fault_stays_until_it_is_over(story):
    story.open().says("FAULT LED_DRIVER").wait(5.0)
    status = story.link.status
    assert (status.linked, status.fault) == (True, "LED_DRIVER")
    assert status.text == "the display reports LED_DRIVER"
    assert story.says("FAULT NONE").link.status.fault == ""
    assert story.says("FAULT OVERHEAT").says("READY").link.status.fault == ""


# --- a display that is not there -------------------------------------------------------------------------------------


def test_a_port_that_cannot_be_opened_is_tried_with_back_off(story):
    pauses = []
    for _ in range(8):
        story.act()
        story.link.lost("no such file", story.now_s)
        pauses.append(story.link.next_due_s() - story.now_s)
        story.now_s = story.link.next_due_s()
    assert pauses == pytest.approx([0.25, 0.5, 1.0, 2.0, 4.0, 4.0, 4.0, 4.0])
    assert story.opens == 8
    assert story.link.status.text == "no such file"


def test_a_pulled_cable_and_back(story):
    story.open().show(25).clear().link.lost("hung up", story.now_s)
    assert not story.linked
    assert (story.link.status.text, story.link.status.acknowledged_state) == ("hung up", 25)
    story.wait(0.2)
    assert (story.opens, story.received) == (1, [])
    story.wait(0.1)
    assert story.opens == 2
    story.link.opened(story.now_s)
    story.act()
    assert story.received == ["PING", "LANG ja", "VOL 5", "STATE 25"]
    assert story.linked


def test_an_acknowledge_ends_the_back_off(story):
    for _ in range(4):
        story.act()
        story.link.lost("no", story.now_s)
        story.now_s = story.link.next_due_s()
    story.act()
    story.link.opened(story.now_s)
    story.act().link.lost("hung up", story.now_s)
    assert story.link.next_due_s() == pytest.approx(story.now_s + 0.25)


def test_change_during_disconnection_is_sent_after_reconnection(story):
    story.open().link.lost("hung up", story.now_s)
    story.show(6).clear().wait(0.3).link.opened(story.now_s)
    story.act()
    assert story.received == ["PING", "STATE 6", "LANG ja", "VOL 5"]


def test_half_a_line_from_before_the_cable_was_pulled_spoils_nothing(story):
    story.open().link.received(b"OK STA", story.now_s)
    story.link.lost("hung up", story.now_s)
    story.wait(0.3).link.opened(story.now_s)
    story.act()
    assert story.link.rejected == {}


def test_silent_display_is_polled_then_port_is_reopened(story):
    story.silent().show(25).open().wait(2.9)
    assert story.received == ["PING", "STATE 25"] * 3
    assert not story.linked
    assert story.closes == 0
    story.wait(0.2)
    assert story.closes == 1
    assert story.link.status.text == "no data from the display for 3 s"
    story.wait(0.3)
    assert story.opens == 2


def test_emergency_stop_is_sent_to_display_that_does_not_answer(story):
    story.silent().open().wait(1.0).show(6).clear().wait(1.1)
    assert "STATE 6" in story.received


def test_a_display_that_wakes_up_is_taken_back(story):
    story.open().silent().wait(2.0)
    assert not story.linked
    story.answering = True
    story.clear().wait(1.0)
    assert story.linked
    assert {"LANG ja", "VOL 5", "STATE 1"} <= set(story.received)


# --- random events ---------------------------------------------------------------------------------------------------

happenings = st.one_of(
    st.tuples(st.just("wait"), st.sampled_from([0.0, 0.05, 0.2, 0.9, 3.5])),
    st.tuples(st.just("show"), st.sampled_from([0, 1, 6, 25])),
    st.tuples(st.just("says"), st.sampled_from(["READY", "ERROR", "FAULT X", "OK PING", "OK STATE 3", "OK STATE 6"])),
    st.tuples(st.just("bytes"), st.binary(max_size=30)),
    st.tuples(st.just("answering"), st.booleans()),
    st.tuples(st.just("cable"), st.just(None)),
)


@settings(max_examples=100, deadline=None)
@given(st.lists(happenings, max_size=40))
def test_after_any_story_a_display_that_answers_shows_what_is_wanted(script):
    story = Story()
    wanted = 1
    story.act()
    story.link.opened(story.now_s)
    for what, value in script:
        match what:
            case "wait":
                run(story, value)
            case "show":
                wanted = value
                story.link.show(Shown(wanted, "ja", 5), story.now_s)
            case "says":
                story.says(value)
            case "bytes":
                story.link.received(value, story.now_s)
            case "answering":
                story.answering = value
            case _:
                story.link.lost("pulled", story.now_s)
        run(story, 0.0)
    story.answering = True
    run(story, 12.0)
    assert story.linked
    assert story.link.status.acknowledged_state == wanted
    story.clear()
    run(story, 2.1)
    assert set(story.received) == {f"STATE {wanted}"}, "and then it only repeats"
    assert len(story.received) in (2, 3)


def run(story: Story, seconds: float) -> None:
    """As ``wait``, with a port that opens on every request."""
    end_s = story.now_s + seconds
    while True:
        opens = story.opens
        story.act()
        if story.opens > opens:
            story.link.opened(story.now_s)
            continue
        due_s = story.link.next_due_s()
        if due_s > end_s:
            break
        story.now_s = max(story.now_s, due_s)
    story.now_s = end_s
