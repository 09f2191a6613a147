"""The stack on the system clock, where the world waits for nothing, as on the robot. No durations are checked."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.environment import stack_environment

pytestmark = pytest.mark.timeout(900)


def test_the_stack_starts_on_the_system_clock_and_a_stop_by_message_is_latched(tmp_path: Path) -> None:
    with stack_environment(tmp_path):
        from custom_msgs.msg import SafetyStatus
        from robot_stack.contract import services, topics
        from robot_stack.supervisor import client
        from tests.support.peer import Peer
        from tests.support.stack import FLAT

        client.start(client.Launch("sim", FLAT, log_dir=tmp_path / "logs", system_time=True), 90.0)
        try:
            peer = Peer("scenario_peer")
            safety = peer.listen(topics.SAFETY_STATUS)
            source = peer.stop_source()
            peer.wait_matched(topics.EMERGENCY_STOP)
            peer.wait_matched(topics.EMERGENCY_STOP_SOURCES)
            safety.wait(lambda _: True, "a safety status")
            source.publish(True)
            safety.wait(
                lambda status: (
                    status.safety_state == SafetyStatus.EMERGENCY_STOP and "ESTOP_PRESSED" in status.active_faults
                ),
                "the emergency stop",
            )
            assert not peer.call(services.SAFETY_RESET).success, "the source has not released its press"
            peer.close()
        finally:
            client.stop()
