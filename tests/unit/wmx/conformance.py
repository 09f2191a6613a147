"""What any implementation of the engine port must do. A test class inherits it and brings the fixture ``harness``.

The tests use the port alone: commands, codes and status. Expected codes are the vendor's names; motion is checked
against hand-worked kinematics. The observer is a process among others and may look late: phases that a test must see
last half a second or more of engine time, and exact cycles are the business of the engine's own tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AxisCommandMode,
    AxisSelection,
    Config_EStopLevel1Type,
    Config_HomeType,
    Config_LimitSwitchType,
    Config_ProhibitOvertravelType,
    CoreMotionErrorCode,
    DetailOperationState,
    EcErrorCode,
    EcHotconnectState,
    EcStateMachine,
    EngineState,
    ErrorCode,
    EStopLevel,
    Motion_JogCommand,
    Motion_PosCommand,
    Motion_TimedJogCommand,
    OperationState,
    Profile,
    ProfileType,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot
from tests.support.waiting import wait_for
from tests.unit.wmx.harness import (
    N_AXES,
    POS,
    POS_GEARED,
    POS_MIRRORED,
    POSITION_AXES,
    QUICK_STOP_DEC,
    VEL,
    VEL_MIRRORED,
    VELOCITY_AXES,
    Harness,
    engine_state,
    some_cycles,
    status,
    wait_status,
)
from tests.unit.wmx.spline_conformance import SplineConformance, start_of_one_axis

GOOD = ErrorCode.PyNone
NAN, INF = math.nan, math.inf
FAST = Profile.SetupTrapezoidal(20.0, 400.0, 400.0)
SLOW = Profile.SetupTrapezoidal(2.0, 20.0, 20.0)
LONG_WAY = 1000.0
Call = Callable[[MotionEngine], Any]


def pos(axis: int, target: float, profile: Profile = FAST) -> Motion_PosCommand:
    return Motion_PosCommand(axis, target, replace(profile))


def vel(axis: int, velocity: float, acc: float = 400.0, dec: float = 400.0) -> Velocity_VelCommand:
    return Velocity_VelCommand(axis, Profile.SetupTrapezoidal(velocity, acc, dec))


def jog(axis: int, velocity: float) -> Motion_JogCommand:
    return Motion_JogCommand(axis, Profile.SetupTrapezoidal(velocity, 400.0, 400.0))


def code_of(answer: Any) -> int:
    """The code of an answer, whatever its shape."""
    return answer[0] if isinstance(answer, tuple) else answer


# Calls that start motion, on axes of their own mode.
STARTS: dict[str, Call] = {
    "StartPos": lambda e: e.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW)),
    "StartPos_n": lambda e: e.core_motion.motion.StartPos(
        2, [pos(POS, LONG_WAY, SLOW), pos(POS_MIRRORED, -LONG_WAY, SLOW)]
    ),
    "StartMov": lambda e: e.core_motion.motion.StartMov(pos(POS, LONG_WAY, SLOW)),
    "StartJog": lambda e: e.core_motion.motion.StartJog(jog(POS, 2.0)),
    "StartJog_TimedJog": lambda e: e.core_motion.motion.StartJog_TimedJog(
        Motion_TimedJogCommand(POS, 60000.0, replace(SLOW))
    ),
    "StartVel": lambda e: e.core_motion.velocity.StartVel(vel(VEL, 2.0)),
    "StartVel_n": lambda e: e.core_motion.velocity.StartVel(2, [vel(VEL, 2.0), vel(VEL_MIRRORED, -2.0)]),
    "StartVel_TimedVel": lambda e: e.core_motion.velocity.StartVel_TimedVel(
        Velocity_TimedVelCommand(VEL, 60000.0, replace(SLOW))
    ),
}
STARTED_AXIS = {name: VEL if "Vel" in name else POS for name in STARTS}

# Everything else that needs a running bus.
AXIS_COMMANDS: dict[str, Callable[[MotionEngine, int], Any]] = {
    "SetServoOn": lambda e, a: e.core_motion.axisControl.SetServoOn(a, 1),
    "SetServoOn_AxisSel": lambda e, a: e.core_motion.axisControl.SetServoOn_AxisSel(AxisSelection.of(a), 1),
    "ClearAmpAlarm": lambda e, a: e.core_motion.axisControl.ClearAmpAlarm(a),
    "ClearAmpAlarm_AxisSel": lambda e, a: e.core_motion.axisControl.ClearAmpAlarm_AxisSel(AxisSelection.of(a)),
    "ClearAxisAlarm": lambda e, a: e.core_motion.axisControl.ClearAxisAlarm(a),
    "ClearAxisAlarm_AxisSel": lambda e, a: e.core_motion.axisControl.ClearAxisAlarm_AxisSel(AxisSelection.of(a)),
    "motion.Stop": lambda e, a: e.core_motion.motion.Stop(a),
    "motion.Stop_AxisSel": lambda e, a: e.core_motion.motion.Stop_AxisSel(AxisSelection.of(a)),
    "motion.Stop_Dec": lambda e, a: e.core_motion.motion.Stop_Dec(a, 10.0),
    "motion.ExecQuickStop": lambda e, a: e.core_motion.motion.ExecQuickStop(a),
    "motion.ExecQuickStop_AxisSel": lambda e, a: e.core_motion.motion.ExecQuickStop_AxisSel(AxisSelection.of(a)),
    "motion.ExecTimedStop": lambda e, a: e.core_motion.motion.ExecTimedStop_TimeMilli(a, 100.0),
    "motion.ExecTimedStop_AxisSel": lambda e, a: e.core_motion.motion.ExecTimedStop_AxisSel(AxisSelection.of(a), 9.0),
    "velocity.Stop": lambda e, a: e.core_motion.velocity.Stop(a),
    "velocity.Stop_AxisSel": lambda e, a: e.core_motion.velocity.Stop_AxisSel(AxisSelection.of(a)),
    "velocity.ExecQuickStop": lambda e, a: e.core_motion.velocity.ExecQuickStop(a),
    "velocity.ExecTimedStop": lambda e, a: e.core_motion.velocity.ExecTimedStop_TimeMilli(a, 100.0),
    "StartHome": lambda e, a: e.core_motion.home.StartHome(a),
    "StartHome_AxisSel": lambda e, a: e.core_motion.home.StartHome_AxisSel(AxisSelection.of(a)),
    "SetCommandPos": lambda e, a: e.core_motion.home.SetCommandPos(a, 1.0),
    "SetFeedbackPos": lambda e, a: e.core_motion.home.SetFeedbackPos(a, 1.0),
    "StartPos": lambda e, a: e.core_motion.motion.StartPos(pos(a, 1.0)),
    "StartMov": lambda e, a: e.core_motion.motion.StartMov(pos(a, 1.0)),
    "StartJog": lambda e, a: e.core_motion.motion.StartJog(jog(a, 1.0)),
    "StartVel": lambda e, a: e.core_motion.velocity.StartVel(vel(a, 1.0)),
    "StartCSplinePos_PointTime": start_of_one_axis,
}
# What works without a bus too.
AXIS_SETTINGS: dict[str, Callable[[MotionEngine, int], Any]] = {
    "SetAxisCommandMode": lambda e, a: e.core_motion.axisControl.SetAxisCommandMode(a, 0),
    "GetAxisCommandMode": lambda e, a: e.core_motion.axisControl.GetAxisCommandMode(a),
    "GetPosCommand": lambda e, a: e.core_motion.axisControl.GetPosCommand(a),
    "GetPosFeedback": lambda e, a: e.core_motion.axisControl.GetPosFeedback(a),
    "GetVelCommand": lambda e, a: e.core_motion.axisControl.GetVelCommand(a),
    "GetVelFeedback": lambda e, a: e.core_motion.axisControl.GetVelFeedback(a),
    "SetHomeDone": lambda e, a: e.core_motion.home.SetHomeDone(a, 1),
    "Home.Cancel": lambda e, a: e.core_motion.home.Cancel(a),
    "SetGearRatio": lambda e, a: e.core_motion.config.SetGearRatio(a, 1.0, 1.0),
    "GetGearRatio": lambda e, a: e.core_motion.config.GetGearRatio(a),
    "SetAxisPolarity": lambda e, a: e.core_motion.config.SetAxisPolarity(a, 1),
    "GetAxisPolarity": lambda e, a: e.core_motion.config.GetAxisPolarity(a),
    "GetFeedbackParam": lambda e, a: e.core_motion.config.GetFeedbackParam(a),
    "GetHomeParam": lambda e, a: e.core_motion.config.GetHomeParam(a),
    "GetLimitParam": lambda e, a: e.core_motion.config.GetLimitParam(a),
    "GetMotionParam": lambda e, a: e.core_motion.config.GetMotionParam(a),
    "GetAlarmParam": lambda e, a: e.core_motion.config.GetAlarmParam(a),
}
DEVICE_CALLS: dict[str, Call] = {
    "StartCommunication": lambda e: e.api.StartCommunication(100),
    "StopCommunication": lambda e: e.api.StopCommunication(100),
    "StopEngine": lambda e: e.api.StopEngine(100),
    "CloseDevice": lambda e: e.api.CloseDevice(),
    "GetEngineStatus": lambda e: e.api.GetEngineStatus(),
    "SetDeviceName": lambda e: e.api.SetDeviceName("x"),
    "GetDeviceName": lambda e: e.api.GetDeviceName(),
    "GetDeviceID": lambda e: e.api.GetDeviceID(),
    "GetAllDevices": lambda e: e.api.GetAllDevices(),
    "SetWatchdog": lambda e: e.api.SetWatchdog(100),
    "GetWatchdog": lambda e: e.api.GetWatchdog(),
    "ResetWatchdogTimer": lambda e: e.api.ResetWatchdogTimer(),
    "AutoQuitWithoutActiveDev": lambda e: e.api.AutoQuitWithoutActiveDev(True),
    "GetStatus": lambda e: e.core_motion.GetStatus(),
    "read_status": lambda e: e.read_status(),
    "ExecEStop": lambda e: e.core_motion.ExecEStop(EStopLevel.Level1),
    "ReleaseEStop": lambda e: e.core_motion.ReleaseEStop(),
    "Wait": lambda e: e.core_motion.motion.Wait(0),
    "GetEmergencyStopParam": lambda e: e.core_motion.config.GetEmergencyStopParam(),
    "GetParam": lambda e: e.core_motion.config.GetParam(),
    "GetAxisParam": lambda e: e.core_motion.config.GetAxisParam(),
    "ImportAndSetAll": lambda e: e.core_motion.config.ImportAndSetAll("/nowhere.xml"),
    "GetAndExportAll": lambda e: e.core_motion.config.GetAndExportAll("/nowhere/parameters.xml"),
    "SetOutBit": lambda e: e.io.SetOutBit(0, 0, 1),
    "GetOutBit": lambda e: e.io.GetOutBit(0, 0),
    "GetInBit": lambda e: e.io.GetInBit(0, 0),
    "SetOutBytes": lambda e: e.io.SetOutBytes(0, 1, [1]),
    "GetInBytes": lambda e: e.io.GetInBytes(0, 1),
    "ScanNetwork": lambda e: e.ecat.ScanNetwork(0),
    "GetMasterInfo": lambda e: e.ecat.GetMasterInfo(),
    "RegisterRead": lambda e: e.ecat.RegisterRead(0, 0, 1),
    "ResetTransmitStatisticsInfo": lambda e: e.ecat.ResetTransmitStatisticsInfo(),
    "StartHotconnect": lambda e: e.ecat.StartHotconnect(),
    "CreateSplineBuffer": lambda e: e.advanced_motion.advMotion.CreateSplineBuffer(0, 10),
    "FreeSplineBuffer": lambda e: e.advanced_motion.advMotion.FreeSplineBuffer(0),
    "GetSplineBufferPoints": lambda e: e.advanced_motion.advMotion.GetSplineBufferPoints(0),
}
ALL_CALLS: dict[str, Call] = {
    **DEVICE_CALLS,
    **{name: (lambda e, c=call: c(e, 0)) for name, call in {**AXIS_COMMANDS, **AXIS_SETTINGS}.items()},
}


def parametrize(name: str, table: dict[str, Any]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(name, list(table.values()), ids=list(table))


def assert_at_rest(engine: MotionEngine) -> None:
    """Nothing moves and nothing is about to. In velocity mode the position is the drive's, which may still settle."""
    before = status(engine)
    after = some_cycles(engine)
    for snapshot in (before, after):
        assert (snapshot.op_state == OperationState.Idle).all()
        assert (snapshot.velocity_cmd == 0.0).all()
    in_position_mode = before.command_mode == AxisCommandMode.Position
    held = in_position_mode & before.servo_on & after.servo_on
    assert after.pos_cmd[held] == pytest.approx(before.pos_cmd[held], abs=1e-9)


def in_state(axis: int, state: OperationState) -> Callable[[StatusSnapshot], bool]:
    return lambda snapshot: bool(snapshot.op_state[axis] == state)


def cruising(axis: int, velocity: float) -> Callable[[StatusSnapshot], bool]:
    return lambda snapshot: bool(snapshot.velocity_cmd[axis] == velocity)


def braking(axis: int, rate: float) -> Callable[[StatusSnapshot], bool]:
    """The axis, turning in its positive direction, slows down at ``rate``."""
    return lambda snapshot: bool(snapshot.reals[Real.CMD_ACC, axis] == pytest.approx(-rate))


def set_quick_stop(engine: MotionEngine, axis: int, dec: float) -> None:
    _, param = engine.core_motion.config.GetMotionParam(axis)
    assert engine.core_motion.config.SetMotionParam(axis, replace(param, quickStopDec=dec))[0] == GOOD


def set_estop(engine: MotionEngine, dec: float) -> None:
    _, param = engine.core_motion.config.GetEmergencyStopParam()
    assert engine.core_motion.config.SetEmergencyStopParam(replace(param, eStopDec=[dec] * N_AXES))[0] == GOOD


class EngineConformance(SplineConformance):
    """Needs: a fixture ``harness`` (Harness) with an idle engine."""

    # -- devices and engine --------------------------------------------------------------------------------------------

    def test_first_device_starts_the_engine(self, harness: Harness) -> None:
        assert engine_state(harness.folder) is EngineState.Idle
        engine = harness.connect()
        assert engine.api.GetEngineStatus()[1].state == EngineState.Running

    @parametrize("call", ALL_CALLS)
    def test_call_on_a_closed_device(self, harness: Harness, call: Call) -> None:
        engine = harness.connect()
        assert engine.api.CloseDevice() == GOOD
        assert not engine.api.IsDeviceValid()
        assert code_of(call(engine)) == ErrorCode.DeviceIsNull

    @parametrize("call", ALL_CALLS)
    def test_call_after_another_device_stopped_the_engine(self, harness: Harness, call: Call) -> None:
        engine, other = harness.connect("one"), harness.connect("other")
        assert other.api.StopEngine(20000) == GOOD
        assert code_of(call(engine)) == ErrorCode.DeviceIsNull
        assert not engine.api.IsDeviceValid()

    def test_device_is_valid_from_creation_on(self, harness: Harness) -> None:
        assert harness.connect().api.IsDeviceValid()

    def test_second_create_on_an_open_device_is_refused_and_harmless(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.api.CreateDevice(str(harness.folder), 0, 0) == ErrorCode.ResourceInUse
        assert engine.api.IsDeviceValid()

    def test_device_can_be_created_again_after_close(self, harness: Harness) -> None:
        engine = harness.connect()
        engine.api.CloseDevice()
        assert engine.api.CreateDevice(str(harness.folder), 0, 20000) == GOOD
        assert engine.api.IsDeviceValid()

    @pytest.mark.parametrize("device_type", [-1, 4, 1000])
    def test_unknown_device_type(self, harness: Harness, device_type: int) -> None:
        engine = harness.connect()
        engine.api.CloseDevice()
        assert engine.api.CreateDevice(str(harness.folder), device_type, 0) == ErrorCode.ArgumentOutOfRange

    def test_no_engine_at_that_path(self, harness: Harness) -> None:
        engine = harness.connect()
        engine.api.CloseDevice()
        assert engine.api.CreateDevice(str(harness.folder / "nowhere"), 0, 0) == ErrorCode.IMLibIsNotRunning
        assert engine.api.StartEngine(str(harness.folder / "nowhere"), 0) == ErrorCode.IMLibIsNotRunning

    def test_names_and_ids(self, harness: Harness) -> None:
        one, two = harness.connect("one"), harness.connect("two")
        assert one.api.GetDeviceName() == (GOOD, "one")
        assert one.api.SetDeviceName("uno") == GOOD
        (_, first), (_, second) = one.api.GetDeviceID(), two.api.GetDeviceID()
        assert first != second
        code, devices = one.api.GetAllDevices()
        assert code == GOOD
        assert devices.count == 2
        assert {(device.id, device.name) for device in devices.devices} == {(first, "uno"), (second, "two")}

    def test_overlong_name(self, harness: Harness) -> None:
        assert harness.connect().api.SetDeviceName("n" * 64) == ErrorCode.ArgumentOutOfRange

    def test_closing_one_device_leaves_the_other(self, harness: Harness) -> None:
        one, two = harness.connect("one"), harness.communicating("two")
        assert one.api.CloseDevice() == GOOD
        assert two.api.GetEngineStatus()[1].state == EngineState.Communicating
        assert two.api.GetAllDevices()[1].count == 1

    def test_last_device_ends_the_engine(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.api.CloseDevice() == GOOD
        wait_for(lambda: engine_state(harness.folder) is EngineState.Idle, "the engine to end")

    def test_engine_stays_without_devices_if_told_so(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.api.AutoQuitWithoutActiveDev(False) == GOOD
        assert engine.api.CloseDevice() == GOOD
        again = harness.connect()
        assert again.api.GetEngineStatus()[1].state == EngineState.Communicating

    def test_start_engine_without_a_device(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.api.StopEngine(20000) == GOOD
        assert engine.api.StartEngine(str(harness.folder), 1000) == GOOD
        assert engine_state(harness.folder) is EngineState.Running

    def test_restart_engine_resets_parameters_and_outputs(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.core_motion.config.SetGearRatio(POS, 10.0, 1.0) == GOOD
        assert engine.io.SetOutByte(0, 255) == GOOD
        assert engine.api.RestartEngine(str(harness.folder), 20000) == GOOD
        assert not engine.api.IsDeviceValid()
        again = harness.communicating()
        assert again.core_motion.config.GetGearRatio(POS)[1] == 131072.0
        assert again.io.GetOutByte(0) == (GOOD, 0)

    # -- communication -------------------------------------------------------------------------------------------------

    def test_start_communication_waits_for_it(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.api.StartCommunication(20000) == GOOD
        assert engine.api.GetEngineStatus()[1].state == EngineState.Communicating

    def test_start_communication_without_waiting(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.api.StartCommunication(0) == GOOD
        wait_status(engine, lambda now: now.communicating, "communication")

    def test_start_communication_twice(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.api.StartCommunication(20000) == GOOD
        assert status(engine).communicating

    @parametrize("call", AXIS_COMMANDS)
    def test_command_before_communication(self, harness: Harness, call: Callable[[MotionEngine, int], Any]) -> None:
        engine = harness.connect()
        assert code_of(call(engine, 0)) == ErrorCode.CommNotStarted
        assert engine.api.StartCommunication(20000) == GOOD
        assert_at_rest(engine)
        assert not status(engine).servo_on.any()

    @parametrize("call", STARTS)
    def test_start_before_communication(self, harness: Harness, call: Call) -> None:
        engine = harness.connect()
        assert call(engine) == ErrorCode.CommNotStarted

    @parametrize("call", AXIS_SETTINGS)
    def test_setting_before_communication(self, harness: Harness, call: Callable[[MotionEngine, int], Any]) -> None:
        engine = harness.connect()
        assert code_of(call(engine, POS)) == GOOD

    def test_servos_are_off_when_communication_starts(self, harness: Harness) -> None:
        snapshot = status(harness.communicating())
        assert not snapshot.servo_on.any()
        assert not snapshot.servo_requested.any()

    def test_only_absolute_axes_are_homed_at_the_start(self, harness: Harness) -> None:
        homed = status(harness.communicating()).home_done
        assert homed.tolist() == [axis == POS_MIRRORED for axis in range(N_AXES)]

    def test_stop_communication_ends_motion_and_servos(self, harness: Harness) -> None:
        engine = harness.ready()
        engine.core_motion.velocity.StartVel(vel(VEL, 5.0))
        wait_status(engine, cruising(VEL, 5.0), "cruising")
        assert engine.api.StopCommunication(20000) == GOOD
        snapshot = status(engine)
        assert snapshot.engine_state is EngineState.Running
        assert not snapshot.servo_on.any()
        assert (snapshot.op_state == OperationState.Idle).all()
        assert (snapshot.flags[Flag.SERVO_OFFLINE] == 1).all()
        assert engine.api.StartCommunication(20000) == GOOD
        assert_at_rest(engine)
        assert not status(engine).servo_on.any()

    def test_stop_communication_twice(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.api.StopCommunication() == GOOD
        assert engine.api.StopCommunication() == GOOD

    def test_inputs_are_unknown_without_communication(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.io.GetInBit(0, 0) == (ErrorCode.CommNotStarted, 0)
        assert engine.io.GetInByte(0) == (ErrorCode.CommNotStarted, 0)
        assert engine.io.GetInBytes(0, 2) == (ErrorCode.CommNotStarted, [])
        assert engine.io.SetOutBit(0, 0, 1) == ErrorCode.CommNotStarted

    # -- status --------------------------------------------------------------------------------------------------------

    def test_status_shapes_and_progress(self, harness: Harness) -> None:
        engine = harness.communicating()
        code, record = engine.core_motion.GetStatus()
        assert code == GOOD
        assert record.engineState == EngineState.Communicating
        assert record.GetCycleTimeMilliseconds(0) == pytest.approx(1.0)
        later = some_cycles(engine, 20)
        assert later.cycle_counter > record.GetCycleCounter(0)
        assert later.engine_time_s == pytest.approx(later.cycle_counter * 0.001)
        assert later.n_axes == N_AXES
        assert later.reals.shape[1] == later.flags.shape[1] == N_AXES

    def test_axis_records_say_what_the_arrays_say(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS, 0.3)) == GOOD
        assert engine.core_motion.motion.Wait_TimeMilli(POS, 20000) == GOOD
        some_cycles(engine, 200)
        _, record = engine.core_motion.GetStatus()
        snapshot = status(engine)
        for axis in range(N_AXES):
            found = record.GetAxesStatus(axis)
            assert found.servoOn == snapshot.servo_on[axis]
            assert found.posCmd == pytest.approx(snapshot.pos_cmd[axis], abs=1e-4)
            assert found.actualPos == pytest.approx(snapshot.actual_pos[axis], abs=1e-4)
            assert found.opState == snapshot.op_state[axis]
            assert found.axisCommandMode == snapshot.command_mode[axis]
            assert found.homeDone == snapshot.home_done[axis]
            assert found.encoderFeedback == pytest.approx(snapshot.flags[Flag.ENCODER_FEEDBACK, axis], abs=2)
        assert len(record.axesStatus) == N_AXES
        assert record.axesStatus[-1].servoOn

    def test_record_of_an_axis_that_does_not_exist_is_offline(self, harness: Harness) -> None:
        _, record = harness.ready().core_motion.GetStatus()
        assert record.GetAxesStatus(127).servoOffline
        assert not record.GetAxesStatus(127).servoOn

    # -- axes ----------------------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("axis", [-1, N_AXES, 128, 10**9])
    @parametrize("call", {**AXIS_COMMANDS, **AXIS_SETTINGS})
    def test_axis_out_of_range(self, harness: Harness, call: Callable[[MotionEngine, int], Any], axis: int) -> None:
        engine = harness.ready()
        assert code_of(call(engine, axis)) == ErrorCode.AxisOutOfRange
        assert_at_rest(engine)
        assert status(engine).servo_on.all()

    def test_empty_and_duplicate_selection(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.Stop_AxisSel(AxisSelection()) == ErrorCode.AxisCountOutOfRange
        assert motion.Stop_AxisSel(AxisSelection.of(POS, POS)) == ErrorCode.DuplicateAxis
        assert motion.StartPos(0, []) == ErrorCode.AxisCountOutOfRange
        assert motion.StartPos(2, [pos(POS, 1.0), pos(POS, 2.0)]) == ErrorCode.DuplicateAxis
        assert_at_rest(engine)

    @pytest.mark.parametrize("count", [-1, 3])
    def test_count_that_does_not_fit_the_list(self, harness: Harness, count: int) -> None:
        engine = harness.ready()
        commands = [pos(POS, 1.0), pos(POS_MIRRORED, 1.0)]
        assert engine.core_motion.motion.StartPos(count, commands) == ErrorCode.ArgumentOutOfRange
        assert engine.core_motion.velocity.StartVel(count, [vel(VEL, 1.0)] * 2) == ErrorCode.ArgumentOutOfRange
        assert_at_rest(engine)

    def test_count_below_the_list_starts_the_first(self, harness: Harness) -> None:
        engine = harness.ready()
        commands = [pos(POS, LONG_WAY, SLOW), pos(POS_MIRRORED, LONG_WAY, SLOW)]
        assert engine.core_motion.motion.StartPos(1, commands) == GOOD
        assert status(engine).op_state[[POS, POS_MIRRORED]].tolist() == [OperationState.Pos, OperationState.Idle]

    def test_servo_on_and_off(self, harness: Harness) -> None:
        engine = harness.communicating()
        control = engine.core_motion.axisControl
        assert control.SetServoOn(POS, 1) == GOOD
        assert not status(engine).servo_on[POS], "a request takes some cycles"
        snapshot = wait_status(engine, lambda now: now.servo_on[POS], "servo on")
        assert snapshot.servo_on.tolist() == [axis == POS for axis in range(N_AXES)]
        assert control.SetServoOn(POS, 0) == GOOD
        wait_status(engine, lambda now: not now.servo_on[POS], "servo off")

    @pytest.mark.parametrize("value", [-1, 2, 10**12])
    def test_servo_on_value(self, harness: Harness, value: int) -> None:
        engine = harness.communicating()
        assert engine.core_motion.axisControl.SetServoOn(POS, value) == ErrorCode.ArgumentOutOfRange
        assert not some_cycles(engine, 20).servo_on.any()

    @parametrize("call", STARTS)
    def test_start_with_the_servo_off(self, harness: Harness, call: Call) -> None:
        engine = harness.communicating()
        assert call(engine) == CoreMotionErrorCode.NotServoOn
        assert_at_rest(engine)

    @parametrize("call", STARTS)
    def test_servo_off_ends_motion(self, harness: Harness, call: Call) -> None:
        engine = harness.ready()
        assert call(engine) == GOOD
        off = AxisSelection.of(*range(N_AXES))
        assert engine.core_motion.axisControl.SetServoOn_AxisSel(off, 0) == GOOD
        wait_status(engine, lambda now: not now.servo_on.any(), "servos off")
        assert_at_rest(engine)
        assert not status(engine).motion_complete.any()
        if call is STARTS["StartPos"]:
            assert engine.core_motion.motion.Wait_TimeMilli(POS, 20000) == ErrorCode.ServoOff

    def test_switching_on_does_not_jump(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS_GEARED, 0.7)) == GOOD
        assert engine.core_motion.motion.Wait_TimeMilli(POS_GEARED, 20000) == GOOD
        engine.core_motion.axisControl.SetServoOn(POS_GEARED, 0)
        wait_status(engine, lambda now: not now.servo_on[POS_GEARED], "servo off")
        engine.core_motion.axisControl.SetServoOn(POS_GEARED, 1)
        snapshot = wait_status(engine, lambda now: now.servo_on[POS_GEARED], "servo on")
        assert snapshot.pos_cmd[POS_GEARED] == pytest.approx(snapshot.actual_pos[POS_GEARED], abs=1e-6)
        assert_at_rest(engine)

    def test_home_offset_of_an_absolute_axis(self, harness: Harness) -> None:
        # Polarity -1 and home offset 0.5: the user position is the mirrored encoder's less 0.5.
        snapshot = status(harness.communicating())
        encoder = snapshot.flags[Flag.ENCODER_FEEDBACK, POS_MIRRORED] * 2.0 * math.pi / 131072
        assert snapshot.actual_pos[POS_MIRRORED] == pytest.approx(-encoder - 0.5)

    # -- modes ---------------------------------------------------------------------------------------------------------

    def test_configured_modes(self, harness: Harness) -> None:
        snapshot = status(harness.communicating())
        assert all(snapshot.command_mode[axis] == AxisCommandMode.Position for axis in POSITION_AXES)
        assert all(snapshot.command_mode[axis] == AxisCommandMode.Velocity for axis in VELOCITY_AXES)

    @parametrize(
        "call",
        {
            "StartPos": lambda e: e.core_motion.motion.StartPos(pos(VEL, 1.0)),
            "StartMov": lambda e: e.core_motion.motion.StartMov(pos(VEL, 1.0)),
            "StartJog": lambda e: e.core_motion.motion.StartJog(jog(VEL, 1.0)),
            "Stop": lambda e: e.core_motion.motion.Stop(VEL),
            "Stop_Dec": lambda e: e.core_motion.motion.Stop_Dec(VEL, 1.0),
            "ExecQuickStop": lambda e: e.core_motion.motion.ExecQuickStop(VEL),
            "ExecTimedStop": lambda e: e.core_motion.motion.ExecTimedStop_TimeMilli(VEL, 1.0),
        },
    )
    def test_position_call_in_velocity_mode(self, harness: Harness, call: Call) -> None:
        engine = harness.ready()
        assert call(engine) == CoreMotionErrorCode.NotPosMode
        assert_at_rest(engine)

    @parametrize(
        "call",
        {
            "StartVel": lambda e: e.core_motion.velocity.StartVel(vel(POS, 1.0)),
            "StartVel_TimedVel": lambda e: e.core_motion.velocity.StartVel_TimedVel(
                Velocity_TimedVelCommand(POS, 100.0, replace(SLOW))
            ),
            "Stop": lambda e: e.core_motion.velocity.Stop(POS),
            "ExecQuickStop": lambda e: e.core_motion.velocity.ExecQuickStop(POS),
            "ExecTimedStop": lambda e: e.core_motion.velocity.ExecTimedStop_TimeMilli(POS, 1.0),
        },
    )
    def test_velocity_call_in_position_mode(self, harness: Harness, call: Call) -> None:
        engine = harness.ready()
        assert call(engine) == CoreMotionErrorCode.NotVelocityMode
        assert_at_rest(engine)

    @pytest.mark.parametrize(
        ("mode", "code"),
        [
            (AxisCommandMode.Torque, CoreMotionErrorCode.CurrentAxisCommandModeNotSupported),
            (-1, CoreMotionErrorCode.AxisCommandModeOutOfRange),
            (3, CoreMotionErrorCode.AxisCommandModeOutOfRange),
        ],
    )
    def test_unknown_mode(self, harness: Harness, mode: int, code: int) -> None:
        engine = harness.communicating()
        assert engine.core_motion.axisControl.SetAxisCommandMode(POS, mode) == code
        assert engine.core_motion.axisControl.GetAxisCommandMode(POS) == (GOOD, AxisCommandMode.Position)

    @parametrize("name", {name: name for name in STARTS})
    def test_mode_change_in_motion(self, harness: Harness, name: str) -> None:
        engine = harness.ready()
        axis = STARTED_AXIS[name]
        before = status(engine).command_mode[axis]
        assert STARTS[name](engine) == GOOD
        assert engine.core_motion.axisControl.SetAxisCommandMode(axis, 1 - int(before)) == ErrorCode.NotIdleState
        assert status(engine).command_mode[axis] == before

    def test_mode_change_at_rest_does_not_move(self, harness: Harness) -> None:
        engine = harness.ready()
        control, motion = engine.core_motion.axisControl, engine.core_motion.motion
        assert motion.StartPos(pos(POS, 0.5)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert control.SetAxisCommandMode(POS, AxisCommandMode.Velocity) == GOOD
        assert engine.core_motion.velocity.StartVel(vel(POS, 3.0)) == GOOD
        wait_status(engine, lambda now: now.actual_pos[POS] > 0.8, "the axis to run")
        assert engine.core_motion.velocity.Stop(POS) == GOOD
        wait_status(engine, in_state(POS, OperationState.Idle), "rest")
        wait_status(engine, lambda now: abs(now.actual_velocity[POS]) < 1e-3, "the drive at rest")
        assert control.SetAxisCommandMode(POS, AxisCommandMode.Position) == GOOD
        snapshot = status(engine)
        assert snapshot.pos_cmd[POS] == pytest.approx(snapshot.actual_pos[POS], abs=1e-4)
        assert_at_rest(engine)

    # -- arguments -----------------------------------------------------------------------------------------------------

    @pytest.mark.parametrize(
        ("changes", "code"),
        [
            *[
                ({"velocity": v}, CoreMotionErrorCode.VelocityArgumentOutOfRange)
                for v in (NAN, INF, -INF, 0.0, -1.0, 1e-7, 1e12)
            ],
            *[({"acc": v}, CoreMotionErrorCode.AccArgumentOutOfRange) for v in (NAN, INF, -INF, 0.0, -1.0, 1e-7, 1e12)],
            *[({"dec": v}, CoreMotionErrorCode.DecArgumentOutOfRange) for v in (NAN, INF, -INF, 0.0, -1.0, 1e-7, 1e12)],
            *[
                ({"startingVelocity": v}, CoreMotionErrorCode.StartingVelocityArgumentOutOfRange)
                for v in (NAN, INF, 1.0)
            ],
            *[({"endVelocity": v}, CoreMotionErrorCode.EndVelocityArgumentOutOfRange) for v in (NAN, INF, 1.0)],
            *[({"type": v}, CoreMotionErrorCode.ProfileTypeNotSupported) for v in (ProfileType.SCurve, -1, 99)],
        ],
        ids=str,
    )
    @pytest.mark.parametrize("call", ["StartPos", "StartMov"])
    def test_position_profile(self, harness: Harness, call: str, changes: dict[str, float], code: int) -> None:
        engine = harness.ready()
        start = getattr(engine.core_motion.motion, call)
        assert start(pos(POS, 1.0, replace(FAST, **changes))) == code
        assert start(2, [pos(POS_MIRRORED, 1.0), pos(POS, 1.0, replace(FAST, **changes))]) == code, "all or nothing"
        assert_at_rest(engine)

    @pytest.mark.parametrize("target", [NAN, INF, -INF, 1e15, -1e300])
    @pytest.mark.parametrize("call", ["StartPos", "StartMov"])
    def test_position_target(self, harness: Harness, call: str, target: float) -> None:
        engine = harness.ready()
        start = getattr(engine.core_motion.motion, call)
        assert start(pos(POS, target)) == CoreMotionErrorCode.PositionArgumentOutOfRange
        assert_at_rest(engine)

    @pytest.mark.parametrize(
        ("changes", "code"),
        [
            *[({"velocity": v}, CoreMotionErrorCode.VelocityArgumentOutOfRange) for v in (NAN, INF, -INF, 0.0, 1e12)],
            *[({"acc": v}, CoreMotionErrorCode.AccArgumentOutOfRange) for v in (NAN, INF, 0.0, -1.0)],
            *[({"dec": v}, CoreMotionErrorCode.DecArgumentOutOfRange) for v in (NAN, INF, 0.0, -1.0)],
            ({"type": ProfileType.JerkLimited}, CoreMotionErrorCode.ProfileTypeNotSupported),
        ],
        ids=str,
    )
    def test_jog_profile(self, harness: Harness, changes: dict[str, float], code: int) -> None:
        engine = harness.ready()
        profile = replace(FAST, **changes)
        assert engine.core_motion.motion.StartJog(Motion_JogCommand(POS, profile)) == code
        timed = Motion_TimedJogCommand(POS, 100.0, profile)
        assert engine.core_motion.motion.StartJog_TimedJog(timed) == code
        assert_at_rest(engine)

    @pytest.mark.parametrize(
        ("changes", "code"),
        [
            *[({"velocity": v}, CoreMotionErrorCode.VelocityArgumentOutOfRange) for v in (NAN, INF, -INF, 1e12)],
            *[({"acc": v}, CoreMotionErrorCode.AccArgumentOutOfRange) for v in (NAN, INF, -1.0, 1e-9)],
            *[({"dec": v}, CoreMotionErrorCode.DecArgumentOutOfRange) for v in (NAN, INF, -1.0, 1e-9)],
            ({"startingVelocity": NAN}, CoreMotionErrorCode.StartingVelocityArgumentOutOfRange),
            ({"endVelocity": NAN}, CoreMotionErrorCode.EndVelocityArgumentOutOfRange),
            ({"type": ProfileType.Sin}, CoreMotionErrorCode.ProfileTypeNotSupported),
        ],
        ids=str,
    )
    def test_velocity_profile(self, harness: Harness, changes: dict[str, float], code: int) -> None:
        engine = harness.ready()
        profile = replace(FAST, **changes)
        velocity = engine.core_motion.velocity
        assert velocity.StartVel(Velocity_VelCommand(VEL, profile)) == code
        assert velocity.StartVel(2, [vel(VEL_MIRRORED, 1.0), Velocity_VelCommand(VEL, profile)]) == code
        assert velocity.StartVel_TimedVel(Velocity_TimedVelCommand(VEL, 100.0, profile)) == code
        assert_at_rest(engine)

    @pytest.mark.parametrize("time", [NAN, INF, -INF, 0.0, -1.0, 1e12])
    def test_run_time(self, harness: Harness, time: float) -> None:
        engine = harness.ready()
        code = CoreMotionErrorCode.RunTimeArgumentOutOfRange
        timed_jog = Motion_TimedJogCommand(POS, time, replace(FAST))
        assert engine.core_motion.motion.StartJog_TimedJog(timed_jog) == code
        timed_vel = Velocity_TimedVelCommand(VEL, time, replace(FAST))
        assert engine.core_motion.velocity.StartVel_TimedVel(timed_vel) == code
        assert_at_rest(engine)

    @pytest.mark.parametrize("time", [NAN, INF, -1.0])
    @pytest.mark.parametrize("field", ["accTimeMilliseconds", "decTimeMilliseconds"])
    def test_profile_times(self, harness: Harness, field: str, time: float) -> None:
        engine = harness.ready()
        profile = replace(Profile.SetupTimeAccTrapezoidal(5.0, 10.0, 10.0), **{field: time})
        code = CoreMotionErrorCode.TimeArgumentOutOfRange
        assert engine.core_motion.motion.StartPos(pos(POS, 1.0, profile)) == code
        assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, profile)) == code
        assert_at_rest(engine)

    @pytest.mark.parametrize("time", [NAN, INF, 0.0, -1.0])
    def test_stop_times_and_decelerations(self, harness: Harness, time: float) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert engine.core_motion.motion.StartJog(jog(POS, 5.0)) == GOOD
        timed_code = CoreMotionErrorCode.TimeArgumentOutOfRange
        assert engine.core_motion.motion.ExecTimedStop_TimeMilli(POS, time) == timed_code
        assert engine.core_motion.velocity.ExecTimedStop_AxisSel(AxisSelection.of(VEL), time) == timed_code
        assert engine.core_motion.motion.Stop_Dec(POS, time) == CoreMotionErrorCode.DecArgumentOutOfRange
        snapshot = status(engine)
        assert snapshot.op_state[POS] == OperationState.Jog
        assert snapshot.op_state[VEL] == OperationState.Velocity

    def test_all_axes_or_none(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartPos(2, [pos(POS, 1.0), pos(VEL, 1.0)]) == CoreMotionErrorCode.NotPosMode
        assert motion.StartPos(2, [pos(POS, 1.0), pos(N_AXES, 1.0)]) == ErrorCode.AxisOutOfRange
        assert_at_rest(engine)

    # -- position motion -----------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("axis", POSITION_AXES)
    @pytest.mark.parametrize("target", [1.25, -0.75])
    def test_start_pos_arrives_exactly(self, harness: Harness, axis: int, target: float) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(axis, target)) == GOOD
        assert status(engine).op_state[axis] == OperationState.Pos, "visible as soon as the call returns"
        assert not status(engine).motion_complete[axis]
        assert engine.core_motion.motion.Wait_TimeMilli(axis, 20000) == GOOD
        snapshot = status(engine)
        assert snapshot.pos_cmd[axis] == target
        assert snapshot.velocity_cmd[axis] == 0.0
        assert snapshot.motion_complete[axis]
        wait_status(engine, lambda now: abs(now.actual_pos[axis] - target) < 1e-3, "the feedback to settle")

    def test_mirrored_axis_turns_its_drive_the_other_way(self, harness: Harness) -> None:
        engine = harness.ready()
        start = status(engine)
        moves = [pos(POS, 1.0), pos(POS_MIRRORED, start.pos_cmd[POS_MIRRORED] + 1.0)]
        assert engine.core_motion.motion.StartPos(2, moves) == GOOD
        assert engine.core_motion.motion.Wait_AxisSel_TimeMilli(AxisSelection.of(POS, POS_MIRRORED), 20000) == GOOD
        counts = status(engine).flags[Flag.ENCODER_COMMAND] - start.flags[Flag.ENCODER_COMMAND]
        assert counts[POS] == pytest.approx(131072 / (2 * math.pi), abs=1)
        assert counts[POS_MIRRORED] == pytest.approx(-131072 / (2 * math.pi), abs=1)

    def test_position_motion_keeps_its_limits(self, harness: Harness) -> None:
        # 10 rad at 10 rad/s and 20 rad/s2: ramps of 2.5 rad and 0.5 s, cruise of 5 rad: 1.5 s in all.
        engine = harness.ready()
        profile = Profile.SetupTrapezoidal(10.0, 20.0, 20.0)
        assert engine.core_motion.motion.StartPos(pos(POS, 10.0, profile)) == GOOD
        seen = [status(engine)]
        while seen[-1].op_state[POS] == OperationState.Pos:
            seen.append(status(engine))
        assert max(snapshot.velocity_cmd[POS] for snapshot in seen) <= 10.0
        assert {round(snapshot.reals[Real.CMD_ACC, POS], 6) for snapshot in seen} <= {20.0, 0.0, -20.0}
        for before, after in pairwise(seen):
            cycles = after.cycle_counter - before.cycle_counter
            assert abs(after.velocity_cmd[POS] - before.velocity_cmd[POS]) <= 0.02 * cycles + 1e-9
            assert abs(after.pos_cmd[POS] - before.pos_cmd[POS]) <= 0.01 * cycles + 1e-9

    def test_time_acc_profile(self, harness: Harness) -> None:
        # 10 rad/s in 0.5 s up and 1 s down: 2.5 + 5 rad of ramps.
        engine = harness.ready()
        profile = Profile.SetupTimeAccTrapezoidal(10.0, 500.0, 1000.0)
        assert engine.core_motion.motion.StartPos(pos(POS, 10.0, profile)) == GOOD
        up = wait_status(engine, lambda now: now.flags[Flag.ACC_FLAG, POS], "acceleration")
        assert up.reals[Real.CMD_ACC, POS] == pytest.approx(20.0)
        down = wait_status(engine, lambda now: now.flags[Flag.DEC_FLAG, POS], "deceleration")
        assert down.reals[Real.CMD_ACC, POS] == pytest.approx(-10.0)
        assert engine.core_motion.motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert status(engine).pos_cmd[POS] == 10.0

    def test_target_where_the_axis_is(self, harness: Harness) -> None:
        engine = harness.ready()
        here = status(engine).pos_cmd[POS]
        assert engine.core_motion.motion.StartPos(pos(POS, here)) == GOOD
        assert engine.core_motion.motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert status(engine).motion_complete[POS]

    def test_start_mov_from_rest_is_relative_to_the_command(self, harness: Harness) -> None:
        engine = harness.ready()
        for expected in (0.5, 1.0):
            assert engine.core_motion.motion.StartMov(pos(POS, 0.5)) == GOOD
            assert engine.core_motion.motion.Wait_TimeMilli(POS, 20000) == GOOD
            assert status(engine).pos_cmd[POS] == pytest.approx(expected)

    def test_start_mov_in_motion_is_relative_to_the_running_target(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS, 2.0)) == GOOD
        assert engine.core_motion.motion.StartMov(pos(POS, 0.5)) == GOOD
        assert engine.core_motion.motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert status(engine).pos_cmd[POS] == pytest.approx(2.5)

    def test_position_over_position_goes_on_from_the_present_velocity(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartPos(pos(POS, LONG_WAY)) == GOOD
        wait_status(engine, cruising(POS, 20.0), "cruising")
        before = status(engine)
        assert motion.StartPos(pos(POS, before.pos_cmd[POS] + 20.0)) == GOOD
        after = status(engine)
        assert after.velocity_cmd[POS] == pytest.approx(20.0, abs=1e-6)
        assert after.op_state[POS] == OperationState.Pos
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert status(engine).pos_cmd[POS] == before.pos_cmd[POS] + 20.0

    def test_override_to_a_target_behind_comes_back(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartPos(pos(POS, LONG_WAY)) == GOOD
        wait_status(engine, cruising(POS, 20.0), "cruising")
        assert motion.StartPos(pos(POS, 0.0)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert status(engine).pos_cmd[POS] == 0.0

    @pytest.mark.parametrize("kind", list(Config_ProhibitOvertravelType))
    def test_override_that_cannot_stop_in_time(self, harness: Harness, kind: int) -> None:
        # 4 rad/s at 1 rad/s2 needs 8 rad; the new target is 4 rad away.
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetMotionParam(POS)
        param.prohibitOvertravel = kind
        assert config.SetMotionParam(POS, param)[0] == GOOD
        assert motion.StartPos(pos(POS, LONG_WAY, Profile.SetupTrapezoidal(4.0, 100.0, 100.0))) == GOOD
        wait_status(engine, cruising(POS, 4.0), "cruising")
        target = status(engine).pos_cmd[POS] + 4.0
        assert motion.StartPos(pos(POS, target, Profile.SetupTrapezoidal(4.0, 100.0, 1.0))) == GOOD
        furthest = -INF
        while True:
            snapshot = status(engine)
            furthest = max(furthest, snapshot.pos_cmd[POS])
            if snapshot.op_state[POS] == OperationState.Idle:
                break
        assert snapshot.pos_cmd[POS] == target
        if kind == Config_ProhibitOvertravelType.Disabled:
            assert furthest > target + 1.0
        else:
            assert furthest <= target + 1e-9

    def test_jog_runs_until_stopped(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartJog(jog(POS, -3.0)) == GOOD
        wait_status(engine, cruising(POS, -3.0), "jogging")
        before = status(engine)
        after = some_cycles(engine, 100)
        cycles = after.cycle_counter - before.cycle_counter
        assert after.pos_cmd[POS] - before.pos_cmd[POS] == pytest.approx(-0.003 * cycles, rel=1e-6)
        assert after.op_state[POS] == OperationState.Jog
        assert motion.Stop(POS) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert not status(engine).motion_complete[POS], "a jog never completes"

    def test_jog_and_position_take_over_from_each_other(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartJog(jog(POS, 20.0)) == GOOD
        wait_status(engine, cruising(POS, 20.0), "jogging")
        assert motion.StartPos(pos(POS, LONG_WAY)) == GOOD
        assert status(engine).velocity_cmd[POS] == pytest.approx(20.0)
        assert motion.StartJog(jog(POS, 10.0)) == GOOD
        wait_status(engine, cruising(POS, 10.0), "the slower jog")

    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_timed_motion_ends_by_itself(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        profile = Profile.SetupTrapezoidal(5.0, 500.0, 500.0)
        if axis == POS:
            code = engine.core_motion.motion.StartJog_TimedJog(Motion_TimedJogCommand(POS, 1000.0, profile))
        else:
            code = engine.core_motion.velocity.StartVel_TimedVel(Velocity_TimedVelCommand(VEL, 1000.0, profile))
        assert code == GOOD
        wait_status(engine, cruising(axis, 5.0), "cruising")
        last = wait_status(engine, in_state(axis, OperationState.Idle), "the end")
        assert last.velocity_cmd[axis] == 0.0
        assert not last.motion_complete[axis]

    def test_new_command_replaces_the_end_of_a_timed_one(self, harness: Harness) -> None:
        engine = harness.ready()
        velocity = engine.core_motion.velocity
        assert velocity.StartVel_TimedVel(Velocity_TimedVelCommand(VEL, 1000.0, replace(SLOW))) == GOOD
        assert velocity.StartVel(vel(VEL, 2.0)) == GOOD
        assert some_cycles(engine, 1500).op_state[VEL] == OperationState.Velocity

    # -- velocity motion -----------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("axis", VELOCITY_AXES)
    @pytest.mark.parametrize("speed", [4.0, -4.0])
    def test_start_vel_runs_for_ever(self, harness: Harness, axis: int, speed: float) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(vel(axis, speed)) == GOOD
        wait_status(engine, lambda now: abs(now.actual_velocity[axis] - speed) < 0.01, "the drive at speed")
        before = status(engine)
        after = some_cycles(engine, 100)
        assert after.op_state[axis] == OperationState.Velocity
        moved = after.actual_pos[axis] - before.actual_pos[axis]
        assert moved == pytest.approx(speed * 1e-3 * (after.cycle_counter - before.cycle_counter), rel=0.02)
        assert after.pos_cmd[axis] == after.actual_pos[axis], "the command follows the feedback in velocity mode"
        assert not after.motion_complete[axis]
        assert not after.in_pos[axis]

    def test_velocity_over_velocity_keeps_the_ramps(self, harness: Harness) -> None:
        engine = harness.ready()
        velocity = engine.core_motion.velocity
        assert velocity.StartVel(vel(VEL, 10.0, acc=10.0, dec=5.0)) == GOOD
        up = wait_status(engine, lambda now: now.velocity_cmd[VEL] > 0.0, "the start")
        assert up.reals[Real.CMD_ACC, VEL] == pytest.approx(10.0)
        wait_status(engine, cruising(VEL, 10.0), "cruising")
        assert velocity.StartVel(vel(VEL, 4.0, acc=10.0, dec=5.0)) == GOOD
        assert status(engine).velocity_cmd[VEL] > 4.0, "no jump"
        down = wait_status(engine, lambda now: now.velocity_cmd[VEL] < 10.0, "slowing")
        assert down.reals[Real.CMD_ACC, VEL] == pytest.approx(-5.0)
        wait_status(engine, cruising(VEL, 4.0), "the slower speed")

    def test_reversal_falls_at_dec_and_grows_at_acc(self, harness: Harness) -> None:
        engine = harness.ready()
        velocity = engine.core_motion.velocity
        assert velocity.StartVel(vel(VEL, 5.0)) == GOOD
        wait_status(engine, cruising(VEL, 5.0), "cruising")
        assert velocity.StartVel(vel(VEL, -5.0, acc=5.0, dec=10.0)) == GOOD
        falling = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[VEL] < 5.0, "falling")
        assert falling.reals[Real.CMD_ACC, VEL] == pytest.approx(-10.0)
        growing = wait_status(engine, lambda now: -5.0 < now.velocity_cmd[VEL] < 0.0, "growing")
        assert growing.reals[Real.CMD_ACC, VEL] == pytest.approx(-5.0)
        wait_status(engine, cruising(VEL, -5.0), "the other direction")

    def test_zero_acceleration_is_a_step(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(vel(VEL, 3.0, acc=0.0, dec=0.0)) == GOOD
        assert some_cycles(engine, 2).velocity_cmd[VEL] == 3.0
        assert engine.core_motion.velocity.StartVel(vel(VEL, 0.0, acc=0.0, dec=0.0)) == GOOD
        assert some_cycles(engine, 2).velocity_cmd[VEL] == 0.0
        assert status(engine).op_state[VEL] == OperationState.Velocity, "velocity 0 is a velocity"

    def test_several_axes_at_once(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(2, [vel(VEL, 2.0), vel(VEL_MIRRORED, -3.0)]) == GOOD
        wait_status(engine, lambda now: cruising(VEL, 2.0)(now) and cruising(VEL_MIRRORED, -3.0)(now), "both")

    # -- stops ---------------------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_stop_uses_the_commands_own_deceleration(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        family = engine.core_motion.motion if axis == POS else engine.core_motion.velocity
        profile = Profile.SetupTrapezoidal(10.0, 400.0, 8.0)
        if axis == POS:
            assert engine.core_motion.motion.StartJog(Motion_JogCommand(POS, profile)) == GOOD
        else:
            assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, profile)) == GOOD
        wait_status(engine, cruising(axis, 10.0), "cruising")
        assert family.Stop(axis) == GOOD
        stopping = status(engine)
        assert stopping.op_state[axis] == OperationState.Stop
        slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[axis] < 10.0, "slowing")
        assert slowing.reals[Real.CMD_ACC, axis] == pytest.approx(-8.0)
        at_rest = wait_status(engine, in_state(axis, OperationState.Idle), "rest")
        assert at_rest.velocity_cmd[axis] == 0.0
        assert not at_rest.motion_complete[axis]

    def test_stop_of_a_timed_profile_takes_its_time(self, harness: Harness) -> None:
        engine = harness.ready()
        profile = Profile.SetupTimeAccTrapezoidal(10.0, 20.0, 1000.0)
        assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, profile)) == GOOD
        wait_status(engine, cruising(VEL, 10.0), "cruising")
        assert engine.core_motion.velocity.Stop(VEL) == GOOD
        slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[VEL] < 10.0, "slowing")
        assert slowing.reals[Real.CMD_ACC, VEL] == pytest.approx(-10.0)

    @pytest.mark.parametrize(("family", "axis"), [("motion", POS), ("velocity", VEL)], ids=["motion", "velocity"])
    def test_stops_on_an_idle_axis(self, harness: Harness, family: str, axis: int) -> None:
        engine = harness.ready()
        calls = getattr(engine.core_motion, family)
        assert calls.Stop(axis) == GOOD
        assert calls.Stop_AxisSel(AxisSelection.of(axis)) == GOOD
        assert calls.ExecQuickStop(axis) == GOOD
        assert calls.ExecTimedStop_TimeMilli(axis, 100.0) == GOOD
        assert_at_rest(engine)

    def test_stop_dec(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartJog(jog(POS, 10.0)) == GOOD
        wait_status(engine, cruising(POS, 10.0), "cruising")
        assert engine.core_motion.motion.Stop_Dec(POS, 12.0) == GOOD
        slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[POS] < 10.0, "slowing")
        assert slowing.reals[Real.CMD_ACC, POS] == pytest.approx(-12.0)

    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_timed_stop(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        family = engine.core_motion.motion if axis == POS else engine.core_motion.velocity
        code = (
            engine.core_motion.motion.StartJog(jog(POS, 10.0))
            if axis == POS
            else engine.core_motion.velocity.StartVel(vel(VEL, 10.0))
        )
        assert code == GOOD
        wait_status(engine, cruising(axis, 10.0), "cruising")
        assert family.ExecTimedStop_TimeMilli(axis, 1000.0) == GOOD
        slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[axis] < 10.0, "slowing")
        assert slowing.reals[Real.CMD_ACC, axis] == pytest.approx(-10.0)
        wait_status(engine, in_state(axis, OperationState.Idle), "rest")

    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_quick_stop_overrides_stop_and_not_the_reverse(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        set_quick_stop(engine, axis, 20.0)
        family = engine.core_motion.motion if axis == POS else engine.core_motion.velocity
        profile = Profile.SetupTrapezoidal(40.0, 2000.0, 4.0)
        if axis == POS:
            assert engine.core_motion.motion.StartJog(Motion_JogCommand(POS, profile)) == GOOD
        else:
            assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, profile)) == GOOD
        wait_status(engine, cruising(axis, 40.0), "cruising")
        assert family.Stop(axis) == GOOD
        wait_status(engine, braking(axis, 4.0), "a soft stop")
        assert family.ExecQuickStop(axis) == GOOD
        wait_status(engine, braking(axis, 20.0), "a quick stop")
        assert family.Stop(axis) == GOOD
        assert family.ExecTimedStop_TimeMilli(axis, 60000.0) == GOOD
        snapshot = status(engine)
        assert snapshot.flags[Flag.DETAIL_OP_STATE, axis] == DetailOperationState.Stop_QStop
        assert braking(axis, 20.0)(snapshot)
        wait_status(engine, in_state(axis, OperationState.Idle), "rest")

    def test_start_while_stopping_is_refused(self, harness: Harness) -> None:
        engine = harness.ready()
        motion, velocity = engine.core_motion.motion, engine.core_motion.velocity
        assert motion.StartJog(jog(POS, 10.0)) == GOOD
        assert velocity.StartVel(vel(VEL, 10.0)) == GOOD
        wait_status(engine, lambda now: cruising(POS, 10.0)(now) and cruising(VEL, 10.0)(now), "cruising")
        assert motion.ExecTimedStop_TimeMilli(POS, 10000.0) == GOOD
        assert velocity.ExecTimedStop_TimeMilli(VEL, 10000.0) == GOOD
        assert motion.StartPos(pos(POS, 1.0)) == CoreMotionErrorCode.NotIdleOrPosState
        assert motion.StartJog(jog(POS, 1.0)) == CoreMotionErrorCode.NotIdleOrJogState
        assert velocity.StartVel(vel(VEL, 1.0)) == CoreMotionErrorCode.NotIdleOrVelocityState
        assert status(engine).op_state[[POS, VEL]].tolist() == [OperationState.Stop, OperationState.Stop]

    # -- completion and waiting ----------------------------------------------------------------------------------------

    def test_flags_of_arrival(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS, 2.0, SLOW)) == GOOD
        moving = wait_status(engine, lambda now: now.velocity_cmd[POS] > 0.0, "motion")
        assert not moving.in_pos[POS]
        assert not moving.flags[Flag.CMD_DISTRIBUTION_END, POS]
        assert not moving.flags[Flag.POS_SET, POS]
        assert moving.reals[Real.PROFILE_TARGET_POS, POS] == 2.0
        assert 0.0 < moving.reals[Real.PROFILE_REMAINING_MS, POS] <= 1100.0
        assert engine.core_motion.motion.Wait_TimeMilli(POS, 20000) == GOOD
        there = wait_status(engine, lambda now: now.flags[Flag.POS_SET, POS], "the feedback within its width")
        assert there.in_pos[POS]
        assert there.flags[Flag.CMD_DISTRIBUTION_END, POS]
        assert there.reals[Real.PROFILE_REMAINING_MS, POS] == 0.0

    def test_wait_of_several_axes(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartPos(2, [pos(POS, 0.5), pos(POS_GEARED, 2.0)]) == GOOD
        assert motion.Wait_AxisSel(AxisSelection.of(POS, POS_GEARED)) == GOOD
        assert status(engine).pos_cmd[[POS, POS_GEARED]].tolist() == [0.5, 2.0]

    def test_wait_gives_up_in_time(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW)) == GOOD
        assert engine.core_motion.motion.Wait_TimeMilli(POS, 20) == CoreMotionErrorCode.WaitTimeout
        assert status(engine).op_state[POS] == OperationState.Pos

    def test_wait_on_an_axis_that_does_not_exist(self, harness: Harness) -> None:
        assert harness.ready().core_motion.motion.Wait(N_AXES) == ErrorCode.AxisOutOfRange

    def test_wait_with_the_servo_off(self, harness: Harness) -> None:
        assert harness.communicating().core_motion.motion.Wait(POS) == ErrorCode.ServoOff

    def test_wait_without_communication(self, harness: Harness) -> None:
        assert harness.connect().core_motion.motion.Wait(POS) == ErrorCode.ServoOffline

    # -- emergency stop ------------------------------------------------------------------------------------------------

    @parametrize("name", {name: name for name in STARTS})
    def test_estop_stops_every_kind_of_motion(self, harness: Harness, name: str) -> None:
        engine = harness.ready()
        _, param = engine.core_motion.config.GetEmergencyStopParam()
        param.eStopDec = [2.0] * N_AXES
        assert engine.core_motion.config.SetEmergencyStopParam(param)[0] == GOOD
        assert STARTS[name](engine) == GOOD
        axis = STARTED_AXIS[name]
        wait_status(engine, cruising(axis, 2.0), "motion")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        snapshot = status(engine)
        assert snapshot.emergency_stop
        assert snapshot.emergency_stop_level == EStopLevel.Level1
        assert snapshot.op_state[axis] == OperationState.Stop
        assert snapshot.flags[Flag.DETAIL_OP_STATE, axis] == DetailOperationState.Stop_EStop
        wait_status(engine, braking(axis, 2.0), "the emergency deceleration")
        at_rest = wait_status(engine, in_state(axis, OperationState.Idle), "rest")
        assert not at_rest.motion_complete[axis]
        assert at_rest.servo_on.all(), "level 1 keeps the servos on"

    @pytest.mark.parametrize("stop", ["Stop", "ExecQuickStop", "ExecTimedStop"])
    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_estop_wins_over_a_stop(self, harness: Harness, axis: int, stop: str) -> None:
        engine = harness.ready()
        set_quick_stop(engine, axis, 4.0)  # softer than the emergency stop
        set_estop(engine, 20.0)
        family = engine.core_motion.motion if axis == POS else engine.core_motion.velocity
        profile = Profile.SetupTrapezoidal(40.0, 2000.0, 4.0)
        if axis == POS:
            assert engine.core_motion.motion.StartJog(Motion_JogCommand(POS, profile)) == GOOD
        else:
            assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, profile)) == GOOD
        wait_status(engine, cruising(axis, 40.0), "cruising")
        if stop == "ExecTimedStop":
            assert family.ExecTimedStop_TimeMilli(axis, 10000.0) == GOOD
        else:
            assert getattr(family, stop)(axis) == GOOD
        wait_status(engine, braking(axis, 4.0), "the softer stop")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        wait_status(engine, braking(axis, 20.0), "the emergency deceleration")
        for call in (family.Stop, family.ExecQuickStop):
            assert call(axis) == GOOD
        assert braking(axis, 20.0)(status(engine)), "nothing softens it"
        wait_status(engine, in_state(axis, OperationState.Idle), "rest")

    def test_estop_does_not_soften_a_harder_stop(self, harness: Harness) -> None:
        engine = harness.ready()
        set_quick_stop(engine, VEL, 20.0)
        set_estop(engine, 5.0)
        assert engine.core_motion.velocity.StartVel(vel(VEL, 40.0, acc=2000.0, dec=400.0)) == GOOD
        wait_status(engine, cruising(VEL, 40.0), "cruising")
        assert engine.core_motion.velocity.ExecQuickStop(VEL) == GOOD
        wait_status(engine, braking(VEL, 20.0), "the quick stop")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert braking(VEL, 20.0)(some_cycles(engine, 2))

    @parametrize("call", STARTS)
    def test_start_during_estop(self, harness: Harness, call: Call) -> None:
        engine = harness.ready()
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert call(engine) == CoreMotionErrorCode.EmergencyStopSignalOn
        assert_at_rest(engine)
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert call(engine) == GOOD

    def test_servo_on_and_homing_during_estop(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        stopped = CoreMotionErrorCode.EmergencyStopSignalOn
        assert engine.core_motion.axisControl.SetServoOn(POS, 1) == stopped
        assert engine.core_motion.home.StartHome(POS) == stopped
        assert not some_cycles(engine, 20).servo_on.any()

    def test_release_moves_nothing(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        wait_status(engine, in_state(VEL, OperationState.Idle), "rest")
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert not status(engine).emergency_stop
        assert_at_rest(engine)

    def test_release_without_estop(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert not status(engine).emergency_stop

    def test_release_while_still_stopping_lets_the_stop_end(self, harness: Harness) -> None:
        engine = harness.ready()
        set_estop(engine, 40.0)
        assert engine.core_motion.velocity.StartVel(vel(VEL, 80.0, acc=0.0)) == GOOD
        wait_status(engine, cruising(VEL, 80.0), "cruising")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert engine.core_motion.velocity.StartVel(vel(VEL, 80.0)) == CoreMotionErrorCode.NotIdleOrVelocityState
        wait_status(engine, in_state(VEL, OperationState.Idle), "rest")

    def test_estop_twice(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert status(engine).emergency_stop

    def test_final_level_switches_servos_off(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert engine.core_motion.ExecEStop(EStopLevel.Final) == GOOD
        snapshot = wait_status(engine, lambda now: not now.servo_on.any(), "servos off")
        assert snapshot.emergency_stop_level == EStopLevel.Final
        assert_at_rest(engine)
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert not some_cycles(engine, 20).servo_on.any(), "servos stay off after the release"

    def test_level_one_does_not_lower_final(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert engine.core_motion.ExecEStop(EStopLevel.Final) == GOOD
        higher = CoreMotionErrorCode.CurrentEmergencyStopLevelIsHigher
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == higher
        assert status(engine).emergency_stop_level == EStopLevel.Final

    @pytest.mark.parametrize("level", [-1, 2, 10**9])
    def test_unknown_level(self, harness: Harness, level: int) -> None:
        engine = harness.ready()
        assert engine.core_motion.ExecEStop(level) == ErrorCode.ArgumentOutOfRange
        assert not status(engine).emergency_stop

    def test_servos_off_after_the_stop_if_told_so(self, harness: Harness) -> None:
        engine = harness.ready()
        set_estop(engine, 20.0)
        config = engine.core_motion.config
        _, param = config.GetEmergencyStopParam()
        param.eStopLevel1Type = Config_EStopLevel1Type.DecServoOff
        assert config.SetEmergencyStopParam(param)[0] == GOOD
        assert engine.core_motion.velocity.StartVel(vel(VEL, 20.0, acc=0.0)) == GOOD
        wait_status(engine, cruising(VEL, 20.0), "cruising")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        stopping = status(engine)
        assert stopping.op_state[VEL] == OperationState.Stop
        assert stopping.servo_on[VEL], "only after the ramp"
        wait_status(engine, lambda now: not now.servo_on.any(), "servos off")

    @pytest.mark.parametrize("level", list(EStopLevel))
    def test_estop_before_communication_holds_after_it(self, harness: Harness, level: int) -> None:
        engine = harness.connect()
        assert engine.core_motion.ExecEStop(level) == GOOD
        assert engine.api.StartCommunication(20000) == GOOD
        assert status(engine).emergency_stop
        assert engine.core_motion.axisControl.SetServoOn(POS, 1) == CoreMotionErrorCode.EmergencyStopSignalOn

    def test_estop_survives_a_break_of_communication(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert engine.api.StopCommunication() == GOOD
        assert engine.api.StartCommunication(20000) == GOOD
        assert status(engine).emergency_stop

    def test_estop_by_another_device(self, harness: Harness) -> None:
        engine, other = harness.ready("one"), harness.connect("other")
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert other.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        wait_status(engine, in_state(VEL, OperationState.Idle), "rest")
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == CoreMotionErrorCode.EmergencyStopSignalOn

    def test_servo_off_works_during_estop(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert engine.core_motion.axisControl.SetServoOn(POS, 0) == GOOD
        wait_status(engine, lambda now: not now.servo_on[POS], "servo off")

    # -- homing and names of positions ---------------------------------------------------------------------------------

    @pytest.mark.parametrize("axis", range(N_AXES))
    def test_home_to_the_current_position(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        home, config = engine.core_motion.home, engine.core_motion.config
        _, param = config.GetHomeParam(axis)
        param.homeType = Config_HomeType.CurrentPos
        param.homePosition = 0.25
        assert config.SetHomeParam(axis, param)[0] == GOOD
        before = status(engine)
        assert home.StartHome(axis) == GOOD
        assert engine.core_motion.motion.Wait_TimeMilli(axis, 20000) == GOOD
        after = status(engine)
        assert after.home_done[axis]
        assert after.pos_cmd[axis] == pytest.approx(0.25, abs=1e-6)
        assert after.flags[Flag.ENCODER_COMMAND, axis] == pytest.approx(before.flags[Flag.ENCODER_COMMAND, axis], abs=1)
        assert_at_rest(engine)

    def test_position_after_homing_is_the_users(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        start = status(engine).flags[Flag.ENCODER_COMMAND, POS]
        assert motion.StartPos(pos(POS, 1.5)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert motion.StartPos(pos(POS, 0.5)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        snapshot = status(engine)
        assert snapshot.pos_cmd[POS] == 0.5
        moved = snapshot.flags[Flag.ENCODER_COMMAND, POS] - start
        assert moved == pytest.approx(2.0 * 131072 / (2 * math.pi), abs=2)

    def test_homing_with_the_servo_off(self, harness: Harness) -> None:
        assert harness.communicating().core_motion.home.StartHome(POS) == CoreMotionErrorCode.NotServoOn

    def test_homing_in_motion(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartJog(jog(POS, 1.0)) == GOOD
        assert engine.core_motion.home.StartHome(POS) == ErrorCode.NotIdleState
        both = AxisSelection.of(POS_GEARED, POS)
        assert engine.core_motion.home.StartHome_AxisSel(both) == ErrorCode.NotIdleState
        assert not status(engine).home_done[[POS, POS_GEARED]].any(), "all or nothing"

    @pytest.mark.parametrize(
        ("kind", "code"),
        [
            (Config_HomeType.ZPulse, CoreMotionErrorCode.ZPulseDetectionUnsupported),
            (Config_HomeType.HS, CoreMotionErrorCode.HomeSwitchDetectionUnsupported),
            (Config_HomeType.TouchProbe, CoreMotionErrorCode.TouchProbeDetectionUnsupported),
            (Config_HomeType.LS, CoreMotionErrorCode.LimitSwitchDetectionUnsupported),
        ],
    )
    def test_homing_that_needs_a_sensor_the_drives_lack(self, harness: Harness, kind: int, code: int) -> None:
        engine = harness.ready()
        _, param = engine.core_motion.config.GetHomeParam(POS)
        param.homeType = kind
        assert engine.core_motion.config.SetHomeParam(POS, param)[0] == GOOD
        assert engine.core_motion.home.StartHome(POS) == code
        assert not status(engine).home_done[POS]

    @pytest.mark.parametrize(("call", "row"), [("SetCommandPos", Real.POS_CMD), ("SetFeedbackPos", Real.ACTUAL_POS)])
    def test_renaming_a_position(self, harness: Harness, call: str, row: Real) -> None:
        engine = harness.ready()
        rename = getattr(engine.core_motion.home, call)
        counts = status(engine).flags[Flag.ENCODER_COMMAND, POS]
        assert rename(POS, 12.5) == GOOD
        snapshot = status(engine)
        assert snapshot.reals[row, POS] == pytest.approx(12.5, abs=1e-3)
        assert_at_rest(engine)
        assert status(engine).flags[Flag.ENCODER_COMMAND, POS] == pytest.approx(counts, abs=1)

    @pytest.mark.parametrize("position", [NAN, INF, -INF, 1e15])
    @pytest.mark.parametrize("call", ["SetCommandPos", "SetFeedbackPos"])
    def test_renaming_to_nonsense(self, harness: Harness, call: str, position: float) -> None:
        engine = harness.ready()
        before = status(engine).pos_cmd[POS]
        rename = getattr(engine.core_motion.home, call)
        assert rename(POS, position) == CoreMotionErrorCode.PositionArgumentOutOfRange
        assert status(engine).pos_cmd[POS] == before

    def test_renaming_in_motion(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartJog(jog(POS, 1.0)) == GOOD
        assert engine.core_motion.home.SetCommandPos(POS, 5.0) == ErrorCode.NotIdleState

    def test_home_done_by_hand(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.core_motion.home.SetHomeDone(POS, 1) == GOOD
        assert status(engine).home_done[POS]
        assert engine.core_motion.home.SetHomeDone(POS, 0) == GOOD
        assert not status(engine).home_done[POS]
        assert engine.core_motion.home.SetHomeDone(POS, 2) == ErrorCode.ArgumentOutOfRange

    def test_home_is_lost_with_communication(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.home.StartHome(POS) == GOOD
        engine.api.StopCommunication()
        engine.api.StartCommunication(20000)
        assert not status(engine).home_done[POS]

    # -- parameters ----------------------------------------------------------------------------------------------------

    def test_gear_ratio_scales_positions(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        assert config.SetGearRatio(POS, 1000.0, 2.0) == GOOD
        assert config.GetGearRatio(POS) == (GOOD, 1000.0, 2.0)
        assert_at_rest(engine)
        assert engine.core_motion.home.SetCommandPos(POS, 0.0) == GOOD  # in the new unit it may be far away
        assert motion.StartPos(pos(POS, 3.0)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        snapshot = status(engine)
        machine = 3.0 + snapshot.reals[Real.HOME_OFFSET, POS]
        assert snapshot.flags[Flag.ENCODER_COMMAND, POS] == pytest.approx(500.0 * machine, abs=0.51)

    def test_gear_ratio_unhomes(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert engine.core_motion.config.SetGearRatio(POS, 2000.0, 1.0) == GOOD
        assert not status(engine).home_done[POS]

    @pytest.mark.parametrize("value", [NAN, INF, 0.0, -1.0, 1e-7, 3e9])
    def test_bad_gear_ratio(self, harness: Harness, value: float) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        before = config.GetGearRatio(POS)
        assert config.SetGearRatio(POS, value, 1.0) == ErrorCode.ArgumentOutOfRange
        assert config.SetGearRatio(POS, 1.0, value) == ErrorCode.ArgumentOutOfRange
        assert config.GetGearRatio(POS) == before
        assert_at_rest(engine)

    def test_gear_and_polarity_in_motion(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartJog(jog(POS, 1.0)) == GOOD
        assert engine.core_motion.config.SetGearRatio(POS, 10.0, 1.0) == ErrorCode.NotIdleState
        assert engine.core_motion.config.SetAxisPolarity(POS, -1) == ErrorCode.NotIdleState

    def test_polarity_mirrors_positions_and_moves_nothing(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        assert motion.StartPos(pos(POS, 1.0)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        counts = status(engine).flags[Flag.ENCODER_COMMAND, POS]
        assert config.SetAxisPolarity(POS, -1) == GOOD
        assert config.GetAxisPolarity(POS) == (GOOD, -1)
        snapshot = some_cycles(engine)
        offset = snapshot.reals[Real.HOME_OFFSET, POS]
        assert snapshot.pos_cmd[POS] == pytest.approx(-(1.0 + offset) - offset, abs=1e-4)
        assert snapshot.flags[Flag.ENCODER_COMMAND, POS] == counts

    @pytest.mark.parametrize("polarity", [0, 2, -2])
    def test_bad_polarity(self, harness: Harness, polarity: int) -> None:
        engine = harness.ready()
        assert engine.core_motion.config.SetAxisPolarity(POS, polarity) == ErrorCode.ArgumentOutOfRange
        assert engine.core_motion.config.GetAxisPolarity(POS) == (GOOD, 1)

    @pytest.mark.parametrize(
        ("block", "changes"),
        [
            ("FeedbackParam", {"inPosWidth": 0.5, "posSetWidth": 0.25, "delayedPosSetMilliseconds": 10.0}),
            ("HomeParam", {"homePosition": 1.5, "clearHomeDoneOnServoOff": True}),
            ("LimitParam", {"softLimitType": Config_LimitSwitchType.Dec, "softLimitPositivePos": 3.0, "lsDec": 50.0}),
            ("MotionParam", {"quickStopDec": 123.0}),
            ("AlarmParam", {"followingErrorMoving": 0.5, "velocityFollowingErrorMoving": 2.0}),
        ],
        ids=lambda value: value if isinstance(value, str) else "",
    )
    def test_block_round_trip(self, harness: Harness, block: str, changes: dict[str, Any]) -> None:
        config = harness.connect().core_motion.config
        code, param = getattr(config, f"Get{block}")(POS)
        assert code == GOOD
        wanted = replace(param, **changes)
        assert wanted != param
        assert getattr(config, f"Set{block}")(POS, wanted) == (GOOD, wanted)
        assert getattr(config, f"Get{block}")(POS) == (GOOD, wanted)
        assert getattr(config, f"Get{block}")(VEL)[1] != wanted, "other axes keep theirs"

    @pytest.mark.parametrize(
        ("block", "changes"),
        [
            ("FeedbackParam", {"inPosWidth": NAN}),
            ("FeedbackParam", {"posSetWidth": -1.0}),
            ("HomeParam", {"homePosition": INF}),
            ("HomeParam", {"homeType": 99}),
            ("LimitParam", {"softLimitPositivePos": NAN}),
            ("LimitParam", {"softLimitType": 77}),
            ("LimitParam", {"positiveSoftLimitType": Config_LimitSwitchType.SeparatePositiveLSNegativeLS}),
            ("LimitParam", {"lsDec": 0.0}),
            ("MotionParam", {"quickStopDec": 0.0}),
            ("MotionParam", {"quickStopDec": NAN}),
            ("MotionParam", {"prohibitOvertravel": 9}),
            ("AlarmParam", {"followingErrorMoving": -1.0}),
            ("AlarmParam", {"velocityFollowingErrorMoving": NAN}),
            ("AlarmParam", {"followingErrorType": 5}),
        ],
        ids=str,
    )
    def test_bad_block(self, harness: Harness, block: str, changes: dict[str, Any]) -> None:
        config = harness.connect().core_motion.config
        _, param = getattr(config, f"Get{block}")(POS)
        code, _ = getattr(config, f"Set{block}")(POS, replace(param, **changes))
        assert code == CoreMotionErrorCode.ParameterSettingsInvalid
        assert getattr(config, f"Get{block}")(POS) == (GOOD, param)

    def test_emergency_stop_block(self, harness: Harness) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        _, param = config.GetEmergencyStopParam()
        assert len(param.eStopDec) == N_AXES
        param.eStopDec[VEL] = 10.0
        assert config.SetEmergencyStopParam(param)[0] == GOOD
        assert engine.core_motion.velocity.StartVel(vel(VEL, 20.0)) == GOOD
        wait_status(engine, cruising(VEL, 20.0), "cruising")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[VEL] < 20.0, "slowing")
        assert slowing.reals[Real.CMD_ACC, VEL] == pytest.approx(-10.0)

    @pytest.mark.parametrize(
        "changes",
        [
            {"eStopDec": []},
            {"eStopDec": [0.0] * N_AXES},
            {"eStopDec": [NAN] * N_AXES},
            {"eStopSignalLevel": 7},
            {"eStopSignalByteAddress": 4},
            {"eStopSignalBitAddress": 8},
            {"eStopSignalSource": 1},
            {"eStopLevel1Type": 2},
        ],
        ids=str,
    )
    def test_bad_emergency_stop_block(self, harness: Harness, changes: dict[str, Any]) -> None:
        config = harness.connect().core_motion.config
        _, param = config.GetEmergencyStopParam()
        code, _ = config.SetEmergencyStopParam(replace(param, **changes))
        assert code == CoreMotionErrorCode.ParameterSettingsInvalid
        assert config.GetEmergencyStopParam() == (GOOD, param)

    def test_all_parameters_at_once(self, harness: Harness) -> None:
        config = harness.connect().core_motion.config
        code, system = config.GetParam()
        assert code == GOOD
        assert system.GetMotionParam(POS).quickStopDec == QUICK_STOP_DEC
        assert len(system.feedbackParam) == len(system.homeParam) == len(system.limitParam) == N_AXES
        assert len(system.motionParam) == len(system.alarmParam) == N_AXES
        code, axes = config.GetAxisParam()
        assert code == GOOD
        assert axes.axisPolarity == [1, 1, -1, -1, 1]
        assert axes.GetGearRatioNumerator(POS_GEARED) == 52953088.0
        assert axes.GetAxisCommandMode(VEL) == AxisCommandMode.Velocity
        assert axes.GetAbsoluteEncoderMode(POS_MIRRORED)

    def test_parameter_file_there_and_back(self, harness: Harness) -> None:
        config = harness.communicating().core_motion.config
        first, second = harness.folder / "first.xml", harness.folder / "second.xml"
        assert config.GetAndExportAll(str(first)) == GOOD
        code, param = config.GetMotionParam(POS)
        assert code == GOOD
        before = param.quickStopDec
        param.quickStopDec = before + 1.0
        assert config.SetMotionParam(POS, param)[0] == GOOD
        assert config.SetGearRatio(POS_GEARED, 1000.0, 3.0) == GOOD
        assert config.ImportAndSetAll(str(first)) == GOOD
        assert config.GetMotionParam(POS)[1].quickStopDec == before
        assert config.GetGearRatio(POS_GEARED)[1] != 1000.0
        assert config.GetAndExportAll(str(second)) == GOOD
        assert first.read_bytes() == second.read_bytes()

    def test_parameter_files_that_are_refused(self, harness: Harness) -> None:
        config = harness.communicating().core_motion.config
        path = harness.folder / "parameters.xml"
        assert config.ImportAndSetAll(str(harness.folder / "missing.xml")) == ErrorCode.FileOperationFailed
        assert config.ImportAndSetAll(str(harness.folder)) == ErrorCode.FileOperationFailed
        assert config.GetAndExportAll(str(harness.folder / "no" / "folder.xml")) == ErrorCode.FileOperationFailed
        path.write_text("<Parameters><GlobalParameters>", encoding="utf-8")
        assert config.ImportAndSetAll(str(path)) == CoreMotionErrorCode.ParameterFileParseError
        path.write_text("<Parameters><GlobalParameters/></Parameters>", encoding="utf-8")
        assert config.ImportAndSetAll(str(path)) == CoreMotionErrorCode.ParameterSettingsInvalid, "all zeros"

    def test_one_bad_parameter_of_a_file_and_none_is_set(self, harness: Harness) -> None:
        config = harness.communicating().core_motion.config
        path = harness.folder / "parameters.xml"
        assert config.GetAndExportAll(str(path)) == GOOD
        before = config.GetParam(), config.GetAxisParam()
        text = path.read_text(encoding="utf-8")
        # Axis 0 gets a good value and the last axis a bad one.
        head, mark, rest = text.partition(f'<AxisParameters Axis="{N_AXES - 1}">')
        head = head.replace("<InPosWidth>0.010000<", "<InPosWidth>0.500000<")
        assert "0.500000" in head
        bad = rest.replace("<LSDec>10000.000000<", "<LSDec>0.000000<", 1)
        path.write_text(head + mark + bad, encoding="utf-8")
        assert config.ImportAndSetAll(str(path)) == CoreMotionErrorCode.ParameterSettingsInvalid
        assert (config.GetParam(), config.GetAxisParam()) == before

    def test_no_parameter_file_under_a_moving_axis(self, harness: Harness) -> None:
        engine = harness.ready()
        path = str(harness.folder / "parameters.xml")
        assert engine.core_motion.config.GetAndExportAll(path) == GOOD
        assert engine.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW)) == GOOD
        assert engine.core_motion.config.ImportAndSetAll(path) == ErrorCode.NotIdleState

    # -- soft limits ---------------------------------------------------------------------------------------------------

    def test_soft_limit_stops_and_lets_out(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetLimitParam(POS)
        param.softLimitType, param.softLimitPositivePos, param.lsDec = Config_LimitSwitchType.Dec, 1.0, 400.0
        assert config.SetLimitParam(POS, param)[0] == GOOD
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert motion.StartPos(pos(POS, 5.0, SLOW)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == ErrorCode.AxisSoftLimit
        snapshot = status(engine)
        assert snapshot.flags[Flag.POSITIVE_SOFT_LIMIT, POS]
        assert 1.0 < snapshot.pos_cmd[POS] < 1.1
        assert not snapshot.motion_complete[POS]
        assert motion.StartPos(pos(POS, 5.0)) == ErrorCode.AxisSoftLimit, "no further"
        assert motion.StartJog(jog(POS, 1.0)) == ErrorCode.AxisSoftLimit
        assert motion.StartPos(pos(POS, 0.5)) == GOOD, "back is free"
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD

    def test_soft_limit_needs_a_homed_axis(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetLimitParam(POS)
        param.softLimitType, param.softLimitPositivePos = Config_LimitSwitchType.Dec, 0.5
        assert config.SetLimitParam(POS, param)[0] == GOOD
        assert motion.StartPos(pos(POS, 1.0)) == GOOD
        assert motion.Wait_TimeMilli(POS, 20000) == GOOD
        assert status(engine).pos_cmd[POS] == 1.0

    def test_negative_soft_limit_with_servo_off(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetLimitParam(POS)
        param.softLimitType, param.softLimitNegativePos = Config_LimitSwitchType.SlowDecServoOff, -0.5
        param.lsSlowDec = 100.0
        assert config.SetLimitParam(POS, param)[0] == GOOD
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert motion.StartJog(jog(POS, -2.0)) == GOOD
        snapshot = wait_status(engine, lambda now: not now.servo_on[POS], "servo off")
        assert snapshot.flags[Flag.NEGATIVE_SOFT_LIMIT, POS]

    # -- I/O and network -----------------------------------------------------------------------------------------------

    def test_output_bits_and_bytes(self, harness: Harness) -> None:
        io = harness.communicating().io
        assert io.SetOutBit(1, 3, 1) == GOOD
        assert io.GetOutBit(1, 3) == (GOOD, 1)
        assert io.GetOutByte(1) == (GOOD, 8)
        assert io.SetOutBit(1, 0, 1) == GOOD
        assert io.SetOutBit(1, 3, 0) == GOOD
        assert io.GetOutByte(1) == (GOOD, 1)
        assert io.SetOutBytes(0, 4, [1, 2, 3, 255]) == GOOD
        assert io.GetOutBytes(0, 4) == (GOOD, [1, 2, 3, 255])
        assert io.SetOutByte(3, 0) == GOOD
        assert io.GetOutBytes(2, 2) == (GOOD, [3, 0])

    @pytest.mark.parametrize("byte", [-1, 4, 8000])
    def test_io_address(self, harness: Harness, byte: int) -> None:
        io = harness.communicating().io
        code = ErrorCode.IOAddressOutOfRange
        assert io.SetOutBit(byte, 0, 1) == code
        assert io.GetOutBit(byte, 0) == (code, 0)
        assert io.GetInBit(byte, 0) == (code, 0)
        assert io.SetOutByte(byte, 1) == code
        assert io.GetOutByte(byte) == (code, 0)
        assert io.GetInByte(byte) == (code, 0)
        assert io.GetInBytes(byte, 1) == (code, [])

    @pytest.mark.parametrize("bit", [-1, 8])
    def test_io_bit(self, harness: Harness, bit: int) -> None:
        io = harness.communicating().io
        assert io.SetOutBit(0, bit, 1) == ErrorCode.IOAddressOutOfRange
        assert io.GetOutBit(0, bit) == (ErrorCode.IOAddressOutOfRange, 0)
        assert io.GetInBit(0, bit) == (ErrorCode.IOAddressOutOfRange, 0)

    def test_io_sizes_and_values(self, harness: Harness) -> None:
        io = harness.communicating().io
        assert io.SetOutBytes(2, 3, [0, 0, 0]) == ErrorCode.IOSizeOutOfRange
        assert io.SetOutBytes(0, 2, [0]) == ErrorCode.IOSizeOutOfRange
        assert io.SetOutBytes(0, 0, []) == ErrorCode.IOSizeOutOfRange
        assert io.GetOutBytes(0, 5) == (ErrorCode.IOSizeOutOfRange, [])
        assert io.GetInBytes(0, 0) == (ErrorCode.IOSizeOutOfRange, [])
        for value in (-1, 256):
            assert io.SetOutByte(0, value) == ErrorCode.ArgumentOutOfRange
        for value in (-1, 2):
            assert io.SetOutBit(0, 0, value) == ErrorCode.ArgumentOutOfRange
        assert io.GetOutBytes(0, 4) == (GOOD, [0, 0, 0, 0])

    def test_network(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.ecat.ScanNetwork(0) == GOOD
        assert engine.ecat.ScanNetwork(1) == ErrorCode.ArgumentOutOfRange
        engine.api.StartCommunication(20000)
        code, info = engine.ecat.GetMasterInfo()
        assert code == GOOD
        assert info.numOfSlaves == len(info.slaves) == N_AXES
        assert info.statisticsInfo.commPeriod == 1_000_000
        assert info.statisticsInfo.packetLoss == 0
        assert info.statisticsInfo.packetTimeout == 0
        assert info.statisticsInfo.totalAxesNum == N_AXES
        assert [slave.id for slave in info.slaves] == list(range(N_AXES))
        assert {slave.state for slave in info.slaves} == {info.state} == {EcStateMachine.Op}
        assert len({slave.address for slave in info.slaves}) == N_AXES
        assert sum(slave.numOfAxes for slave in info.slaves) == N_AXES
        assert not any(slave.offline for slave in info.slaves)

    def test_registers(self, harness: Harness) -> None:
        engine = harness.communicating()
        code, data = engine.ecat.RegisterRead(1, 0x0130, 2)
        assert (code, data) == (GOOD, [int(EcStateMachine.Op), 0]), "the slave's state"
        code, data = engine.ecat.RegisterRead(N_AXES - 1, 0x0000, 0x1000)
        assert (code, len(data)) == (GOOD, 0x1000)
        for slave, address, length in (
            (N_AXES, 0, 1),
            (-1, 0, 1),
            (0, -1, 1),
            (0, 0, 0),
            (0, 0, -1),
            (0, 0x1000, 1),
            (0, 0xFFF, 2),
            (0, 0, 0x1001),
        ):
            assert engine.ecat.RegisterRead(slave, address, length) == (ErrorCode.ArgumentOutOfRange, [])

    def test_statistics_and_hot_connect(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.ecat.StartHotconnect() == EcErrorCode.HotconnectFailed, "nothing to join"
        assert engine.ecat.ResetTransmitStatisticsInfo() == GOOD
        assert engine.api.StartCommunication(20000) == GOOD
        assert engine.ecat.StartHotconnect() == GOOD
        assert engine.ecat.GetMasterInfo()[1].statisticsInfo.hcState == EcHotconnectState.Idle

    def test_error_texts(self, harness: Harness) -> None:
        engine = harness.connect()
        lock, not_on = ErrorCode.CreateDeviceLockError, CoreMotionErrorCode.NotServoOn
        assert "being created" in engine.api.ErrorToString(lock)
        assert "being created" in engine.core_motion.ErrorToString(lock)
        assert engine.core_motion.ErrorToString(not_on) == "the servo is not on"
        assert engine.api.ErrorToString(not_on) == "error code not defined", "another module's code"
        assert engine.io.ErrorToString(123456789) == "error code not defined"

    # -- several devices -----------------------------------------------------------------------------------------------

    def test_closing_a_device_stops_its_axes_and_no_others(self, harness: Harness) -> None:
        one, two = harness.ready("one"), harness.connect("two")
        assert one.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert two.core_motion.velocity.StartVel(vel(VEL_MIRRORED, 5.0)) == GOOD
        assert one.api.CloseDevice() == GOOD
        wait_status(two, in_state(VEL, OperationState.Idle), "the closed device's axis at rest")
        assert some_cycles(two, 50).op_state[VEL_MIRRORED] == OperationState.Velocity

    def test_axis_belongs_to_who_moved_it_last(self, harness: Harness) -> None:
        one, two = harness.ready("one"), harness.connect("two")
        assert one.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert two.core_motion.velocity.StartVel(vel(VEL, 6.0)) == GOOD
        assert one.api.CloseDevice() == GOOD
        assert some_cycles(two, 50).op_state[VEL] == OperationState.Velocity

    def test_watchdog_stops_the_axes_of_a_silent_device(self, harness: Harness) -> None:
        one, two = harness.ready("one"), harness.connect("two")
        assert one.api.SetWatchdog(2000) == GOOD
        assert one.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert two.core_motion.velocity.StartVel(vel(VEL_MIRRORED, 5.0)) == GOOD
        wait_status(two, in_state(VEL, OperationState.Idle), "the silent device's axis at rest")
        assert status(two).op_state[VEL_MIRRORED] == OperationState.Velocity
        assert one.api.GetWatchdog() == (GOOD, 2000, 1)
        assert one.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD, "it may go on"

    def test_calls_keep_the_watchdog_quiet(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.api.SetWatchdog(60_000) == GOOD
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        for _ in range(10):
            some_cycles(engine, 20)
            assert engine.api.ResetWatchdogTimer() == GOOD
        assert status(engine).op_state[VEL] == OperationState.Velocity
        assert engine.api.GetWatchdog() == (GOOD, 60_000, 0)

    @pytest.mark.parametrize("milliseconds", [-1, 10**9])
    def test_bad_watchdog(self, harness: Harness, milliseconds: int) -> None:
        engine = harness.connect()
        assert engine.api.SetWatchdog(milliseconds) == ErrorCode.ArgumentOutOfRange
        assert engine.api.GetWatchdog() == (GOOD, 0, 0)

    def test_many_devices(self, harness: Harness) -> None:
        engines = [harness.connect(f"client {index}") for index in range(20)]
        assert engines[0].api.GetAllDevices()[1].count == 20
        assert len({engine.api.GetDeviceID()[1] for engine in engines}) == 20
