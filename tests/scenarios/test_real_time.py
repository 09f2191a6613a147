"""What only shows on the system clock: pauses of the machine, and a world that dies, which would stop /clock too."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from robot_stack.supervisor.control import ask
from tests.support.environment import stack_environment

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


@pytest.fixture(scope="module")
def module_stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StackUnderTest]:
    folder = tmp_path_factory.mktemp("stack")
    with stack_environment(folder):
        from tests.support.stack import FLAT, StackUnderTest

        stack = StackUnderTest(folder / "logs", *FLAT, system_time=True)
        yield stack
        stack.close()


@pytest.fixture
def stack(module_stack: StackUnderTest) -> StackUnderTest:
    module_stack.make_ready()
    return module_stack


@pytest.mark.parametrize("seconds", [0.8, 2.0])
def test_a_pause_of_the_machine_ends_in_a_stop_that_an_operator_can_release(
    stack: StackUnderTest, seconds: float
) -> None:
    stack.drive_at(0.4)
    pause(stack, seconds)
    stack.wait_safety("EMERGENCY_STOP")
    stack.wait_stands(5.0)
    stack.let_go()
    stack.release()
    stack.settle()


def pause(stack: StackUnderTest, seconds: float) -> None:
    """All processes of the stack stand still for so long, as on a virtual machine that is held."""
    pids = [int(item["pid"]) for item in ask("status")["processes"]]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)
    for pid in pids:
        os.kill(pid, signal.SIGCONT)


def test_the_controller_is_killed_and_the_robot_stands_before_it_is_back(stack: StackUnderTest) -> None:
    stack.drive_at(0.6)
    pid = stack.kill("swerve_controller")
    stack.wait_stands(6.0)
    stack.let_go()
    stack.wait_restarted("swerve_controller", pid)
    stack.settle()
    stack.drive_at(0.3)
    stack.let_go()


def test_the_world_and_its_engine_are_killed(stack: StackUnderTest) -> None:
    stack.drive_at(0.6)
    pid = stack.kill("sim_world")
    stack.wait_safety("EMERGENCY_STOP", "DRIVE_FAULT")
    stack.let_go()
    stack.wait_restarted("sim_world", pid)
    stack.truth.wait(lambda _: True, "ground truth")
    stack.settle()
    stack.drive_at(0.3)
