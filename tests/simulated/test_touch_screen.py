"""A passenger's ride and staff's driving by the touch screen's protocol. In Chromium: tests/scenarios, tests/ui."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from robot_stack.contract import topics
from robot_stack.contract.display import Display
from robot_stack.core.display_patterns import load_patterns
from robot_stack.core.mission_library import mission_library
from tests.simulated.shared import shared
from tests.simulated.stage import Stage, staged
from tests.simulated.story import Text

pytestmark = shared(staged)

_PIN = "2468"
_PAD_PERIOD_S = 0.05


class Person:
    """A client of a page on the robot's own screen that answers the server's messages."""

    def __init__(self, stage: Stage) -> None:
        assert stage.stack.server is not None
        self._stage, self._page = stage, stage.stack.server.open_page()
        stage.run(0.2)

    def say(self, **message: Any) -> None:
        """Sends a message. Raises AssertionError if the server refuses it."""
        number = self._page.say(**message)
        self._stage.wait(lambda: self._answer(number), f"an answer to {message}")
        answer = self._answer(number)
        assert answer is not None
        assert answer["ok"], answer

    def _answer(self, number: int) -> dict[str, Any] | None:
        answers = (json.loads(text) for text in self._page.answers)
        return next((answer for answer in answers if answer.get("id") == number), None)

    def unlock(self) -> None:
        self.say(t="login", pin=_PIN)

    def push(self, x: float, y: float, turn: float, duration_s: float) -> None:
        """Holds a finger on the pad for the duration."""
        for _ in range(round(duration_s / _PAD_PERIOD_S)):
            self._page.say(t="pad", x=x, y=y, turn=turn, at_ms=round(1e3 * self._stage.now_s))
            self._stage.run(_PAD_PERIOD_S)

    def show(self, *layers: str) -> None:
        """Opens a page with these layers; the server does not answer."""
        self._page.say(t="show", layers=layers)
        self._stage.wait(lambda: all(layer in self._page.state for layer in layers), f"layers {layers}")

    def self_test(self) -> dict[str, Any]:
        return dict(self._page.state["self_test"])

    def wait_step(self, kind: str, target: str) -> None:
        """Waits until the self test is at that step."""

        def there() -> bool:
            test = self.self_test()
            return bool(test["running"]) and test["steps"][test["at"]] == {"kind": kind, "target": target}

        self._stage.wait(there, Text(lambda: f"{kind} {target}; the self test is {self.self_test()}"))

    def confirm(self) -> None:
        """Confirms the step of the self test."""
        self.say(t="self_test", act="confirm", step=self.self_test()["at"])

    def lift(self) -> None:
        """Lifts the finger off the pad; the server does not answer."""
        self._page.say(t="lift")


@contextmanager
def _screen() -> Iterator[tuple[Stage, Person]]:
    with staged() as stage:
        yield stage, Person(stage)


def test_a_ride_is_started_paused_stopped_released_and_resumed() -> None:
    with _screen() as (stage, person):
        person.say(t="start", mission="short_hop")
        stage.wait_faster(0.3)
        person.say(t="pause")
        stage.wait_mission("PAUSED")
        stage.wait_stands()
        person.say(t="resume")
        stage.wait_faster(0.3)
        person.say(t="stop")
        stage.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        stage.wait_stands()
        person.unlock()
        stage.run(0.5)
        person.say(t="reset")
        stage.wait_safety("NORMAL")
        stage.run(0.5)  # until mission_manager has received the release
        person.say(t="resume")
        stage.wait_faster(0.3)


def test_external_display_and_mission_name_follow_the_language_of_the_rider() -> None:
    patterns = load_patterns()
    with _screen() as (stage, person):
        shown, status = stage.listen(topics.SIM_EHMI_DISPLAY), stage.listen(topics.MISSION_STATUS)

        def wait_text(display: Display, language: str) -> None:
            text = patterns.states[display].text.get(language)
            expected = {"state": display, "language": language, "text": text}
            shown.wait(lambda message: expected.items() <= json.loads(message.data).items(), str(expected))

        wait_text(Display.IDLE, "ja")  # config/mission_manager.yaml
        person.say(t="language", code="zh")
        wait_text(Display.IDLE, "zh")
        person.say(t="start", mission="short_hop")
        name = mission_library().find("short_hop").name
        status.wait(lambda message: message.mission_name == name.zh, "the mission's name in Chinese")
        wait_text(Display.NAVIGATING, "zh")
        person.say(t="language", code="en")
        wait_text(Display.NAVIGATING, "en")
        status.wait(lambda message: message.mission_name == name.en, "the mission's name in English")


def test_staff_drive_by_hand_and_the_robot_stops_when_the_finger_lifts() -> None:
    with _screen() as (stage, person):
        person.unlock()
        person.push(1.0, 0.0, 0.0, 3.0)
        assert stage.speed_mps > 0.3
        person.lift()
        stage.wait_stands(3.0)
        # A page that dies while the pad is held stops the robot.
        person.push(1.0, 0.0, 0.0, 3.0)
        assert stage.speed_mps > 0.3
        stage.wait_stands(3.0)


def test_self_test_of_the_buttons_and_the_screen_moves_nothing() -> None:
    with _screen() as (stage, person):
        person.unlock()
        person.show("self_test")
        begun_s = stage.now_s
        stage.wait(lambda: stage.now_s > begun_s + 1.0 and stage.stands, "reports of the sources, and standstill")
        at = stage.at()
        person.say(t="self_test", act="begin")
        for button in ("passenger", "left", "right"):
            person.wait_step("press", button)
            stage.inject("estop_button", value=1.0)
            person.wait_step("release", button)  # a reset was refused before
            assert stage.safety.last.safety_state == "EMERGENCY_STOP"
            stage.inject("estop_button", value=0.0)
            person.wait_step("reset", button)
            assert stage.safety.last.safety_state == "EMERGENCY_STOP"
            person.confirm()
        person.wait_step("press", "screen")
        stage.wait_safety("NORMAL")
        person.say(t="stop")
        for check in ("latch", "belt", "safety_edge", "lidars", "brakes"):
            person.wait_step("check", check)
            person.confirm()
        person.wait_step("release", "screen")
        person.confirm()
        person.wait_step("reset", "screen")
        person.confirm()
        stage.wait(lambda: not person.self_test()["running"], "the end of the test")
        assert person.self_test()["last"]["verdict"] == "passed", person.self_test()["last"]
        assert person.self_test()["stored"]
        stage.wait_safety("NORMAL")
        stage.assert_wheels_rest(1.0)
        assert stage.at().distance_to(at) < 0.01
