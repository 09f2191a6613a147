"""The safety monitor as a process: its start, its end, and parameters that it refuses. See tests/simulated/nodes."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from robot_stack.contract import topics
from tests.support.processes import NodeProcess

if TYPE_CHECKING:
    from tests.support.peer import Peer

Start = Callable[..., NodeProcess]


def test_it_starts_and_its_last_word_on_sigterm_is_a_standstill(start: Start, peer: Peer) -> None:
    """With a list without items, which ROS hands over as no value at all, as `robot-stack up --only` sends it."""
    status, limit = peer.listen(topics.SAFETY_STATUS), peer.listen(topics.VELOCITY_LIMIT)
    monitor = start("safety_monitor", "-p", "rows:=[ESTOP_PRESSED]", "-p", "expected_processes:=[]")
    status.wait(lambda message: message.safety_state == "NORMAL", "NORMAL")
    limit.wait(lambda message: message.max_linear_velocity == 1.5, "the robot's own limit")
    monitor.signal(signal.SIGTERM)
    assert monitor.wait() == 0
    assert limit.wait(lambda message: message.max_linear_velocity == 0.0, "a standstill").reason == "NODE_DEAD"


@pytest.mark.parametrize(
    ("argument", "complaint"),
    [
        ("tilt_stop_deg:=1e9", "tilt_stop_deg"),
        ("rows:=[TILT]", "ESTOP_PRESSED must be among the rows"),
        ("rows:=[ESTOP_PRESSED, NO_SUCH]", "NO_SUCH is not a fault of the contract"),
        ("expected_processes:=[nobody]", "nobody is not a process"),
        ("no_such:=1", "no_such"),
    ],
)
def test_bad_parameters_stop_the_start(start: Start, argument: str, complaint: str) -> None:
    process = start("safety_monitor", "-p", argument)
    assert process.wait() == 2
    assert complaint in process.output()
    assert process.output().count("\n") == 1
