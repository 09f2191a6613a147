"""The motion engine's status as the drive watch judges it."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from robot_stack.core.robot import load_robot
from robot_stack.safety.button import Contact
from robot_stack.safety.inputs import Axis, LatchReading, drive_reading
from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.axes import Flag, empty_snapshot

LATCH = load_robot().latch


@pytest.mark.parametrize("contact", Contact)
def test_axes_and_button_follow_the_engine_status(contact: Contact) -> None:
    status = empty_snapshot(4)
    status.flags[Flag.SERVO_ON] = (1, 0, 0, 0)
    status.flags[Flag.AMP_ALARM] = (0, 1, 0, 0)
    status.flags[Flag.FOLLOWING_ERROR_ALARM] = (0, 0, 1, 0)
    status = dataclasses.replace(status, engine_state=EngineState.Communicating, cycle_counter=7)
    reading = drive_reading(status, contact, LATCH)
    assert (reading.communicating, reading.cycle, reading.button) == (True, 7, contact)
    assert reading.axes == (
        Axis(True, False, False),
        Axis(False, True, False),
        Axis(False, False, True),
        Axis(False, False, False),
    )


@pytest.mark.parametrize("state", [state for state in EngineState if state is not EngineState.Communicating])
def test_an_engine_in_any_other_state_does_not_communicate(state: EngineState) -> None:
    status = dataclasses.replace(empty_snapshot(1), engine_state=state)
    assert not drive_reading(status, Contact.RELEASED, LATCH).communicating
    assert drive_reading(status, Contact.RELEASED, LATCH).latch is None


@pytest.mark.parametrize(("closed", "open_", "opening"), list(itertools.product((False, True), repeat=3)))
def test_the_latch_as_its_bits_of_the_engine_show_it(closed: bool, open_: bool, opening: bool) -> None:
    status = dataclasses.replace(empty_snapshot(1), engine_state=EngineState.Communicating)
    inputs, outputs = np.zeros(LATCH.byte + 1, np.uint8), np.zeros(LATCH.byte + 1, np.uint8)
    inputs[LATCH.byte] = closed << LATCH.closed_input_bit | open_ << LATCH.open_input_bit
    outputs[LATCH.byte] = opening << LATCH.open_output_bit | 1 << LATCH.close_output_bit
    status = dataclasses.replace(status, inputs=inputs, outputs=outputs)
    latch = drive_reading(status, Contact.RELEASED, LATCH).latch
    assert latch == LatchReading(closed, open_, opening)
    assert (latch.confirmed, latch.contradictory) == (closed and not open_, closed and open_)
