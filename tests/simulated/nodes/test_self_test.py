"""The guided self test in the touch screen's node: who may begin it, what ends it, what is reported and stored."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry

from custom_msgs.msg import MissionStatus, SafetyStatus
from robot_stack.contract import topics
from robot_stack.ui.pin import hash_pin
from tests.simulated.bench import Bench
from tests.simulated.nodes.test_touch_ui import PIN, Page
from tests.support.fake_safety import FakeSafety


class Robot:
    """The rest of the robot: button, safety monitor, odometry, mission. Its test has one button and one check."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.safety = bench, FakeSafety(bench)
        self.mission, self.odom = MissionStatus(state="IDLE"), Odometry()
        self.stops, self.diagnoses = bench.listen(topics.EMERGENCY_STOP), bench.listen(topics.DIAGNOSTICS)
        bench.start(
            "touch_ui",
            {
                "access.pin_hash": hash_pin(PIN),
                "pages.map": "",
                "self_test.buttons": ["left"],
                "self_test.checks": ["belt"],
            },
        )
        self.button = bench.source("emergency_stop_button")

    def report(self) -> None:
        """Starts the messages that a self test requires."""
        self.bench.repeat(topics.SAFETY_STATUS, self._status, 10.0)
        self.bench.repeat(topics.ODOM, lambda: self.odom, 20.0)
        self.say_mission()
        self.bench.run(0.5)

    def _status(self) -> SafetyStatus:
        rows = ["ESTOP_PRESSED"] if self.safety.active else []
        return SafetyStatus(safety_state="EMERGENCY_STOP" if rows else "NORMAL", active_faults=rows)

    def say_mission(self, **changes: Any) -> None:
        for name, value in changes.items():
            setattr(self.mission, name, value)
        self.bench.publish(topics.MISSION_STATUS, self.mission)

    def press(self) -> None:
        self.button.publish(True)

    def status(self) -> DiagnosticStatus:
        """The entry of the self test in the newest /diagnostics of the touch screen."""
        self.bench.run(1.1)
        entries = {item.name: item for message in self.diagnoses.messages for item in message.status}
        return entries["touch_ui: self test"]

    def values(self) -> dict[str, str]:
        return {item.key: item.value for item in self.status().values}


class StaffPage(Page):
    """A page of staff that shows the self test."""

    def __init__(self, bench: Bench, *, shows: bool = True) -> None:
        super().__init__(bench)
        self.bench = bench
        self.log_in()
        if shows:
            self.open.say(t="show", layers=["self_test"])
            bench.run(0.5)

    def act(self, act: str, step: int = 0) -> str:
        """Returns the key of a refusal."""
        return str(self.ask("self_test", act=act, step=step)["why"])

    @property
    def test(self) -> dict[str, Any]:
        self.bench.run(0.5)
        return dict(self.open.state["self_test"])

    def step(self) -> str:
        test = self.test
        assert test["running"], test["last"]
        return " ".join(test["steps"][test["at"]].values())

    def wait_step(self, step: str) -> int:
        """Returns its number."""
        self.bench.wait(lambda: self.step() == step, step)
        return int(self.test["at"])

    def result(self) -> tuple[str, str, str]:
        test = self.test
        assert not test["running"]
        return (
            test["last"]["verdict"],
            f"{test['last']['kind']} {test['last']['target']}".strip(),
            test["last"]["reason"],
        )


@pytest.fixture
def robot(bench: Bench) -> Robot:
    return Robot(bench)


def test_only_a_shown_page_on_a_released_standing_empty_robot_begins(robot: Robot) -> None:
    assert StaffPage(robot.bench, shows=False).act("begin") == "answer.test_not_shown"
    page = StaffPage(robot.bench)
    assert page.act("begin") == "answer.test_unknown"
    robot.report()
    robot.odom.twist.twist.angular.z = 0.2
    robot.bench.run(0.2)
    assert page.act("begin") == "answer.test_moving"
    robot.odom.twist.twist.angular.z = 0.0
    robot.say_mission(state="PAUSED")
    robot.bench.run(0.2)
    assert page.act("begin") == "answer.test_ride"
    robot.say_mission(state="IDLE", passenger_attached=True)
    robot.bench.run(0.2)
    assert page.act("begin") == "answer.test_passenger"
    robot.say_mission(passenger_attached=False)
    robot.press()
    robot.bench.run(0.5)
    assert page.act("begin") == "answer.test_stopped"
    assert page.act("confirm") == "answer.test_none"


def test_passed_test_is_reported_and_stored(robot: Robot, tmp_path: Path) -> None:
    assert robot.status().level == DiagnosticStatus.WARN
    assert robot.status().message == "never passed; due"
    assert robot.values()["passed_age_h"] == "inf"
    robot.report()
    page = StaffPage(robot.bench)
    assert page.act("begin") == ""
    robot.safety.refusals = ["pressed"]
    robot.press()
    page.wait_step("release left")
    robot.button.publish(False)
    assert page.act("confirm", page.wait_step("reset left")) == ""
    number = page.wait_step("press screen")
    assert page.act("confirm", number - 1) == "answer.test_other_step"
    robot.safety.refusals = ["pressed"]
    assert page.ask("stop")["ok"]
    assert page.act("confirm", page.wait_step("check belt")) == ""
    assert page.act("confirm", page.wait_step("release screen")) == ""
    assert page.act("confirm", page.wait_step("reset screen")) == ""
    assert page.result() == ("passed", "", "")
    assert [message.data for message in robot.stops.messages] == [True, False, True, False]
    assert robot.status().level == DiagnosticStatus.OK
    assert robot.status().message == "passed 0 h ago"
    assert (robot.values()["last_verdict"], robot.values()["due"], robot.values()["stored"]) == (
        "passed", "False", "True",
    )  # fmt: skip
    stored = json.loads(next(tmp_path.rglob("touch_ui_self_test.json")).read_text(encoding="utf-8"))
    assert stored["passed"] == stored["last"]
    assert stored["last"]["who"].endswith("staff")
    assert page.open.state["self_test_age"] == {"due": False, "failed": False, "age_h": 0}


def test_reset_granted_although_pressed_fails_and_the_screen_stops_the_robot(robot: Robot) -> None:
    robot.report()
    page = StaffPage(robot.bench)
    page.act("begin")
    robot.press()  # the safety monitor of this test grants every reset
    robot.bench.run(1.0)
    assert page.result() == ("failed", "refused left", "RESET_GRANTED")
    assert [message.data for message in robot.stops.messages] == [True, True]
    assert robot.safety.active
    assert robot.status().level == DiagnosticStatus.WARN
    assert robot.status().message == "last one failed; never passed; due"
    assert (robot.values()["last_step"], robot.values()["last_reason"]) == ("refused left", "RESET_GRANTED")


@pytest.mark.parametrize("how", ["closed", "left and back", "silent"])
def test_page_that_is_left_aborts_the_test_and_releases_nothing(robot: Robot, how: str) -> None:
    robot.report()
    page, other = StaffPage(robot.bench), StaffPage(robot.bench)
    page.act("begin")
    assert other.act("begin") == other.act("cancel") == "answer.test_busy"
    robot.safety.refusals = ["pressed"] * 2
    robot.press()
    page.wait_step("release left")
    match how:
        case "closed":
            page.open.close()
        case "left and back":
            page.open.say(t="show", layers=[])
            page.open.say(t="show", layers=["self_test"])
        case "silent":
            page.open.silence()
    robot.bench.run(4.0)
    assert other.result() == ("aborted", "release left", "LEFT")
    robot.button.publish(False)
    robot.bench.run(2.0)
    assert robot.safety.active
    assert [message.data for message in robot.stops.messages] == [True, False]  # both of the button
    assert other.act("begin") == "answer.test_stopped"


def test_operator_ends_and_fails_a_test(robot: Robot) -> None:
    robot.report()
    page = StaffPage(robot.bench)
    page.act("begin")
    assert page.act("cancel") == ""
    assert page.result() == ("aborted", "press left", "CANCELLED")
    page.act("begin")
    assert page.act("fail") == ""
    assert page.result() == ("failed", "press left", "PERSON")
