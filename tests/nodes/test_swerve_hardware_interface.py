"""The end of the hardware interface's process on a real engine process. Its behaviour: tests/simulated/nodes."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from custom_msgs.msg import SafetyStatus, SwerveModuleCommand, SwerveModuleCommandArray
from robot_stack.contract import topics
from robot_stack.contract.frames import DRIVE_AXES, STEER_AXES
from robot_stack.core.robot import load_robot
from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.simulated.channel import StatusView
from tests.support.engine import TestEngine
from tests.support.peer import Peer
from tests.support.processes import Start
from tests.support.waiting import DEADLINE_S, wait_for

ROBOT = load_robot()
DRIVES, STEERING = list(DRIVE_AXES), list(STEER_AXES)


def wheel_commands(speed_mps: float) -> SwerveModuleCommandArray:
    return SwerveModuleCommandArray(
        modules=[SwerveModuleCommand(module_id=i, drive_velocity=speed_mps) for i in range(4)]
    )


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hung"])
def test_way_of_the_wheels_without_their_interface(
    start: Start, peer: Peer, tmp_path: Path, number: signal.Signals
) -> None:
    """The engine brakes from 1.0 m/s by itself, after the last command's remaining time.

    The engine holds the headings.
    """
    engine = TestEngine(start, tmp_path).run()  # its device lets the engine outlive the interface
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state=SafetyStatus.NORMAL), 10.0)
    interface = start("swerve_hardware_interface")
    for row in (topics.WHEEL_COMMANDS, topics.SAFETY_STATUS, topics.EMERGENCY_STOP):
        peer.wait_matched(row)
    # The age limit only detects an engine that has ended; the status of a stalled engine is read again.
    view = StatusView(runtime_dir(), DEADLINE_S)

    def wait_status(holds: Callable[[StatusSnapshot], object], what: str) -> StatusSnapshot:
        def look() -> StatusSnapshot | None:
            code, snapshot = view.read()
            assert not code
            return snapshot if holds(snapshot) else None

        found = wait_for(look, what, poll_s=0.001)
        assert found is not None
        return found

    def wait_speed(speed_mps: float) -> StatusSnapshot:
        radps = speed_mps / ROBOT.wheel_radius_m
        return wait_status(
            lambda s: np.abs(s.actual_velocity[DRIVES] - radps).max() < 0.01 / ROBOT.wheel_radius_m, "the wheels' speed"
        )

    peer.repeat(topics.WHEEL_COMMANDS, lambda: wheel_commands(0.0), 20.0)
    wait_status(lambda s: s.servo_on.all(), "all servos on")
    peer.repeat(topics.WHEEL_COMMANDS, lambda: wheel_commands(1.0), 20.0)
    wait_speed(1.0)
    interface.signal(number)
    try:
        begun = view.read()[1]  # after the signal, because until then the interface commands
        wait_status(lambda s: not s.velocity_cmd.any(), "standstill")
        stands = wait_speed(0.0)
        distance_m = (stands.actual_pos - begun.actual_pos)[DRIVES].max() * ROBOT.wheel_radius_m
        assert distance_m < 0.5 * 1.0**2 / ROBOT.emergency_deceleration_mps2 + 0.25 * 1.0
        assert np.abs((stands.actual_pos - begun.actual_pos)[STEERING]).max() < 1e-3
        assert stands.servo_on.all()
    finally:
        interface.signal(signal.SIGCONT)
        engine.close()
