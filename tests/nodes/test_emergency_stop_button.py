"""The button's node on a real engine process: press, release, contradiction, and everything that counts as pressed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from std_msgs.msg import Bool

from robot_stack.contract import topics
from tests.support.engine import BUTTON_PRESSED, BUTTON_RELEASED, TestEngine
from tests.support.held_up import HeldUp
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Heard, Peer

Start = Callable[..., NodeProcess]
NAME = "emergency_stop_button"


@pytest.fixture
def engine(start: Start, tmp_path: Path) -> Iterator[TestEngine]:
    engine = TestEngine(start, tmp_path)
    yield engine
    engine.close()


class Button:
    """The node, and what it has said."""

    def __init__(self, start: Start, peer: Peer) -> None:
        self.said: Heard = peer.listen(topics.EMERGENCY_STOP)
        self._beats = peer.listen(topics.HEARTBEAT)
        self._diagnoses = peer.listen(topics.DIAGNOSTICS)
        self.process = start(NAME, "-p", "startup_settle_s:=0.5")

    def wait_health(self, text: str) -> Button:
        """Waits for a heartbeat that says ``text``; empty means ready."""

        def matches() -> bool:
            mine = [message for message in self._beats.messages if message.node == NAME]
            return bool(mine) and mine[-1].waiting_for == text

        wait_for(matches, f"the button to be {text or 'ready'}", 60.0)
        self.said.wait_connected()
        return self

    def wait_settled(self) -> Button:
        """Waits until an unreadable contact counts as pressed."""

        def settled(message: Any) -> bool:
            values = {item.key: item.value for item in message.status[0].values}
            return values.get("contact") == "released"

        self._diagnoses.wait(settled, "the button to have settled", 60.0)
        self.said.wait_connected()
        return self

    def values(self) -> list[bool]:
        return [message.data for message in self.said.messages]

    def wait_values(self, values: list[bool]) -> None:
        try:
            wait_for(lambda: self.values() == values, f"exactly {values} on /emergency_stop")
        except AssertionError as error:
            raise AssertionError(f"{error}; heard {self.values()}") from None


def test_press_and_release(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run().up()
    button = Button(start, peer).wait_health("")
    peer.wait_matched(topics.EMERGENCY_STOP)
    assert button.values() == []  # found released: nothing to say
    with HeldUp() as machine:
        pressed_s = time.monotonic()
        engine.set(input0=BUTTON_PRESSED)
        button.wait_values([True])
        latency_s = button.said.items[0][0] - pressed_s
    print(f"contact to /emergency_stop: {1e3 * latency_s:.1f} ms")
    assert latency_s - machine.seconds < 0.25  # 10 ms debounce and a reading; the rest is what a busy machine may take
    engine.set(input0=BUTTON_RELEASED)
    button.wait_values([True, False])


def test_the_button_says_who_it_is_five_times_a_second(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run().up()
    sources = peer.listen(topics.EMERGENCY_STOP_SOURCES)
    button = Button(start, peer).wait_health("")
    # An engine that a busy machine holds up for a moment is a press, which ends by itself.
    before = sources.wait(lambda message: message.name == NAME and not message.pressed, "a report of no press").presses
    engine.set(input0=BUTTON_PRESSED)
    sources.wait(lambda message: message.pressed and message.presses > before, "a report of the press")
    count = len(sources.items)
    wait_for(lambda: len(sources.items) > count + 12, "two seconds of reports")
    told = {(message.pid, message.presses, message.pressed) for message in sources.messages[count:]}
    assert told == {(button.process.pid, before + 1, True)}
    sources.wait_period(0.2, rel=0.1, count=11)
    engine.set(input0=BUTTON_RELEASED)
    sources.wait(lambda message: not message.pressed and message.presses == before + 1, "a report of the release")


def test_a_pressed_button_contradicts_every_release(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.set(input0=BUTTON_PRESSED)
    engine.run().up()
    button = Button(start, peer)
    button.wait_values([True])
    peer.wait_matched(topics.EMERGENCY_STOP, 2)  # the button and this peer's own ear
    for _ in range(3):
        before = len(button.values())
        peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
        # The queue holds one message: this peer's own false may be overwritten before it hears it.
        wait_for(lambda n=before: len(button.values()) > n and button.values()[-1], "the contradiction")
    engine.set(input0=BUTTON_RELEASED)
    wait_for(lambda: not button.values()[-1], "the release")
    peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    button.wait_health("")
    assert not button.values()[-1]


def test_an_engine_that_is_not_there_yet_is_no_press(start: Start, peer: Peer, engine: TestEngine) -> None:
    button = Button(start, peer).wait_health("waiting for the engine's inputs")
    engine.run()
    engine.up()
    button.wait_health("")
    assert button.values() == []


@pytest.mark.parametrize("how", ["engine killed", "bus lost"])
def test_an_engine_that_goes_away_is_a_press(start: Start, peer: Peer, engine: TestEngine, how: str) -> None:
    engine.run().up()
    button = Button(start, peer).wait_settled()
    if how == "engine killed":
        engine.kill()
    else:
        engine.set(connected=False)
    button.wait_values([True])
    assert button.process.running()


def test_a_new_engine_is_found_again(start: Start, peer: Peer, engine: TestEngine, tmp_path: Path) -> None:
    engine.run().up()
    button = Button(start, peer).wait_settled()
    engine.kill()
    button.wait_values([True])
    engine.close()
    engine.run().up()
    button.wait_values([True, False])


def test_a_restarted_button_repeats_the_press(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run().up()
    button = Button(start, peer).wait_health("")
    engine.set(input0=BUTTON_PRESSED)
    button.wait_values([True])
    button.process.process.kill()
    button.process.wait()
    Button(start, peer)
    button.wait_values([True, True])


def test_bad_parameters_stop_the_start(start: Start) -> None:
    process = start(NAME, "-p", "debounce_s:=0.0")
    assert process.wait() == 2
    assert "debounce_s" in process.output()
