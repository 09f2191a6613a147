"""Arm and simulated engine together, through the client API used by nodes."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.wmx.api import Motion_PosCommand
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.simulated.library import library_of
from sim.arm.world import ArmWorld
from sim.plant.local_engine import LocalDevice, snapshot_of
from tests.unit.sim.arm.rig import DT_S, STRETCHED, arm_params


class EngineWithArm:
    def __init__(self) -> None:
        self.arm = ArmWorld(arm_params(start_rad=STRETCHED), DT_S)
        self.engine = Engine(load(EngineConfig, "wmx_engine_manipulator"), self.arm.bus)
        device = LocalDevice(self.engine)
        library = library_of(lambda: device)
        self.api = library.WMX3Api()
        self.core_motion, self.io = library.CoreMotion(self.api), library.Io(self.api)

    def cycle(self) -> None:
        self.engine.cycle()
        self.arm.step()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / DT_S)):
            self.cycle()

    def up(self) -> EngineWithArm:
        assert self.api.CreateDevice("") == 0
        self.communicate()
        return self

    def communicate(self) -> None:
        assert self.api.StartCommunication() == 0
        self.run(0.1)
        for axis in range(6):
            self.core_motion.axisControl.ClearAmpAlarm(axis)
        self.run(0.1)
        for axis in range(6):
            assert self.core_motion.axisControl.SetServoOn(axis, 1) == 0
        self.run(0.2)
        assert self.status.servo_on.all()

    def start(self, axis: int, target: float, velocity: float) -> None:
        command = Motion_PosCommand()
        command.axis, command.target = axis, target
        command.profile.velocity, command.profile.acc, command.profile.dec = velocity, 8.0, 8.0
        assert self.core_motion.motion.StartPos(command) == 0

    @property
    def status(self) -> StatusSnapshot:
        return snapshot_of(self.engine)


@pytest.fixture
def machine() -> EngineWithArm:
    return EngineWithArm().up()


def test_positions_are_the_joints_angles(machine: EngineWithArm) -> None:
    """Gravity shows in the torque: 36.1 Nm of 56 Nm rated, plus or minus friction, in the joint's direction."""
    np.testing.assert_allclose(machine.status.actual_pos, STRETCHED, atol=1e-3)
    torque = machine.status.actual_torque[1]
    assert torque == pytest.approx(-100.0 * 36.1 / 56.0, abs=100.0 * 3.0 / 56.0)
    assert machine.io.SetOutBit(0, 0, 1) == 0
    machine.start(1, 1.0, 1.0)
    machine.start(4, 0.5, 1.0)
    machine.run(1.2)
    status = machine.status
    assert status.in_pos.all()
    truth = machine.arm.truth().positions[:6]
    np.testing.assert_allclose(status.actual_pos, truth, atol=1e-4)
    assert truth[[1, 4]] == pytest.approx([1.0, 0.5], abs=1e-3)
    assert machine.arm.truth().positions[6:] == pytest.approx([0.045, 0.045], abs=1e-3), "the gripper has closed"


def test_an_alarm_in_motion_stops_its_axis(machine: EngineWithArm) -> None:
    machine.start(0, 1.5, 1.5)
    machine.run(0.5)
    machine.arm.bus.set_alarm(0, 0x4210)
    machine.run(0.3)
    status = machine.status
    assert status.amp_alarm.tolist() == [True] + 5 * [False]
    assert not status.servo_on[0]
    assert abs(machine.arm.truth().speeds[0]) < 0.02
    machine.arm.bus.set_alarm(0, 0)
    machine.communicate()
    assert not machine.status.amp_alarm.any()
