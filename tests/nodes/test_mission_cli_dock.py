"""``robot-stack dock`` and ``undock`` against real actions."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator

import pytest

from custom_msgs.action import Dock
from tests.support.docking import FakeDocking
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for


@pytest.fixture
def verb(start: Callable[..., NodeProcess]) -> Callable[..., NodeProcess]:
    return lambda *words: start("verb", command=[sys.executable, "-m", "robot_stack.cli", *words])


@pytest.fixture
def docking(ros_domain: int) -> Iterator[FakeDocking]:
    server = FakeDocking()
    yield server
    server.close()


def test_dock_shows_how_far_it_is(verb, docking):
    docked = verb("dock", "chair_1")
    assert docked.wait() == 0, docked.output()
    assert docked.output().splitlines() == [
        "SERVOING, 0.00 m, 0.0 deg",
        "FINE_ALIGN, 0.00 m, 0.0 deg",
        "docked to chair_1",
    ]
    assert docking.goals == [("dock", "chair_1")]


def test_undock(verb, docking):
    undocked = verb("undock")
    assert undocked.wait() == 0, undocked.output()
    assert undocked.output().splitlines()[-1] == "undocked and clear"
    assert docking.goals == [("undock", "")]


def test_a_failure_is_one_line_and_exit_code_1(verb, docking):
    docking.error = (Dock.Result.MARKERS_LOST, "the markers were lost")
    failed = verb("dock", "chair_1")
    assert failed.wait() == 1
    assert failed.output().splitlines()[-1] == "error: failed: the markers were lost (error 905)"


def test_a_rejected_goal(verb, docking):
    docking.rejects = True
    rejected = verb("dock", "chair_1")
    assert rejected.wait() == 1
    assert rejected.output().splitlines() == ["error: failed: docking_controller rejected the goal"]


def test_ctrl_c_cancels_and_waits_for_the_end(verb, docking):
    docking.hangs, docking.cancel_s = True, 0.5
    interrupted = verb("dock", "chair_1")
    interrupted.wait_output("FINE_ALIGN")
    interrupted.signal(signal.SIGINT)
    assert interrupted.wait() == 1
    assert docking.cancelled == 1
    assert interrupted.output().splitlines()[-1] == "error: failed: cancelled (error 914)"
    wait_for(lambda: docking._state == "IDLE", "the goal has ended")


def test_without_a_docking_controller(verb, ros_domain):
    alone = verb("dock", "chair_1", "--timeout", "0.5")
    assert alone.wait() == 1
    assert alone.output().splitlines() == ["error: no docking_controller offers /docking/dock: is it running?"]


def test_unknown_dock_is_reported_with_known_docks(verb, ros_domain):
    unknown = verb("dock", "chair_9")
    assert unknown.wait() == 1
    assert unknown.output().splitlines() == ["error: there is no dock 'chair_9'; known: chair_1, charger"]
