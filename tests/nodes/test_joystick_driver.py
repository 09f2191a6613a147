"""The joystick driver on a device file: commands while the button is held, and every condition that ends them."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Bool

from robot_stack.contract import topics
from tests.support.devices.joystick import Joystick, axis, button
from tests.support.fake_safety import FakeSafety
from tests.support.peer import Peer, Received, says
from tests.support.processes import Start
from tests.support.waiting import wait_for

NAME = "joystick_driver"
AHEAD, DEAD_MAN = 1, 4
TREMBLE_S = 0.05


class Hand:
    """Holds the button and the stick ahead, with the tremor of a hand."""

    def __init__(self, joystick: Joystick) -> None:
        self.joystick = joystick
        self.trembles = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def drives(self) -> None:
        self.joystick.send(axis(AHEAD, 0.0), button(DEAD_MAN, False), button(DEAD_MAN, True), axis(AHEAD, -1.0))
        self.trembles = True

    def _run(self) -> None:
        number = 0
        while not self._ended.wait(TREMBLE_S):
            number += 1
            if self.trembles:
                self.joystick.send(axis(AHEAD, -1.0 + 0.001 * (number % 2)))

    def close(self) -> None:
        self._ended.set()
        self._thread.join()


@pytest.fixture
def joystick(ros_domain: int) -> Iterator[Joystick]:
    folder = Path(os.environ["ROBOT_STACK_RUNTIME_DIR"])
    folder.mkdir(parents=True, exist_ok=True)
    joystick = Joystick(folder / "js")
    yield joystick
    joystick.pull()


@pytest.fixture
def hand(joystick: Joystick) -> Iterator[Hand]:
    hand = Hand(joystick)
    yield hand
    hand.close()


def drives(commands: Received) -> TwistStamped:
    return commands.wait(lambda message: message.twist.linear.x > 0.55, "a command to drive")


def comes_to_rest(commands: Received, diagnostics: Received, text: str) -> None:
    """Checks that zero is commanded and nothing else follows until the next report."""
    commands.wait(lambda message: message.twist.linear.x == 0.0, "zero")
    count = len(commands.items)
    says(diagnostics, NAME, text)
    assert all(message.twist.linear.x == 0.0 for message in commands.messages[count:])


def test_commands_while_the_button_is_held(start: Start, peer: Peer, joystick: Joystick, hand: Hand) -> None:
    commands, diagnostics = peer.listen(topics.TELEOP_CMD_VEL), peer.listen(topics.DIAGNOSTICS)
    safety = FakeSafety(peer)
    process = start(NAME, "-p", "device:=js")
    says(diagnostics, NAME, "No such file or directory")
    joystick.plug()
    says(diagnostics, NAME, "the joystick is connected")
    assert not commands.items
    hand.drives()
    command = drives(commands)
    assert command.header.frame_id == "base_link"
    wait_for(lambda: len(commands.items) > 20, "commands at 20 Hz")
    # The button is released.
    hand.trembles = False
    joystick.send(button(DEAD_MAN, False))
    comes_to_rest(commands, diagnostics, "the joystick is connected")
    # Without events the driver stops, although the button is not released.
    hand.drives()
    drives(commands)
    hand.trembles = False
    comes_to_rest(commands, diagnostics, "the joystick is connected")
    # The cable is pulled while the button is held, and plugged in again.
    hand.drives()
    drives(commands)
    hand.trembles = False
    joystick.pull()
    comes_to_rest(commands, diagnostics, "No such file or directory")
    joystick.plug()
    says(diagnostics, NAME, "the joystick is connected")
    hand.drives()
    drives(commands)
    # An emergency stop while the button is held: after its end only a new press moves the robot.
    wait_for(lambda: peer.publisher(topics.EMERGENCY_STOP).get_subscription_count() >= 1, "the driver listens")
    peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    comes_to_rest(commands, diagnostics, "the joystick is connected")
    safety.active = False
    peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    count = len(commands.items)
    says(diagnostics, NAME, "the joystick is connected")
    assert len(commands.items) == count
    hand.drives()
    drives(commands)
    # A malformed event ends a command too, and so does the end of the driver.
    hand.trembles = False
    joystick.send(bytes(8))
    comes_to_rest(commands, diagnostics, "")
    hand.drives()
    drives(commands)
    process.stop()
    commands.wait(lambda message: message.twist.linear.x == 0.0, "zero as the last word")
