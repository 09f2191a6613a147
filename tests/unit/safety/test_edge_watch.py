"""The safety edge: a contact is an emergency stop that lasts until every side is free and a reset is granted."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.geometry import Twist2
from robot_stack.core.robot import SIDES, load_robot
from robot_stack.safety.button import Contact
from robot_stack.safety.edge_watch import EdgeWatch
from robot_stack.safety.inputs import CLEAR, EdgeReading, Finding, Level, drive_reading
from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from tests.unit.safety.story import PARAMS, Story

NORMAL, DEGRADED, AVOIDANCE, EMERGENCY = SafetyState
ROBOT = load_robot()
EDGE = ROBOT.safety_edge
assert EDGE is not None
FREE, FRONT = EdgeReading(), EdgeReading(("front",), relay_open=True)
UNKNOWN = Finding(Level.UNKNOWN)
DEBOUNCE_S = 0.01


def status(sides: tuple[str, ...], relay_open: bool, state: EngineState = EngineState.Communicating) -> StatusSnapshot:
    """The engine's status with these inputs open: 0."""
    assert EDGE is not None
    value = sum(1 << bit for side, bit in EDGE.side_bits.items() if side not in sides)
    inputs = np.zeros(EDGE.byte + 1, np.uint8)
    inputs[EDGE.byte] = value | (not relay_open) << EDGE.relay_input_bit
    return dataclasses.replace(empty_snapshot(8), engine_state=state, inputs=inputs)


@pytest.mark.parametrize("relay_open", [False, True])
@pytest.mark.parametrize("sides", [(), *((side,) for side in SIDES), SIDES])
def test_inputs_are_read_side_by_side(sides: tuple[str, ...], relay_open: bool) -> None:
    reading = drive_reading(status(sides, relay_open), Contact.RELEASED, ROBOT.latch, EDGE).edge
    assert reading == EdgeReading(sides, relay_open)
    assert reading.pressed == (bool(sides) or relay_open)


def test_inputs_that_are_all_zero_read_as_pressed_on_every_side() -> None:
    """The wires are cut, or the terminal has no supply."""
    assert EDGE is not None
    nothing = dataclasses.replace(status((), False), inputs=np.zeros(EDGE.byte + 1, np.uint8))
    assert drive_reading(nothing, Contact.RELEASED, ROBOT.latch, EDGE).edge == EdgeReading(SIDES, relay_open=True)


@pytest.mark.parametrize("state", [state for state in EngineState if state is not EngineState.Communicating])
def test_inputs_of_an_engine_that_does_not_communicate_cannot_be_read(state: EngineState) -> None:
    assert drive_reading(status((), False, state), Contact.RELEASED, ROBOT.latch, EDGE).edge is None


def test_a_robot_without_an_edge_has_no_reading_and_no_contact() -> None:
    assert drive_reading(status(SIDES, True), Contact.RELEASED, ROBOT.latch, None).edge is None
    watch = EdgeWatch(fitted=False, debounce_s=DEBOUNCE_S)
    watch.received(None, 1.0)
    assert watch.judge() == CLEAR


@pytest.mark.parametrize(
    ("reading", "detail"),
    [
        (FRONT, "safety edge pressed: front: remove the contact"),
        (EdgeReading(("left", "rear"), True), "safety edge pressed: left, rear: remove the contact"),
        (EdgeReading(("left",), False), "safety edge: left open, relay closed: check the wire and the relay"),
        (EdgeReading((), True), "safety edge: relay open, no side pressed: check the relay and its wire"),
    ],
)
def test_first_pressed_reading_is_an_emergency_that_names_the_inputs(reading: EdgeReading, detail: str) -> None:
    watch = EdgeWatch(fitted=True, debounce_s=DEBOUNCE_S)
    watch.received(reading, 1.0)
    assert watch.judge() == Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, detail=detail)


def test_inputs_that_cannot_be_read_neither_raise_nor_clear() -> None:
    watch = EdgeWatch(fitted=True, debounce_s=DEBOUNCE_S)
    assert watch.judge() == UNKNOWN
    watch.received(FREE, 1.0)
    assert watch.judge() == CLEAR
    watch.received(None, 1.1)
    assert watch.judge() == UNKNOWN
    watch.received(FRONT, 1.2)
    watch.received(None, 5.0)
    assert watch.judge().level is Level.PRESENT


def test_free_counts_after_the_debounce_without_a_break() -> None:
    watch = EdgeWatch(fitted=True, debounce_s=DEBOUNCE_S)
    watch.received(FRONT, 1.0)
    watch.received(FREE, 1.01)
    watch.received(None, 1.012)
    watch.received(FREE, 1.014)
    watch.received(FREE, 1.0235)
    assert watch.judge().level is Level.PRESENT
    watch.received(FREE, 1.0241)
    assert watch.judge() == CLEAR


def test_time_that_runs_backwards_frees_nothing() -> None:
    watch = EdgeWatch(fitted=True, debounce_s=DEBOUNCE_S)
    watch.received(FRONT, 5.0)
    for now_s in (6.0, 1.0, float("nan")):
        watch.received(FREE, now_s)
        assert watch.judge().level is Level.PRESENT


def test_a_contact_is_an_emergency_until_the_edge_is_free_and_reset() -> None:
    story = Story().healthy()
    story.wheel_radps = 0.3 / 0.0825
    story.run(0.2)
    story.edge = FRONT
    story.tick().expect(EMERGENCY, ("CONTACT",))
    assert story.monitor.details["CONTACT"] == "safety edge pressed: front: remove the contact"
    story.wheel_radps = 0.0
    story.run(2.0)
    answer = story.reset()
    assert answer.message == "refused: CONTACT: safety edge pressed: front: remove the contact"
    story.edge = FREE
    story.run(5.0).expect(EMERGENCY, ("CONTACT",))
    assert story.reset().message == "released: CONTACT"
    story.tick().expect(NORMAL, ())


def test_no_request_moves_the_robot_while_an_edge_is_pressed() -> None:
    story = Story().healthy()
    story.edge = FRONT
    for vx, vy, omega in itertools.product((-0.1, 0.1), (-0.1, 0.1), (-0.1, 0.1)):
        story.request = Twist2(vx, vy, omega)
        story.run(0.1).expect(EMERGENCY, ("CONTACT",), linear_mps=0.0, reason="CONTACT")


def test_a_second_side_is_named_and_blocks_the_reset() -> None:
    story = Story().healthy()
    story.edge = FRONT
    story.tick()
    story.edge = EdgeReading(("rear",), relay_open=True)
    story.run(1.0)
    assert story.reset().message == "refused: CONTACT: safety edge pressed: rear: remove the contact"


def test_a_contact_outlives_a_restart_of_the_monitor() -> None:
    story = Story().healthy()
    story.edge = FRONT
    story.tick()
    after = story.restarted().run(3.0).expect(EMERGENCY, ("CONTACT",))
    assert after.reset().success, "free and at standstill"


def test_an_edge_that_is_pressed_at_the_start_is_an_emergency() -> None:
    story = Story()
    story.edge = FRONT
    story.tick()
    assert "CONTACT" in story.verdict.faults
    assert story.verdict.state is EMERGENCY


def test_an_edge_that_cannot_be_read_is_a_fault_of_the_drives() -> None:
    """No contact is shown that did not happen. After a contact, the reset waits until the edge can be read."""
    story = Story().healthy()
    story.communicating, story.edge = False, None
    story.before(PARAMS.drive_silence_s).past().expect(EMERGENCY, ("DRIVE_FAULT",))
    story = Story().healthy()
    story.edge = FRONT
    story.tick()
    story.edge = None
    story.run(1.0)
    assert "CONTACT: safety edge pressed: front" in story.reset().message


def test_the_contact_ends_exactly_after_the_debounce_time() -> None:
    watch = EdgeWatch(fitted=True, debounce_s=0.25)  # a sum of powers of two: no rounding
    watch.received(FRONT, 1.0)
    watch.received(FREE, 1.5)
    watch.received(FREE, 1.625)
    assert watch.judge().level is Level.PRESENT
    watch.received(FREE, 1.75)
    assert watch.judge() == CLEAR
