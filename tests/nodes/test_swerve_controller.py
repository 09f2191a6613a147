"""The swerve controller as a process: start, end, refusals. What it does when: tests/simulated/nodes."""

from __future__ import annotations

import signal
from collections.abc import Callable

import pytest
from sensor_msgs.msg import JointState

from custom_msgs.msg import SwerveModuleCommandArray
from robot_stack.contract import topics
from robot_stack.contract.frames import JOINTS
from tests.support.peer import Peer
from tests.support.processes import NodeProcess

Start = Callable[..., NodeProcess]


def is_zero(message: SwerveModuleCommandArray) -> bool:
    return all(module.drive_velocity == 0.0 for module in message.modules)


def test_it_commands_standstill_refuses_a_second_one_and_leaves_in_order(start: Start, peer: Peer) -> None:
    commands = peer.listen(topics.WHEEL_COMMANDS)
    node = start("swerve_controller")
    peer.repeat(topics.JOINT_STATES, lambda: JointState(name=list(JOINTS), position=[0.0] * 8), 50.0)
    commands.wait(is_zero, "wheel commands")
    second = start("swerve_controller")
    assert second.wait() == 2
    assert "swerve_controller is already running" in second.output()
    node.signal(signal.SIGTERM)
    assert node.wait() == 0
    assert is_zero(commands.last)


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("odometry.slip_factor:=.nan", "odometry.slip_factor: Input should be"),
        ("no_such:=1", "no_such: is not a known parameter"),
    ],
)
def test_wrong_parameters_end_the_start(start: Start, argument: str, says: str) -> None:
    process = start("swerve_controller", "-p", argument)
    assert process.wait() == 2
    assert says in process.output()
