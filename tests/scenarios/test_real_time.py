"""What only shows on the system clock: pauses of the machine, and a world that dies, which would stop /clock too."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from robot_stack.ros import transport
from robot_stack.supervisor.control import ask
from tests.support.environment import stack_environment
from tests.support.processes import ROOT
from tests.support.rights import needs_rights

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(180)


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
    stack.wait_safety("NORMAL")


@needs_rights
def test_programs_that_come_up_beside_the_robot_do_not_stop_it(stack: StackUnderTest) -> None:
    """Each has shared memory, as Fast DDS does by default: whoever has some too is held up by it.

    That may cost the perception a third of a second, for which the robot waits; it must not latch a stop.
    """
    stack.drive_at(0.4)
    before = len(stack.safety.items)
    for number in range(4):
        with short_lived_node(f"visitor_{number}"):
            pass
    heard = stack.safety.messages[before:]
    assert len(heard) > 20
    assert "EMERGENCY_STOP" not in {message.safety_state for message in heard}
    stack.wait_safety("NORMAL")
    stack.let_go()
    stack.wait_stands()


@contextmanager
def short_lived_node(name: str) -> Iterator[None]:
    """A plain rclpy program with the DDS settings of an installed ROS 2; ready when it has heard the robot."""
    environment = {**os.environ, "NAME": name}
    del environment[transport.PROFILE], environment[transport.REACH]
    program = [sys.executable, "-c", _VISITOR]
    with subprocess.Popen(program, env=environment, cwd=ROOT, stdout=subprocess.PIPE, text=True) as visitor:
        try:
            assert visitor.stdout is not None
            assert visitor.stdout.readline() == "heard\n"
            yield
        finally:
            visitor.kill()


_VISITOR = """
import os, time
import robot_stack.core.wheels_env, rclpy
from rclpy.node import Node
from robot_stack.contract import topics
from robot_stack.ros.interfaces import interface_class, qos_profile
rclpy.init()
node, heard = Node(os.environ["NAME"]), []
for row in (topics.SAFETY_STATUS, topics.JOINT_STATES):
    node.create_subscription(interface_class(row.type), row.name, heard.append, qos_profile(row.qos))
while len(heard) < 20:
    rclpy.spin_once(node)
print("heard", flush=True)
time.sleep(60.0)
"""


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
    if stack.safety.last.safety_state == "EMERGENCY_STOP":
        stack.release()
    stack.wait_safety("NORMAL", deadline_s=60.0)
    stack.drive_at(0.3)
    stack.let_go()


def test_the_world_and_its_engine_are_killed(stack: StackUnderTest) -> None:
    stack.drive_at(0.6)
    pid = stack.kill("sim_world")
    stack.wait_safety("EMERGENCY_STOP", "DRIVE_FAULT")
    stack.let_go()
    stack.wait_restarted("sim_world", pid)
    stack.truth.wait(lambda _: True, "ground truth")
    stack.release()
    stack.wait_safety("NORMAL", deadline_s=60.0)
    stack.drive_at(0.3)
