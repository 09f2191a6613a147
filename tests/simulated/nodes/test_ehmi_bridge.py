"""The bridge to the external display and its simulated firmware, on a cable with realistic transmission times."""

from __future__ import annotations

import json
from typing import Any

import pytest
from std_msgs.msg import Bool

from custom_msgs.msg import DockingStatus, EHMIState, EHMIStatus, LatchStatus, MissionStatus, SafetyStatus
from custom_msgs.srv import InjectFault
from robot_stack.contract import services, topics
from robot_stack.contract.display import Display
from robot_stack.middleware.conversions import time_to_s
from tests.simulated.bench import Bench


class World:
    """A peer in place of the rest of the stack."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.safety = SafetyStatus(safety_state="NORMAL")
        self.shown, self.status = bench.listen(topics.SIM_EHMI_DISPLAY), bench.listen(topics.EHMI_STATUS)
        bench.repeat(topics.SAFETY_STATUS, lambda: self.safety, 20.0)
        bench.publisher(topics.EMERGENCY_STOP)

    def launch_display(self) -> World:
        self.display = self.bench.start("ehmi_display")
        return self

    def launch_bridge(self) -> World:
        self.bridge = self.bench.start("ehmi_bridge", {"port": "ehmi_display"})
        return self

    def ask(self, state: int, language: str = "en", volume: int = 4) -> None:
        self.bench.publish(topics.EHMI_STATE_COMMAND, EHMIState(state_num=state, language=language, volume=volume))

    def shows(self, state: int, limit_s: float = 10.0) -> dict[str, Any]:
        shown = self.shown.wait(
            lambda message: json.loads(message.data)["state"] == state, f"state {Display(state).name} shown", limit_s
        )
        return json.loads(shown.data)

    def status_is(self, linked: bool, state: int | None = None, fault: str | None = None) -> EHMIStatus:
        def matches(message: EHMIStatus) -> bool:
            known = state is None or message.acknowledged_state == state
            return message.linked == linked and known and fault in (None, message.firmware_fault)

        return self.status.wait(matches, f"linked {linked}, state {state}, fault {fault}")

    def inject(self, kind: str, target: str = "", value: float = 0.0) -> None:
        self.bench.inject(kind, target, value, into=services.INJECT_EHMI_FAULT)

    def clear(self) -> None:
        self.inject("clear")

    def safety_says(self, state: str) -> None:
        self.safety = SafetyStatus(safety_state=state)


@pytest.fixture
def empty(bench: Bench) -> World:
    return World(bench)


@pytest.fixture
def world(empty: World) -> World:
    """Bridge and display are linked and show the requested state."""
    empty.launch_display().launch_bridge()
    empty.ask(Display.NAVIGATING)
    empty.shows(Display.NAVIGATING)
    return empty


def test_a_state_with_its_language_and_volume_reaches_the_display(world):
    world.ask(Display.TRANSPORT, "zh", 9)
    shown = world.shows(Display.TRANSPORT)
    assert (shown["text"], shown["volume"], shown["colour"]) == ("载客自动行驶中", 9, "turquoise")
    status = world.status_is(True, Display.TRANSPORT, "")
    assert time_to_s(status.header.stamp) > 0.0


def test_status_is_published_at_1_hz_without_a_display(empty):
    empty.launch_bridge()
    status = empty.status_is(False, EHMIStatus.NO_STATE, "")
    assert not status.linked
    empty.bench.run(4.0)
    assert empty.status.period_s(3) == pytest.approx(1.0, abs=1e-6)


def test_invalid_commands_on_the_topic_are_ignored(world):
    world.ask(11)
    world.ask(29)
    world.ask(Display.IDLE, "de")
    world.ask(Display.IDLE, "en", 11)
    world.bench.run(2.0)
    assert "refused" in world.bench.log("ehmi_bridge")
    world.ask(Display.NAVIGATING, "en", 7)
    world.shown.wait(lambda message: json.loads(message.data)["volume"] == 7, "the next proper command")
    states = [json.loads(message.data)["state"] for message in world.shown.messages]
    assert Display.IDLE not in states


# --- states from other topics -----------------------------------------------------------------------------------------


def test_emergency_stop_has_priority_over_commands(world):
    world.bench.publish(topics.EMERGENCY_STOP, Bool(data=True))
    world.shows(Display.EMERGENCY_STOP)
    world.safety_says("EMERGENCY_STOP")
    world.ask(Display.IDLE)
    world.ask(Display.TRANSPORT)
    world.status_is(True, Display.EMERGENCY_STOP)
    begun_s = world.bench.now_s
    world.bench.run(3.0)
    assert {json.loads(message.data)["state"] for message in world.shown.since(begun_s)} == {Display.EMERGENCY_STOP}
    world.bench.publish(topics.EMERGENCY_STOP, Bool(data=False))
    world.safety_says("NORMAL")
    world.shows(Display.TRANSPORT)


def test_a_silent_safety_monitor_is_an_error_and_none_yet_is_dark(empty):
    empty.bench.silence(topics.SAFETY_STATUS)
    empty.launch_display().launch_bridge()
    empty.ask(Display.NAVIGATING)
    empty.status_is(True, Display.OFF)
    empty.bench.repeat(topics.SAFETY_STATUS, lambda: empty.safety, 20.0)
    empty.shows(Display.NAVIGATING)
    empty.bench.silence(topics.SAFETY_STATUS)
    empty.shows(Display.ERROR)


def test_a_false_on_passenger_attached_does_not_hide_a_passenger_on_the_latch(world):
    world.bench.repeat(topics.LATCH_STATUS, lambda: LatchStatus(closed=True, attached=True), 10.0)
    world.ask(Display.IDLE)
    world.shows(Display.PASSENGER_ONBOARD)
    world.bench.publish(topics.PASSENGER_ATTACHED, Bool(data=False))
    world.bench.run(1.0)
    world.shows(Display.PASSENGER_ONBOARD, 0.1)


def test_mission_docking_and_passenger_define_the_state(empty):
    bench = empty.bench
    bench.publish(topics.MISSION_STATUS, MissionStatus(state="RUNNING"))
    empty.launch_display().launch_bridge()
    empty.shows(Display.NAVIGATING)
    bench.repeat(topics.DOCKING_STATUS, lambda: DockingStatus(state="SERVOING"), 20.0)
    empty.shows(Display.DOCKING)
    empty.ask(Display.PAUSED)
    empty.shows(Display.PAUSED)
    bench.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    empty.ask(Display.IDLE)
    empty.shows(Display.PASSENGER_ONBOARD)


# --- the serial line -----------------------------------------------------------------------------------------------


def test_a_pulled_cable_and_back(world):
    world.inject("cable")
    world.status_is(False, Display.NAVIGATING)
    world.shows(Display.ERROR)  # without a host the display itself shows an error
    world.ask(Display.DOCKING)
    world.clear()
    world.shows(Display.DOCKING)
    world.status_is(True, Display.DOCKING)


def test_restarted_display_receives_the_state_again(world):
    world.inject("power")
    world.shows(Display.OFF)
    world.shows(Display.NAVIGATING)
    world.status_is(True, Display.NAVIGATING)


@pytest.mark.parametrize(("kind", "value"), [("silent", 0.0), ("noise", 0.5)])
def test_invalid_answers_lose_the_link_until_they_are_valid(world, kind, value):
    world.inject(kind, value=value)
    world.status_is(False)
    world.clear()
    world.status_is(True, Display.NAVIGATING)


def test_fault_of_the_display_is_reported_and_cleared(world):
    world.inject("fault_code", target="LED_DRIVER")
    world.status_is(True, None, "LED_DRIVER")
    world.clear()
    world.status_is(True, None, "")


def test_unknown_faults_are_refused(world):
    for kind, target in (("explode", ""), ("fault_code", "small letters"), ("cable", "left")):
        answer = world.bench.call(services.INJECT_EHMI_FAULT, InjectFault.Request(kind=kind, target=target))
        assert not answer.success
        assert answer.message


def test_a_bridge_that_ends_leaves_the_display_dark(world):
    assert world.bench.stop(world.bridge) == 0
    world.shows(Display.OFF, 1.0)


def test_a_bridge_that_is_killed_leaves_no_promise(world):
    killed_s = world.bench.now_s
    world.bridge.kill()
    world.shows(Display.ERROR)
    # The display receives its state once a second, and shows an error 3 s after the last message.
    assert 2.0 <= world.bench.now_s - killed_s <= 3.2
    world.bench.start_again(world.bridge)
    world.ask(Display.NAVIGATING)
    world.shows(Display.NAVIGATING)
