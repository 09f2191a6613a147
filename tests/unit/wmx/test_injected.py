"""The port with access to drives and server: faults that no client can cause. Its conformance: test_process.py."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest

from robot_stack.wmx import EngineError, connect
from robot_stack.wmx.api import (
    Config_FollowingErrorAlarmType,
    Config_VelocityFollowingErrorAlarmType,
    CoreMotionErrorCode,
    EngineState,
    ErrorCode,
    EStopLevel,
    OperationState,
)
from robot_stack.wmx.axes import Flag, Real
from tests.support.waiting import wait_for
from tests.unit.wmx.conformance import GOOD, LONG_WAY, SLOW, along, cruising, in_state, pos, vel
from tests.unit.wmx.harness import (
    POS,
    VEL,
    VEL_MIRRORED,
    ThreadHarness,
    engine_in_thread,
    engine_state,
    runtime_folder,
    some_cycles,
    status,
    wait_status,
)

ALARM = 42


@pytest.fixture
def harness() -> Iterator[ThreadHarness]:
    with engine_in_thread() as harness:
        yield harness
        harness.end_test()


class TestDriveAlarm:
    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_alarm_ends_motion_and_switches_the_servo_off(self, harness: ThreadHarness, axis: int) -> None:
        engine = harness.ready()
        engine.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW))
        engine.core_motion.velocity.StartVel(vel(VEL, 2.0))
        wait_status(engine, lambda now: cruising(POS, 2.0)(now) and cruising(VEL, 2.0)(now), "both axes moving")
        harness.drives.alarms[axis] = ALARM
        snapshot = wait_status(engine, lambda now: now.amp_alarm[axis] and not now.servo_on[axis], "the alarm")
        assert snapshot.amp_alarm_code[axis] == ALARM
        assert snapshot.op_state[axis] == OperationState.Idle
        assert not snapshot.motion_complete[axis]
        assert not snapshot.servo_requested[axis], "it does not come back by itself"
        other = VEL if axis == POS else POS
        assert snapshot.op_state[other] != OperationState.Idle, "other axes go on"

    def test_nothing_starts_with_an_alarm_until_it_is_cleared(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        control = engine.core_motion.axisControl
        harness.drives.alarms[POS] = ALARM
        wait_status(engine, lambda now: now.amp_alarm[POS], "the alarm")
        assert engine.core_motion.motion.StartPos(pos(POS, 1.0)) == ErrorCode.AxisAmpAlarm
        assert control.SetServoOn(POS, 1) == ErrorCode.AxisAmpAlarm
        assert control.ClearAxisAlarm(POS) == GOOD, "clears the engine's alarm, not the drive's"
        assert some_cycles(engine, 30).amp_alarm[POS]
        assert control.ClearAmpAlarm(POS) == GOOD
        snapshot = wait_status(engine, lambda now: not now.amp_alarm[POS], "the alarm to go")
        assert snapshot.amp_alarm_code[POS] == 0
        assert not some_cycles(engine, 30).servo_on[POS], "the servo stays off"
        assert control.SetServoOn(POS, 1) == GOOD
        wait_status(engine, lambda now: now.servo_on[POS], "servo on")
        assert engine.core_motion.motion.StartPos(pos(POS, 1.0)) == GOOD

    def test_clearing_alarm_with_remaining_cause_keeps_alarm(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        harness.drives.stubborn = True
        harness.drives.alarms[POS] = ALARM
        wait_status(engine, lambda now: now.amp_alarm[POS], "the alarm")
        assert engine.core_motion.axisControl.ClearAmpAlarm(POS) == GOOD, "a request, no promise"
        assert some_cycles(engine, 50).amp_alarm[POS]

    def test_servo_that_drops_out_by_itself(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        engine.core_motion.velocity.StartVel(vel(VEL, 2.0))
        wait_status(engine, cruising(VEL, 2.0), "motion")
        harness.drives.broken[VEL] = True
        snapshot = wait_status(engine, lambda now: not now.servo_on[VEL], "the drop-out")
        assert snapshot.op_state[VEL] == OperationState.Idle
        harness.drives.broken[VEL] = False
        assert not some_cycles(engine, 50).servo_on[VEL], "it has to be switched on again"
        assert engine.core_motion.axisControl.SetServoOn(VEL, 1) == GOOD
        wait_status(engine, lambda now: now.servo_on[VEL], "servo on")


class TestFollowingError:
    def test_frozen_encoder_in_position_mode(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        _, param = config.GetAlarmParam(POS)
        param.followingErrorMoving = param.followingErrorStopped = 0.2
        param.followingErrorType = Config_FollowingErrorAlarmType.QuickStop
        assert config.SetAlarmParam(POS, param)[0] == GOOD
        engine.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW))
        wait_status(engine, cruising(POS, 2.0), "motion")
        harness.drives.frozen[POS] = True
        snapshot = wait_status(engine, lambda now: now.following_error_alarm[POS], "the alarm")
        assert abs(snapshot.reals[Real.FOLLOWING_ERROR, POS]) > 0.2
        wait_status(engine, in_state(POS, OperationState.Idle), "the quick stop")
        assert engine.core_motion.motion.StartPos(pos(POS, 0.0)) == ErrorCode.AxisAmpAlarm

    def test_alarm_is_cleared_by_its_own_call_and_comes_back_with_its_cause(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        config, control = engine.core_motion.config, engine.core_motion.axisControl
        _, param = config.GetAlarmParam(POS)
        param.followingErrorStopped = 0.1
        config.SetAlarmParam(POS, param)
        harness.drives.frozen[POS] = True
        assert engine.core_motion.motion.StartPos(pos(POS, 0.5)) == GOOD
        wait_status(engine, lambda now: now.following_error_alarm[POS], "the alarm, once at rest")
        assert control.ClearAmpAlarm(POS) == GOOD
        assert some_cycles(engine, 30).following_error_alarm[POS], "another call clears it"
        assert control.ClearAxisAlarm(POS) == GOOD
        assert some_cycles(engine, 5).following_error_alarm[POS], "its cause is still there"
        harness.drives.frozen[POS] = False
        wait_status(engine, lambda now: abs(now.reals[Real.FOLLOWING_ERROR, POS]) < 0.01, "the feedback")
        assert control.ClearAxisAlarm(POS) == GOOD
        assert not some_cycles(engine, 5).following_error_alarm[POS]

    def test_frozen_encoder_in_velocity_mode(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        _, param = config.GetAlarmParam(VEL)
        param.velocityFollowingErrorMoving = 1.0
        param.velocityFollowingErrorMovingMilliseconds = 50.0
        param.velocityFollowingErrorType = Config_VelocityFollowingErrorAlarmType.QuickStop
        assert config.SetAlarmParam(VEL, param)[0] == GOOD
        engine.core_motion.velocity.StartVel(vel(VEL, 5.0, acc=50.0))
        wait_status(engine, lambda now: abs(now.actual_velocity[VEL] - 5.0) < 0.1, "motion without an alarm")
        assert not status(engine).following_error_alarm[VEL]
        harness.drives.frozen[VEL] = True
        wait_status(engine, lambda now: now.following_error_alarm[VEL], "the alarm")
        wait_status(engine, in_state(VEL, OperationState.Idle), "the quick stop")
        assert engine.core_motion.velocity.StartVel(vel(VEL, 1.0)) == ErrorCode.AxisAmpAlarm
        assert engine.core_motion.axisControl.SetServoOn(VEL, 1) == CoreMotionErrorCode.ServoOnError

    def test_alarm_without_action_only_reports(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        _, param = config.GetAlarmParam(POS)
        param.followingErrorMoving = 0.1
        param.followingErrorType = Config_FollowingErrorAlarmType.NoAction
        config.SetAlarmParam(POS, param)
        engine.core_motion.motion.StartPos(along(POS, 2.0))
        harness.drives.frozen[POS] = True
        wait_status(engine, lambda now: now.following_error_alarm[POS], "the alarm")
        assert some_cycles(engine, 20).op_state[POS] == OperationState.Pos


class TestBusLoss:
    def test_lost_bus_leaves_communication_for_good(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        engine.core_motion.velocity.StartVel(vel(VEL, 2.0))
        wait_status(engine, cruising(VEL, 2.0), "motion")
        harness.drives.inputs[0] = 255
        wait_status(engine, lambda now: now.inputs[0] == 255, "the inputs")
        harness.drives.connected = False
        snapshot = wait_status(engine, lambda now: not now.communicating, "the loss")
        assert snapshot.engine_state is EngineState.Running
        assert snapshot.engine_error == ErrorCode.ServoOffline
        assert engine.api.GetEngineStatus()[1].error == ErrorCode.ServoOffline
        assert not snapshot.servo_on.any()
        assert (snapshot.op_state == OperationState.Idle).all()
        assert (snapshot.velocity_cmd == 0.0).all()
        assert (snapshot.flags[Flag.SERVO_OFFLINE] == 1).all()
        assert not snapshot.input_bit(0, 0), "a dead bus has no inputs"
        assert engine.core_motion.velocity.StartVel(vel(VEL, 2.0)) == ErrorCode.CommNotStarted
        harness.drives.connected = True
        assert not some_cycles(engine, 100).communicating, "it does not come back by itself"
        assert engine.api.StartCommunication(20000) == GOOD
        snapshot = status(engine)
        assert snapshot.engine_error == GOOD
        assert not snapshot.servo_on.any()

    def test_communication_never_starts_without_a_bus(self, harness: ThreadHarness) -> None:
        engine = harness.connect()
        harness.drives.connected = False
        assert engine.api.StartCommunication(50) == ErrorCode.CommNotStartedInSpecifiedTime
        assert status(engine).engine_state is EngineState.Running
        harness.drives.connected = True
        wait_status(engine, lambda now: now.communicating, "communication, late")

    def test_estop_outlives_the_bus(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        engine.core_motion.ExecEStop(EStopLevel.Level1)
        harness.drives.connected = False
        snapshot = wait_status(engine, lambda now: not now.communicating, "the loss")
        assert snapshot.emergency_stop


class TestEStopSignal:
    def enable(self, harness: ThreadHarness) -> None:
        """Configures input 0.0, normally closed, as the emergency stop."""
        harness.drives.inputs[0] = 1
        engine = harness.connect("configurator")
        config = engine.core_motion.config
        _, param = config.GetEmergencyStopParam()
        param = replace(param, enableEStopSignal=True, invertEStopSignalPolarity=True)
        assert config.SetEmergencyStopParam(param)[0] == GOOD

    def test_signal_stops_and_holds_until_released(self, harness: ThreadHarness) -> None:
        self.enable(harness)
        engine = harness.ready()
        engine.core_motion.velocity.StartVel(vel(VEL, 2.0))
        wait_status(engine, cruising(VEL, 2.0), "motion")
        harness.drives.inputs[0] = 0
        wait_status(engine, lambda now: now.emergency_stop and now.op_state[VEL] == OperationState.Idle, "the stop")
        assert engine.core_motion.ReleaseEStop() == CoreMotionErrorCode.EmergencyStopSignalOn
        harness.drives.inputs[0] = 1
        wait_status(engine, lambda now: now.input_bit(0, 0), "the button up")
        assert some_cycles(engine, 20).emergency_stop, "letting go does not release"
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert not some_cycles(engine, 20).emergency_stop

    def test_final_level_by_signal(self, harness: ThreadHarness) -> None:
        self.enable(harness)
        engine = harness.ready()
        _, param = engine.core_motion.config.GetEmergencyStopParam()
        engine.core_motion.config.SetEmergencyStopParam(replace(param, eStopSignalLevel=EStopLevel.Final))
        harness.drives.inputs[0] = 0
        snapshot = wait_status(engine, lambda now: not now.servo_on.any(), "servos off")
        assert snapshot.emergency_stop_level == EStopLevel.Final


class TestInputs:
    def test_bits_and_bytes(self, harness: ThreadHarness) -> None:
        engine = harness.communicating()
        harness.drives.inputs.update({0: 0b101, 3: 200})
        snapshot = wait_status(engine, lambda now: now.inputs.tolist() == [5, 0, 0, 200], "the inputs")
        assert snapshot.input_bit(0, 2)
        assert not snapshot.input_bit(0, 1)
        assert not snapshot.input_bit(99, 0), "beyond the image reads 0"
        assert not some_cycles(engine, 20).emergency_stop, "no input is an emergency stop by itself"

    def test_outputs_reach_the_bus(self, harness: ThreadHarness) -> None:
        engine = harness.communicating()
        assert engine.io.SetOutBit(0, 2, 1) == engine.io.SetOutBit(1, 3, 1) == GOOD
        wait_for(lambda: harness.drives.outputs.tolist() == [4, 8, 0, 0], "the outputs on the bus")
        assert status(engine).output_bit(1, 3)

    def test_torque_has_the_users_sign(self, harness: ThreadHarness) -> None:
        engine = harness.communicating()
        harness.drives.torque_percent[:] = 12.5
        snapshot = wait_status(engine, lambda now: now.actual_torque[VEL] == 12.5, "the torque")
        assert snapshot.actual_torque[VEL_MIRRORED] == -12.5


class TestCreationLock:
    def test_locked_device_creation_returns_error_immediately(self, harness: ThreadHarness) -> None:
        engine = harness.connect()
        engine.close()
        harness.server.inject_create_lock(60.0)
        assert engine.api.CreateDevice(str(harness.folder), 0, 0) == ErrorCode.CreateDeviceLockError == 297
        harness.server.inject_create_lock(0.0)
        assert engine.api.CreateDevice(str(harness.folder), 0, 20000) == GOOD

    def test_connect_gives_up_with_the_vendors_code(self, harness: ThreadHarness) -> None:
        harness.server.inject_create_lock(60.0)
        with pytest.raises(EngineError, match="CreateDeviceLockError") as raised:
            connect("impatient", harness.config, timeout_s=0.05)
        assert raised.value.code == ErrorCode.CreateDeviceLockError
        harness.server.inject_create_lock(0.0)


def test_several_nodes_starting_at_once_all_get_in() -> None:
    """A creation takes 50 ms and locks out the other clients, which retry."""
    with runtime_folder() as folder:
        server = {"create_device_s": 0.05, "pause_publish_s": 0.02, "max_clients": 64, "shutdown_stop_s": 2.0}
        harness = ThreadHarness(folder, server=server)
        try:
            names: list[str] = []

            def node(index: int) -> None:
                with connect(f"node {index}", harness.config) as engine:
                    names.append(engine.api.GetDeviceName()[1])
                    barrier.wait(20.0)

            barrier = threading.Barrier(6)
            threads = [threading.Thread(target=node, args=(index,)) for index in range(6)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join(30.0)
            assert sorted(names) == [f"node {index}" for index in range(6)]
        finally:
            harness.stop()


class TestDeadClients:
    def test_death_of_the_last_client_ends_the_engine_whatever_moves(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(vel(VEL, 40.0, acc=0.0)) == GOOD
        wait_status(engine, lambda now: now.actual_velocity[VEL] > 39.0, "motion")
        for device in harness.engine.devices:
            device.watchdog_ms = 1000
        engine.api._channel._socket.close()  # type: ignore[attr-defined]
        wait_for(lambda: engine_state(harness.folder) is EngineState.Idle, "the engine to end")
        assert not harness.drives.servo_on.any(), "the drives are commanded to switch off"


def test_a_locked_close_leaves_the_device_open(harness: ThreadHarness) -> None:
    engine = harness.connect()
    harness.server.inject_close_lock(60.0)
    assert engine.api.CloseDevice() == int(ErrorCode.CloseDeviceLockError) == 298
    assert engine.api.IsDeviceValid()
    assert engine.api.SetDeviceName("still here") == 0
    assert "being closed" in engine.api.ErrorToString(ErrorCode.CloseDeviceLockError)
    harness.server.inject_close_lock(0.0)
    assert engine.api.CloseDevice() == 0
    assert not engine.api.IsDeviceValid()


def test_close_outwaits_the_lock(harness: ThreadHarness) -> None:
    one, two = harness.connect("one"), harness.connect("two")
    harness.server.inject_close_lock(0.05)
    one.close()
    assert not one.api.IsDeviceValid()
    assert status(two).engine_state is EngineState.Running
    assert two.api.GetAllDevices()[1].count == 1
