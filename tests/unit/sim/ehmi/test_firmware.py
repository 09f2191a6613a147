"""The simulated firmware, byte by byte in fake time."""

from __future__ import annotations

import pytest

from robot_stack.core.config import load
from robot_stack.ehmi import codec
from robot_stack.ehmi.codec import Decoder
from sim.ehmi.firmware import Display, Firmware
from sim.ehmi.params import EhmiDisplayParams

QUIET = load(EhmiDisplayParams, "ehmi_display").firmware.model_copy(update={"noise": 0.0})


class Story:
    """A firmware that was switched on at 0 s."""

    def __init__(self, **changes: float) -> None:
        self.params = QUIET.model_copy(update=changes)
        self.firmware = Firmware(self.params)
        self.now_s = 0.0
        self.firmware.power_on(0.0)
        self.decoder = Decoder()
        self.sent = b""

    def wait(self, seconds: float) -> list[str]:
        """Returns the lines sent meanwhile."""
        end_s, lines = self.now_s + seconds, []
        while self.now_s < end_s:
            data = self.firmware.transmit(self.now_s)
            self.sent += data
            lines += self.decoder.feed(data)
            self.now_s = min(max(self.firmware.next_due_s(), self.now_s + 1e-4), end_s)
        return lines

    def ready(self) -> Story:
        assert self.wait(self.params.boot_s + 0.1) == ["READY"]
        return self

    def send(self, *texts: str) -> list[str]:
        for text in texts:
            self.firmware.receive(codec.encode(text), self.now_s)
        return self.wait(0.1)

    @property
    def shown(self) -> Display:
        return self.firmware.display(self.now_s)


def test_it_answers_with_an_echo_within_the_time_of_the_contract():
    story = Story()
    assert story.send("STATE 2") == [], "not ready"
    story.ready()
    assert story.send("LANG zh", "VOL 3", "STATE 25", "PING") == ["OK LANG zh", "OK VOL 3", "OK STATE 25", "OK PING"]
    assert (story.shown.state, story.shown.language, story.shown.volume) == (25, "zh", 3)
    since_s = story.shown.since_s
    story.send("STATE 25", "LANG ja")
    assert story.shown.since_s == since_s, "the animation is not restarted"
    story.firmware.troubles.late_s = 0.5
    assert story.send("PING") == []
    assert story.wait(0.5) == ["OK PING"]
    story.firmware.troubles.late_s = 0.0
    story.firmware.power_on(story.now_s)
    assert story.shown.state == 0, "forgotten with the power"
    story.ready()


def test_unknown_command_and_bad_checksum_are_answered_with_error():
    story = Story().ready()
    assert story.send("STATE 11") == ["ERROR unknown command"]
    story.firmware.receive(b"STATE 2*00\n", story.now_s)
    assert story.wait(0.1) == ["ERROR not a line"]
    assert story.shown.state == 0


def test_a_host_that_falls_silent_leaves_no_promise():
    story = Story().ready()
    story.send("STATE 2")
    story.wait(2.5)
    assert story.shown.state == 2
    story.wait(0.6)
    assert story.shown.state == 5
    story.send("PING", "LANG en")
    assert story.shown.state == 5, "a host that is back has not said yet that it still drives"
    story.send("STATE 2")
    assert story.shown.state == 2
    story.send("STATE 0")
    story.wait(10.0)
    assert story.shown.state == 0


def test_fault_is_repeated_and_end_of_fault_is_sent_three_times():
    story = Story().ready()
    story.firmware.set_fault("HOT", story.now_s)
    assert story.wait(2.5) == ["FAULT HOT"] * 3
    story.firmware.set_fault("", story.now_s)
    assert story.wait(10.0) == ["FAULT NONE"] * 3


@pytest.mark.parametrize("trouble", ["silent", "garbage", "half_lines"])
def test_troubles_give_no_answer_that_counts(trouble):
    story = Story().ready()
    setattr(story.firmware.troubles, trouble, True)
    answers = story.send("STATE 2")
    assert story.shown.state == 2, "it hears"
    assert (trouble == "garbage") == ("OK STATE 2" in answers) or trouble == "garbage"
    setattr(story.firmware.troubles, trouble, False)
    story.send("PING")
    assert "OK PING" in story.send("PING", "PING")


def test_noise_changes_about_its_share_of_the_bytes():
    story = Story().ready()
    story.firmware.troubles.noise = 0.1
    story.sent = b""
    for _ in range(200):
        story.send("PING")
    assert story.decoder.rejected.total() > 50
    assert story.firmware.commands < 190
