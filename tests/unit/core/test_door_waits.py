"""The door for which the robot waits, as other nodes see it."""

from __future__ import annotations

from robot_stack.contract.states import DoorPhase
from robot_stack.core.doors import DoorWaits


def test_the_door_for_which_the_robot_waits() -> None:
    waits = DoorWaits(2.5)
    waits.on_request("inner", DoorPhase.WAITING, 10.0)
    waits.on_request("outer", DoorPhase.PASSING, 10.1)
    assert waits.text(10.2) == "waiting for door inner"
    waits.on_request("inner", DoorPhase.ASKING_STAFF, 11.0)
    assert waits.waiting(11.1) == ("inner", DoorPhase.ASKING_STAFF)
    assert waits.text(13.6) == "", "the requests have ended"
    waits.on_request("inner", DoorPhase.APPROACHING, 11.2)
    assert waits.waiting(11.3) is None
