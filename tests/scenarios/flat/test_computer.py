"""What goes wrong with the computer, the external display and the screen, injected on one running stack in turn."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

from custom_msgs.srv import InjectFault
from robot_stack.contract import services, topics
from robot_stack.contract.model import Service
from robot_stack.core.robot import load_robot
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)
SPEED_MPS = 0.3
# Code, who is asked, which fault, and the figure of /robot_status that shows it.
TROUBLES: tuple[tuple[str, Service, str, str], ...] = (
    ("OVERHEAT", services.INJECT_COMPUTER_FAULT, "overheat", ""),
    ("MEMORY_HIGH", services.INJECT_COMPUTER_FAULT, "memory_high", "memory_usage_percent"),
    ("DISK_FULL", services.INJECT_COMPUTER_FAULT, "disk_full", "disk_usage_percent"),
    ("CPU_HIGH", services.INJECT_COMPUTER_FAULT, "cpu_high", "cpu_usage_percent"),
    ("EHMI_LINK_LOST", services.INJECT_EHMI_FAULT, "silent", ""),
    ("UI_LINK_LOST", services.INJECT_COMPUTER_FAULT, "screen_lost", ""),
)


def ask(stack: StackUnderTest, service: Service, kind: str, target: str = "") -> Any:
    return stack.peer.call(service, InjectFault.Request(kind=kind, target=target))


@contextmanager
def in_trouble(stack: StackUnderTest, service: Service, kind: str) -> Iterator[None]:
    answer = ask(stack, service, kind)
    if not answer.success and "namespaces" in answer.message:
        pytest.skip(answer.message)
    assert answer.success, answer.message
    try:
        yield
    finally:
        assert ask(stack, service, "clear", kind).success


@pytest.mark.parametrize(("code", "service", "kind", "figure"), TROUBLES, ids=[row[0] for row in TROUBLES])
def test_it_is_warned_of_while_the_robot_drives_on_and_is_over_with_its_cause(
    stack: StackUnderTest, code: str, service: Service, kind: str, figure: str
) -> None:
    """In the safety status, and in /robot_status with its figure; no row of these slows or stops anybody."""
    status, full_mps = stack.peer.listen(topics.ROBOT_STATUS), load_robot().empty.max_speed_mps
    stack.drive_at(SPEED_MPS)
    with in_trouble(stack, service, kind):
        stack.wait_safety("DEGRADED", code)
        status.wait(lambda m: code in m.active_faults and m.safety_state == "DEGRADED", f"{code} in /robot_status")
        if figure:
            assert getattr(status.last, figure) > 95.0
        # A way that has not been seen yet limits too, for a moment; a row that limits does it as long as it is raised.
        stack.limit.wait(lambda m: m.max_linear_velocity == full_mps, "the full speed allowed in spite of it")
        # The stick of this test may have been held up by a busy machine a moment ago.
        wait_for(lambda: stack.speed_mps > 0.9 * SPEED_MPS, "the robot drives on")
    stack.wait_safety("NORMAL")
    status.wait(lambda m: m.safety_state == "NORMAL" and code not in m.active_faults, f"no {code} in /robot_status")
    wait_for(lambda: stack.speed_mps > 0.9 * SPEED_MPS, "the robot still drives")
