"""The button's node on a motion engine: press, release, contradiction, and every condition that counts as pressed."""

from __future__ import annotations

import pytest
from std_msgs.msg import Bool

from robot_stack.contract import topics
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench

NAME = "emergency_stop_button"


class Button:
    """The node and its published messages."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self.said, self.sources = bench.listen(topics.EMERGENCY_STOP), bench.listen(topics.EMERGENCY_STOP_SOURCES)
        self._beats, self._diagnoses = bench.listen(topics.HEARTBEAT), bench.listen(topics.DIAGNOSTICS)
        self.process = bench.start(NAME, {"startup_settle_s": 0.5})

    def wait_health(self, text: str) -> Button:
        """Waits for a heartbeat with ``text``; empty means ready."""
        self._beats.wait(lambda message: message.node == NAME and message.waiting_for == text, text or "ready")
        return self

    def wait_settled(self) -> Button:
        """Waits until an unreadable contact counts as pressed."""

        def settled(message: object) -> bool:
            return {item.key: item.value for item in message.status[0].values}.get("contact") == "released"

        self._diagnoses.wait(settled, "the button to have settled")
        return self

    def values(self) -> list[bool]:
        return [message.data for message in self.said.messages]

    def wait_values(self, values: list[bool], limit_s: float = 0.5) -> None:
        self._bench.wait(lambda: len(self.said.items) >= len(values), f"{values} on /emergency_stop", limit_s)
        self._bench.run(0.3)
        assert self.values() == values


def test_press_and_release(bench: Bench) -> None:
    bench.engine.run().up()
    button = Button(bench).wait_health("")
    assert button.values() == []  # initially released: no message
    pressed_s = bench.now_s
    bench.engine.press(True)
    button.wait_values([True])
    # A block of the engine, and two samples of the contact at 100 Hz, the second 10 ms later.
    assert 0.01 < button.said.times_s[0] - pressed_s < 0.005 + 0.02 + 2.0 * COMPUTE_S + LATENCY_S
    bench.engine.press(False)
    button.wait_values([True, False])


def test_button_reports_its_source_at_5_hz(bench: Bench) -> None:
    bench.engine.run().up()
    button = Button(bench).wait_health("")
    assert {(message.name, message.pressed, message.presses) for message in button.sources.messages} == {
        (NAME, False, 0)
    }
    bench.engine.press(True)
    button.wait_values([True])
    begun_s = bench.now_s
    bench.run(3.0)
    reported = {(message.pid, message.presses, message.pressed) for message in button.sources.since(begun_s)}
    assert reported == {(button.process.life.process_id, 1, True)}
    assert button.sources.period_s(10) == pytest.approx(0.2, abs=1e-6)
    bench.engine.press(False)
    button.sources.wait(lambda message: (message.pressed, message.presses) == (False, 1), "the release", 0.1)


def test_a_pressed_button_contradicts_every_release(bench: Bench) -> None:
    bench.engine.press(True)
    bench.engine.run().up()
    button = Button(bench)
    button.wait_values([True], 2.0)
    for number in range(3):
        bench.publish(topics.EMERGENCY_STOP, Bool(data=False))
        # The peer's false message, and the contradiction.
        button.wait_values([True, *[False, True] * (number + 1)])
        heard_s, contradicted_s = button.said.times_s[-2:]
        assert contradicted_s - heard_s <= 2.0 * COMPUTE_S + LATENCY_S
    bench.engine.press(False)
    button.wait_values([True, *[False, True] * 3, False])
    bench.publish(topics.EMERGENCY_STOP, Bool(data=False))
    bench.run(1.0)
    button.wait_health("")
    assert not button.values()[-1]


def test_missing_engine_is_not_reported_as_button_press(bench: Bench) -> None:
    button = Button(bench).wait_health("waiting for the engine's inputs")
    bench.run(5.0)
    bench.engine.run().up()
    button.wait_health("")
    assert button.values() == []


@pytest.mark.parametrize("how", ["engine killed", "bus lost"])
def test_lost_engine_is_a_press_until_it_returns(bench: Bench, how: str) -> None:
    bench.engine.run().up()
    button = Button(bench).wait_settled()
    if how == "engine killed":
        bench.engine.kill()
    else:
        bench.engine.drives.connected = False
    button.wait_values([True])
    if how == "engine killed":
        bench.engine.run().up()
    else:
        bench.engine.recover()
    button.wait_values([True, False], 5.0)


def test_a_restarted_button_repeats_the_press(bench: Bench) -> None:
    bench.engine.run().up()
    button = Button(bench).wait_health("")
    bench.engine.press(True)
    button.wait_values([True])
    button.process.kill()
    bench.start_again(button.process)
    button.wait_values([True, True], 2.0)


def test_a_button_that_hangs_presses_late_and_once(bench: Bench) -> None:
    bench.engine.run().up()
    button = Button(bench).wait_settled()
    button.process.hang(1.0)
    bench.engine.press(True)
    bench.run(0.9)
    assert button.values() == []
    button.wait_values([True])
