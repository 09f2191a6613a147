"""The emergency stop button: when it publishes a state and when it publishes nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robot_stack.safety.button import Contact, EmergencyButton, read_contact
from robot_stack.wmx.axes import EngineState, StatusSnapshot, empty_snapshot

RELEASED, PRESSED, UNREADABLE = Contact.RELEASED, Contact.PRESSED, Contact.UNREADABLE


class Desk:
    """Reads the contact every 4 ms."""

    def __init__(self) -> None:
        self.button, self.now_s, self.said = EmergencyButton(0.010, 5.0), 50.0, list[bool]()

    def hold(self, contact: Contact, seconds: float = 0.1) -> list[bool]:
        """Returns the states published while the contact had this value."""
        before = len(self.said)
        for _ in range(round(seconds / 0.004)):
            self.now_s += 0.004
            say = self.button.update(contact, self.now_s)
            if say is not None:
                self.said.append(say)
        return self.said[before:]


def status(state: EngineState, byte_1: int) -> StatusSnapshot:
    return replace(empty_snapshot(), engine_state=state, inputs=np.array([0, byte_1], np.uint8))


def test_a_closed_contact_is_released_and_a_cut_wire_pressed() -> None:
    communicating = EngineState.Communicating
    assert read_contact(status(communicating, 0b0100), 1, 2) is RELEASED
    assert read_contact(status(communicating, 0b1011), 1, 2) is PRESSED
    assert read_contact(status(EngineState.Running, 0b0100), 1, 2) is UNREADABLE
    assert read_contact(None, 1, 2) is UNREADABLE


def test_an_engine_that_is_still_starting_is_no_press() -> None:
    desk = Desk()
    assert desk.hold(UNREADABLE, 30.0) == []
    assert desk.button.pressed is None
    assert not desk.button.contradicts(False)


def test_released_button_at_the_start_publishes_no_press() -> None:
    desk = Desk()
    assert desk.hold(RELEASED) == []
    assert desk.button.pressed is False


def test_pressed_button_at_the_start_publishes_one_press() -> None:
    assert Desk().hold(PRESSED, 5.0) == [True]


def test_press_and_release() -> None:
    desk = Desk()
    desk.hold(RELEASED)
    assert desk.hold(PRESSED, 5.0) == [True]
    assert desk.button.pressed is True
    assert desk.hold(RELEASED, 5.0) == [False]
    assert desk.hold(PRESSED) == [True]


def test_a_bounce_is_no_press() -> None:
    desk = Desk()
    desk.hold(RELEASED)
    assert desk.hold(PRESSED, 0.008) == []
    assert desk.hold(RELEASED) == []


def test_a_machine_that_stutters_while_it_starts_is_no_press() -> None:
    desk = Desk()
    for _ in range(10):
        assert desk.hold(RELEASED, 4.5) == []
        assert desk.hold(UNREADABLE, 1.0) == []
    assert desk.button.pressed is False
    assert desk.button.settled is False
    assert desk.hold(PRESSED) == [True]
    assert desk.hold(UNREADABLE) == []
    assert desk.button.pressed is True


def test_exactly_the_settling_time_is_enough() -> None:
    button = EmergencyButton(0.25, 1.0)
    assert button.settled is False
    for now_s in (8.0, 8.5, 9.0):
        button.update(RELEASED, now_s)
    button.update(UNREADABLE, 9.25)
    assert button.update(UNREADABLE, 9.5) is True


def test_once_settled_an_unreadable_contact_is_pressed() -> None:
    desk = Desk()
    desk.hold(RELEASED, 5.1)
    assert desk.button.settled
    assert desk.hold(UNREADABLE) == [True]
    assert desk.hold(PRESSED) == []
    assert desk.hold(UNREADABLE) == []
    assert desk.hold(RELEASED) == [False]


def test_intermittent_readings_at_the_start_do_not_settle() -> None:
    desk = Desk()
    for _ in range(10):
        assert desk.hold(RELEASED, 0.008) == []
        assert desk.hold(PRESSED, 0.008) == []
    assert desk.button.pressed is None


@pytest.mark.parametrize(
    ("contact", "received", "contradicts"),
    [(PRESSED, False, True), (PRESSED, True, False), (RELEASED, False, False), (RELEASED, True, False)],
)
def test_only_a_pressed_button_contradicts_and_only_a_release(
    contact: Contact, received: bool, contradicts: bool
) -> None:
    desk = Desk()
    desk.hold(contact)
    assert desk.button.contradicts(received) is contradicts
