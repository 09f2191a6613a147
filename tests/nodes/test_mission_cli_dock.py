"""``robot-stack dock`` and ``undock`` against real actions."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator

import pytest

from custom_msgs.action import Dock
from tests.support.command_line import cli
from tests.support.docking import FakeDocking
from tests.support.processes import Start
from tests.support.waiting import wait_for


@pytest.fixture
def docking(ros_domain: int) -> Iterator[FakeDocking]:
    server = FakeDocking()
    yield server
    server.close()


def test_goals_their_progress_and_their_failure(docking: FakeDocking) -> None:
    docked = cli("dock", "chair_1")
    assert docked.stdout.splitlines() == [
        "SERVOING, 0.00 m, 0.0 deg",
        "FINE_ALIGN, 0.00 m, 0.0 deg",
        "docked to chair_1",
    ]
    undocked = cli("undock")
    assert undocked.stdout.splitlines()[-1] == "undocked and clear"
    assert (docked.returncode, undocked.returncode) == (0, 0)
    assert docking.goals == [("dock", "chair_1"), ("undock", "")]
    docking.error = (Dock.Result.MARKERS_LOST, "the markers were lost")
    failed = cli("dock", "chair_1")
    assert (failed.returncode, failed.stderr) == (1, "error: failed: the markers were lost (error 905)\n")
    docking.rejects = True
    rejected = cli("dock", "chair_1")
    assert (rejected.returncode, rejected.stderr) == (1, "error: failed: docking_controller rejected the goal\n")


def test_ctrl_c_cancels_and_waits_for_the_end(start: Start, docking: FakeDocking) -> None:
    docking.hangs, docking.cancel_s = True, 0.5
    interrupted = start("verb", command=[sys.executable, "-m", "robot_stack.cli", "dock", "chair_1"])
    interrupted.wait_output("FINE_ALIGN")
    interrupted.signal(signal.SIGINT)
    assert interrupted.wait() == 1
    assert docking.cancelled == 1
    assert interrupted.output().splitlines()[-1] == "error: failed: cancelled (error 914)"
    wait_for(docking.idle, "the goal has ended")
