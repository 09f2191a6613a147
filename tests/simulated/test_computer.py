"""Faults of the computer, the external display and the screen: warnings that do not stop the robot."""

from __future__ import annotations

from robot_stack.contract import services, topics
from robot_stack.contract.model import Service
from robot_stack.core.robot import load_robot
from tests.simulated.shared import shared
from tests.simulated.stage import staged

SPEED_MPS = 0.3
# Code, service, fault, and the field of /robot_status that shows it.
TROUBLES: tuple[tuple[str, Service, str, str], ...] = (
    ("OVERHEAT", services.INJECT_COMPUTER_FAULT, "overheat", ""),
    ("MEMORY_HIGH", services.INJECT_COMPUTER_FAULT, "memory_high", "memory_usage_percent"),
    ("DISK_FULL", services.INJECT_COMPUTER_FAULT, "disk_full", "disk_usage_percent"),
    ("CPU_HIGH", services.INJECT_COMPUTER_FAULT, "cpu_high", "cpu_usage_percent"),
    ("EHMI_LINK_LOST", services.INJECT_EHMI_FAULT, "silent", ""),
    ("UI_LINK_LOST", services.INJECT_COMPUTER_FAULT, "screen_lost", ""),
)


@shared(staged)
def test_all_are_reported_while_the_robot_drives_on_and_end_with_their_causes() -> None:
    """/safety/status contains the rows and /robot_status the fields; all of them neither slow nor stop the robot."""
    full_mps = load_robot().empty.max_speed_mps
    with staged() as stage:
        status = stage.listen(topics.ROBOT_STATUS)
        stage.inject("clear", "screen_lost", into=services.INJECT_COMPUTER_FAULT)  # opens a page on the robot's screen
        stage.drive_at(SPEED_MPS)
        for _, service, kind, _ in TROUBLES:
            stage.inject(kind, into=service)
        for code, _, _, figure in TROUBLES:
            stage.wait_safety("DEGRADED", code, limit_s=60.0)
            status.wait(
                lambda message, code=code: code in message.active_faults and message.safety_state == "DEGRADED", code
            )
            if figure:
                assert getattr(status.last, figure) > 95.0
            # An unseen way limits too, for a moment.
            stage.limit.wait(lambda message: message.max_linear_velocity == full_mps, f"full speed in spite of {code}")
            assert stage.speed_mps > 0.9 * SPEED_MPS, code
        assert set(stage.safety.last.active_faults) == {code for code, *_ in TROUBLES}
        for _, service, kind, _ in TROUBLES:
            stage.inject("clear", kind, into=service)
        for code, *_ in TROUBLES:
            stage.safety.wait(lambda message, code=code: code not in message.active_faults, f"no {code}", 60.0)
            status.wait(lambda message, code=code: code not in message.active_faults, f"no {code}")
            assert stage.speed_mps > 0.9 * SPEED_MPS, code
        stage.wait_safety("NORMAL", limit_s=60.0)
        status.wait(lambda message: message.safety_state == "NORMAL", "NORMAL")
