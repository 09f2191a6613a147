"""The motion engine's status as the drive watch judges it."""

from __future__ import annotations

import dataclasses

import pytest

from robot_stack.safety.button import Contact
from robot_stack.safety.inputs import Axis, drive_reading
from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.axes import Flag, empty_snapshot


@pytest.mark.parametrize("contact", Contact)
def test_each_axis_and_the_button_as_the_engine_tells_them(contact: Contact) -> None:
    status = empty_snapshot(4)
    status.flags[Flag.SERVO_ON] = (1, 0, 0, 0)
    status.flags[Flag.AMP_ALARM] = (0, 1, 0, 0)
    status.flags[Flag.FOLLOWING_ERROR_ALARM] = (0, 0, 1, 0)
    status = dataclasses.replace(status, engine_state=EngineState.Communicating, cycle_counter=7)
    reading = drive_reading(status, contact)
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
    assert not drive_reading(status, Contact.RELEASED).communicating
