"""The touch screen's node: the stop, the pad and the heartbeat, by the protocol of its pages."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import Any

import pytest

from custom_msgs.msg import UICommand
from custom_msgs.srv import ConfirmDoor
from robot_stack.contract import services, topics
from robot_stack.ui.pin import hash_pin
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench
from tests.support.fake_safety import FakeSafety

PIN = "2468"
PAD_S = 0.05
SILENT_S = 0.2


class Page:
    """A page in a browser."""

    def __init__(self, bench: Bench) -> None:
        assert bench.devices.server is not None
        self._bench, self.open = bench, bench.devices.server.open_page()
        bench.run(0.1)

    def answers(self) -> list[dict[str, Any]]:
        return [json.loads(text) for text in self.open.answers]

    def ask(self, t: str, **fields: Any) -> dict[str, Any]:
        """Sends a message and returns the server's answer."""
        number = self.open.say(t=t, **fields)

        def answer() -> dict[str, Any] | None:
            return next((one for one in self.answers() if one.get("id") == number), None)

        found = self._bench.wait(answer, f"an answer to {t}")
        assert found is not None
        return found

    def log_in(self) -> Page:
        assert self.ask("login", pin=PIN)["ok"]
        return self

    def pad(self, x: float) -> None:
        self.open.say(t="pad", x=x, y=0.0, turn=0.0, at_ms=round(1e3 * self._bench.now_s))

    def hold(self, duration_s: float, x: float = 1.0) -> None:
        """Holds a finger on the pad for the duration."""
        for _ in range(round(duration_s / PAD_S)):
            self.pad(x)
            self._bench.run(PAD_S)


class Screen:
    """The node and its published messages."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.stops, self.commands = bench.listen(topics.EMERGENCY_STOP), bench.listen(topics.UI_COMMAND)
        self.teleop, self.beats = bench.listen(topics.TELEOP_CMD_VEL), bench.listen(topics.UI_HEARTBEAT)
        self.process = bench.start("touch_ui", {"access.pin_hash": hash_pin(PIN), "pages.map": ""})

    def page(self) -> Page:
        return Page(self.bench)

    def stands_after(self, since_s: float) -> float:
        """Time from ``since_s`` to the single zero command after which the pad is silent."""
        self.bench.run(2.0)
        zeros = [at_s for at_s, message in self.teleop.items if message.twist.linear.x == 0.0]
        assert len(zeros) == 1
        assert zeros[0] == self.teleop.times_s[-1]
        return zeros[0] - since_s


@pytest.fixture
def screen(bench: Bench) -> Screen:
    return Screen(bench)


def test_the_stop_reaches_everyone_at_once_and_only_a_request_takes_it_back(screen: Screen) -> None:
    safety, rider = FakeSafety(screen.bench), screen.page()
    screen.bench.run(0.3)
    safety.refusals = ["refused: stop button pressed"] * 40
    pressed_s = screen.bench.now_s
    assert rider.ask("stop")["ok"]
    screen.bench.run(0.1)
    assert [message.data for message in screen.stops.messages] == [True]
    assert screen.stops.times_s[0] - pressed_s <= 2.0 * COMPUTE_S + LATENCY_S + 1e-6
    assert [message.command_type for message in screen.commands.messages] == [UICommand.EMERGENCY_STOP]
    assert safety.active
    refused = rider.ask("reset")
    assert (refused["ok"], refused["why"]) == (False, "answer.needs_staff")
    assert [message.data for message in screen.stops.messages] == [True]
    rider.log_in()
    refused = rider.ask("reset")
    assert (refused["ok"], refused["why"]) == (False, "answer.reset_refused")
    assert refused["detail"] == "refused: stop button pressed"  # names the remaining cause
    safety.refusals = ["not yet", "not yet"]
    assert rider.ask("reset")["ok"]
    assert not safety.active
    assert [message.data for message in screen.stops.messages] == [True, False, False]


def test_staff_confirm_a_door(screen: Screen) -> None:
    def confirm(request: ConfirmDoor.Request, response: ConfirmDoor.Response) -> ConfirmDoor.Response:
        response.success, response.message = request.name == "hall", f"door {request.name}"
        return response

    screen.bench.serve(services.CONFIRM_DOOR, confirm)
    screen.bench.run(0.3)
    page = screen.page()
    assert page.ask("confirm_door", name="hall")["why"] == "answer.needs_staff"
    page.log_in()
    assert page.ask("confirm_door", name="hall")["ok"]
    refused = page.ask("confirm_door", name="lobby")
    assert (refused["ok"], refused["why"], refused["detail"]) == (False, "answer.door_refused", "door lobby")


def test_the_pad_drives_while_it_is_held(screen: Screen) -> None:
    staff = screen.page().log_in()
    staff.hold(2.0)
    lifted_s = screen.bench.now_s
    staff.open.say(t="lift")
    assert screen.stands_after(lifted_s) <= PAD_S + COMPUTE_S + LATENCY_S + 1e-6
    driven = [message.twist.linear.x for message in screen.teleop.messages]
    assert driven[0] == pytest.approx(0.5)
    assert all(any(pair) for pair in pairwise(driven))
    assert screen.teleop.period_s() == pytest.approx(PAD_S, abs=1e-4)
    assert screen.teleop.last.header.frame_id == "base_link"


@pytest.mark.parametrize("how", ["silent", "closed"])
def test_a_pad_that_falls_silent_and_a_page_that_vanishes_stop(screen: Screen, how: str) -> None:
    staff = screen.page().log_in()
    staff.hold(0.3)
    silent_s = screen.bench.now_s - PAD_S
    if how == "closed":
        staff.open.close()
    limit_s = PAD_S if how == "closed" else SILENT_S
    assert screen.stands_after(silent_s) <= limit_s + 2.0 * PAD_S + COMPUTE_S + LATENCY_S


def test_the_node_that_ends_stops(screen: Screen) -> None:
    staff = screen.page().log_in()
    staff.hold(0.3)
    assert screen.bench.stop(screen.process) == 0
    screen.stands_after(screen.bench.now_s)


def test_heartbeat_only_while_a_page_is_there(screen: Screen) -> None:
    screen.bench.run(3.0)
    assert screen.beats.items == []
    page = screen.page()
    screen.bench.run(5.0)
    assert screen.beats.period_s(3) == pytest.approx(1.0, abs=1e-3)
    page.open._timer.destroy()  # like a page that hangs: the connection stays open without heartbeats
    screen.bench.run(4.2)
    begun_s = screen.bench.now_s
    screen.bench.run(5.0)
    assert screen.beats.since(begun_s) == []


def test_wrong_pins_lock_everyone_out_for_half_a_minute_but_never_the_stop(screen: Screen) -> None:
    rider, other = screen.page(), screen.page()
    answers = [rider.ask("login", pin="1111")["why"] for _ in range(6)]
    assert answers == ["answer.wrong_pin"] * 4 + ["answer.wait"] * 2
    locked_s = screen.bench.now_s
    assert other.ask("login", pin=PIN)["why"] == "answer.wait"
    assert other.ask("stop")["ok"]
    screen.bench.run(29.9 - (screen.bench.now_s - locked_s))
    assert other.ask("login", pin=PIN)["why"] == "answer.wait"
    screen.bench.run(0.2)
    assert other.ask("login", pin=PIN)["ok"]
