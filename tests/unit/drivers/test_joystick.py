"""The joystick: events byte by byte, and every way in which the grip can end."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.config import ConfigError, load
from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.drivers.joystick.events import Decoder, Event, EventRefused
from robot_stack.drivers.joystick.params import JoystickDriverParams
from robot_stack.drivers.joystick.teleop import Grip, Teleop
from tests.support.devices.joystick import axis, button

AHEAD, LEFT, TURN, DEAD_MAN = 1, 0, 3, 4


def params(**changes: object) -> JoystickDriverParams:
    return load(JoystickDriverParams, "joystick_driver", changes)


class Hand:
    """A hand on the joystick, with a fake clock."""

    def __init__(self) -> None:
        self.teleop, self.decoder, self.now_s = Teleop(params()), Decoder(), 100.0

    def does(self, *events: bytes) -> Hand:
        for event in self.decoder.feed(b"".join(events)):
            self.teleop.received(event, self.now_s)
        return self

    def waits(self, duration_s: float) -> Hand:
        self.now_s += duration_s
        return self

    def holds(self) -> Hand:
        return self.does(button(DEAD_MAN, True))

    @property
    def command(self) -> Twist2 | None:
        return self.teleop.command(self.now_s)


# --- events -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "event"),
    [
        ("10270000 0100 01 04", Event(True, 4, 1.0, False)),
        ("00000000 0000 01 04", Event(True, 4, 0.0, False)),
        ("00000000 0100 81 04", Event(True, 4, 1.0, True)),
        ("00000000 FF7F 02 01", Event(False, 1, 1.0, False)),
        ("00000000 0180 02 01", Event(False, 1, -1.0, False)),
        ("00000000 0080 02 01", Event(False, 1, -1.0, False)),
        ("00000000 0000 82 03", Event(False, 3, 0.0, True)),
    ],
)
def test_events_are_read_however_they_come(data: str, event: Event) -> None:
    raw = bytes.fromhex(data)
    assert Decoder().feed(raw) == [event]
    decoder = Decoder()
    assert [found for i in range(16) for found in decoder.feed((raw * 2)[i : i + 1])] == [event, event]


@pytest.mark.parametrize(
    ("data", "what"),
    [
        ("00000000 0100 00 04", "an event is of type 0x00, expected a button or an axis"),
        ("00000000 0100 03 04", "an event is of type 0x03"),
        ("00000000 0200 01 04", "button 4 is 2, expected 0 or 1"),
        ("00000000 FFFF 01 04", "button 4 is -1"),
    ],
)
def test_malformed_joystick_event_is_rejected(data: str, what: str) -> None:
    with pytest.raises(EventRefused, match=what):
        Decoder().feed(bytes.fromhex(data))


# --- the hand ---------------------------------------------------------------------------------------------------------


def test_nothing_is_commanded_without_the_button() -> None:
    hand = Hand().does(axis(AHEAD, -1.0), axis(TURN, 1.0), button(5, True))
    assert hand.command is None
    assert hand.teleop.grip is Grip.RELEASED


def test_held_dead_man_button_enables_stick_command() -> None:
    hand = Hand().holds()
    assert hand.command == ZERO_TWIST
    hand.does(axis(AHEAD, -1.0), axis(LEFT, -1.0), axis(TURN, 1.0))
    command = hand.command
    assert command is not None
    assert (command.vx, command.vy, command.omega) == pytest.approx((0.6, 0.4, -0.6))
    assert hand.teleop.command(float("nan")) is None


@pytest.mark.parametrize(
    ("value", "vx"), [(0.1, 0.0), (-0.1, 0.0), (-0.55, 0.3), (0.55, -0.3), (-1.0, 0.6), (1.0, -0.6)]
)
def test_a_command_grows_from_the_edge_of_the_dead_zone(value: float, vx: float) -> None:
    command = Hand().holds().does(axis(AHEAD, value)).command
    assert command is not None
    assert command.vx == pytest.approx(vx, abs=1e-4)


def test_a_release_commands_zero_and_then_leaves_the_drive() -> None:
    hand = Hand().holds().does(axis(AHEAD, -1.0)).waits(0.5).does(button(DEAD_MAN, False))
    assert hand.command == ZERO_TWIST
    assert hand.waits(0.3).command == ZERO_TWIST
    assert hand.waits(0.01).command is None
    assert hand.does(axis(AHEAD, -0.9)).command is None


def test_a_button_pressed_with_a_stick_out_must_be_released_first() -> None:
    hand = Hand().does(axis(AHEAD, -0.5)).holds()
    assert (hand.command, hand.teleop.grip) == (None, Grip.REFUSED)
    assert hand.does(axis(AHEAD, 0.0)).command is None, "the stick's way back is no press"
    assert hand.does(button(DEAD_MAN, True)).command is None
    assert hand.does(button(DEAD_MAN, False), button(DEAD_MAN, True)).command == ZERO_TWIST


def test_a_button_that_was_down_when_the_device_was_opened_must_be_released_first() -> None:
    hand = Hand().does(button(DEAD_MAN, True, initial=True), axis(AHEAD, 0.0, initial=True))
    assert (hand.command, hand.teleop.grip) == (None, Grip.REFUSED)
    assert hand.does(button(DEAD_MAN, False), button(DEAD_MAN, True)).command == ZERO_TWIST


def test_events_that_the_kernel_has_lost_are_a_release() -> None:
    """The kernel then sends the complete state, as when the device is opened."""
    hand = Hand().holds().does(axis(AHEAD, -1.0), button(DEAD_MAN, True, initial=True))
    assert (hand.command, hand.teleop.grip) == (ZERO_TWIST, Grip.REFUSED)


def test_a_hand_that_is_not_felt_any_more_is_gone() -> None:
    """The radio is out of reach: the button was never released."""
    hand = Hand().holds().does(axis(AHEAD, -1.0)).waits(1.0)
    assert hand.command != ZERO_TWIST
    assert hand.waits(0.01).command == ZERO_TWIST
    assert hand.waits(0.31).command is None
    assert hand.does(axis(AHEAD, -0.99)).command is None, "within reach again, it must be pressed anew"
    assert hand.does(button(DEAD_MAN, False), axis(AHEAD, 0.0)).holds().command == ZERO_TWIST


def test_a_device_that_is_pulled_is_a_release() -> None:
    hand = Hand().holds().does(axis(AHEAD, -1.0))
    hand.teleop.lost(hand.now_s)
    assert (hand.command, hand.teleop.grip) == (ZERO_TWIST, Grip.RELEASED)
    assert hand.waits(0.31).command is None
    assert hand.holds().command == ZERO_TWIST, "nothing is known of where the sticks stood before"


def test_emergency_stop_requires_new_dead_man_press() -> None:
    hand = Hand().holds().does(axis(AHEAD, -1.0))
    hand.teleop.stopped(hand.now_s)
    assert hand.command == ZERO_TWIST
    assert hand.waits(0.31).does(axis(AHEAD, -0.9)).command is None
    hand.does(axis(AHEAD, 0.0), button(DEAD_MAN, False))
    hand.teleop.stopped(hand.now_s)
    assert hand.teleop.grip is Grip.RELEASED
    assert hand.holds().command == ZERO_TWIST


@given(st.lists(st.tuples(st.integers(0, 7), st.booleans(), st.floats(-1.0, 1.0), st.floats(0.0, 2.0)), max_size=40))
def test_nothing_moves_but_by_a_held_and_felt_button(moves: list[tuple[int, bool, float, float]]) -> None:
    hand, down, felt_s = Hand(), False, 100.0
    for number, press, value, wait_s in moves:
        hand.waits(wait_s)
        if number == 7:
            hand.does(button(DEAD_MAN, press))
            down = press
        else:
            hand.does(axis(number, value))
        felt_s = hand.now_s
        command = hand.waits(0.5 * wait_s).command
        if command not in (None, ZERO_TWIST):
            assert down
            assert hand.now_s - felt_s <= 1.0
            assert abs(command.vx) <= 0.6
            assert abs(command.vy) <= 0.4
            assert abs(command.omega) <= 0.6


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("zero_s", 2.0), ("forward_mps", {"number": 1, "full": 3.0}), ("left_mps", {"number": 1, "full": 0.4}),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_refused(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=name):
        params(**{name: value})
