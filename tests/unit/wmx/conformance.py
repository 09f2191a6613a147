"""Requirements for any implementation of the engine port. A test class inherits it and adds the fixture ``harness``.

The tests use the port alone: commands, codes and status. Expected codes are the vendor's names; motion is compared
with kinematics computed by hand. The observer is a separate process and may read late: phases that a test must see
last at least half a second of engine time, and exact cycles are tested in the engine's own tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from enum import IntEnum
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
    EngineState,
    ErrorCode,
    EStopLevel,
    Motion_PosCommand,
    OperationState,
    Profile,
    ProfileType,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.api.surface import SURFACE, Commands, Plain
from robot_stack.wmx.api.surface import Call as SurfaceCall
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
    part,
    some_cycles,
    status,
    wait_idle,
    wait_status,
)
from tests.unit.wmx.spline_conformance import SplineConformance, start_of_one_axis

GOOD = ErrorCode.PyNone
NAN, INF = math.nan, math.inf
FAST = Profile.SetupTrapezoidal(20.0, 400.0, 400.0)
SLOW = Profile.SetupTrapezoidal(2.0, 20.0, 20.0)
SLOW_BY_TIMES = Profile.SetupTimeAccTrapezoidal(2.0, 100.0, 100.0)
LONG_WAY = 1000.0
Call = Callable[[MotionEngine], Any]


def pos(axis: int, target: float, profile: Profile = FAST) -> Motion_PosCommand:
    return Motion_PosCommand(axis, target, replace(profile))


def vel(axis: int, velocity: float, acc: float = 400.0, dec: float = 400.0) -> Velocity_VelCommand:
    return Velocity_VelCommand(axis, Profile.SetupTrapezoidal(velocity, acc, dec))


def along(axis: int, velocity: float, dec: float = 400.0) -> Motion_PosCommand:
    """Returns a command to a position so far away that the axis keeps moving at a velocity."""
    return Motion_PosCommand(
        axis, math.copysign(LONG_WAY, velocity), Profile.SetupTrapezoidal(abs(velocity), 400.0, dec)
    )


def code_of(answer: Any) -> int:
    """Returns the code of an answer of any shape."""
    return answer[0] if isinstance(answer, tuple) else answer


# Calls that start motion, on axes in the matching mode.
STARTS: dict[str, Call] = {
    "StartPos": lambda e: e.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW)),
    "StartPos_n": lambda e: e.core_motion.motion.StartPos(
        2, [pos(POS, LONG_WAY, SLOW), pos(POS_MIRRORED, -LONG_WAY, SLOW)]
    ),
    "StartMov": lambda e: e.core_motion.motion.StartMov(pos(POS, LONG_WAY, SLOW)),
    "StartPos_long": lambda e: e.core_motion.motion.StartPos(along(POS, 2.0)),
    "StartVel": lambda e: e.core_motion.velocity.StartVel(vel(VEL, 2.0)),
    "StartVel_n": lambda e: e.core_motion.velocity.StartVel(2, [vel(VEL, 2.0), vel(VEL_MIRRORED, -2.0)]),
    "StartVel_TimedVel": lambda e: e.core_motion.velocity.StartVel_TimedVel(
        Velocity_TimedVelCommand(VEL, 60000.0, replace(SLOW_BY_TIMES))
    ),
}
STARTED_AXIS = {name: VEL if "Vel" in name else POS for name in STARTS}

AxisCall = Callable[[MotionEngine, int], Any]
_ELSEWHERE = ("CreateDevice", "IsDeviceValid", "SetEmergencyStopParam")  # return no code, or need a valid block


def _argument(kind: Any, axis: int) -> Any:
    """Returns an argument that every row accepts, on an idle axis."""
    if kind is AxisSelection:
        return AxisSelection.of(axis)
    if isinstance(kind, Commands):
        return kind.kind(axis=axis, profile=replace(SLOW_BY_TIMES), **_FIELDS.get(kind.kind, {}))
    if isinstance(kind, type):
        return EStopLevel.Level1 if kind is EStopLevel else 0 if issubclass(kind, IntEnum) else kind()
    return {Plain.DOUBLE: 1.0, Plain.TEXT: "/nowhere/parameters.xml", Plain.AXIS: axis}.get(kind, 1)


_FIELDS: dict[type, dict[str, float]] = {
    Motion_PosCommand: {"target": 1.0},
    Velocity_TimedVelCommand: {"runTimeMilliseconds": 100.0},
}


def _on_axis(owner: str, name: str, call: SurfaceCall) -> AxisCall:
    def run(engine: MotionEngine, axis: int) -> Any:
        arguments = [_argument(kind, axis) for kind in call.takes]
        if call.takes[0] is Plain.INT:
            arguments[0] = axis
        return getattr(part(engine, owner), name)(*arguments)

    return run


def _of_device(owner: str, name: str, call: SurfaceCall) -> Call:
    arguments = [0 if kind is Plain.INT else _argument(kind, 0) for kind in call.takes]
    return lambda engine: getattr(part(engine, owner), name)(*arguments)


_OF_AXES = ("axisControl", "motion", "velocity", "home", "config")
_ROWS = [
    (f"{owner}.{name}", owner, name, call, owner in _OF_AXES and call.takes[:1] not in ((), (Plain.TEXT,)))
    for owner, table in SURFACE.items()
    for name, call in table.items()
    if name not in _ELSEWHERE and name != "StartCSplinePos_PointTime"
]
# Calls that need a running bus, and calls that also work without one.
AXIS_COMMANDS: dict[str, AxisCall] = {
    full: _on_axis(owner, name, call) for full, owner, name, call, axes in _ROWS if axes and call.bus
} | {"advMotion.StartCSplinePos_PointTime": start_of_one_axis}
AXIS_SETTINGS: dict[str, AxisCall] = {
    full: _on_axis(owner, name, call) for full, owner, name, call, axes in _ROWS if axes and not call.bus
}
DEVICE_CALLS: dict[str, Call] = {
    full: _of_device(owner, name, call) for full, owner, name, call, axes in _ROWS if not axes
} | {"read_status": lambda engine: engine.read_status()}
ALL_CALLS: dict[str, Call] = {
    **DEVICE_CALLS,
    **{name: (lambda e, c=call: c(e, 0)) for name, call in {**AXIS_COMMANDS, **AXIS_SETTINGS}.items()},
}


def parametrize(name: str, table: dict[str, Any]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(name, list(table.values()), ids=list(table))


def assert_at_rest(engine: MotionEngine) -> None:
    """Asserts that nothing moves or is about to. In velocity mode the position is measured, which may still settle."""
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
    """Returns a predicate: the axis, turning in its positive direction, decelerates at ``rate``."""
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

    def test_restarted_engine_has_default_parameters_and_outputs(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.core_motion.config.SetGearRatio(POS, 10.0, 1.0) == GOOD
        assert engine.io.SetOutBit(0, 7, 1) == GOOD
        assert engine.api.StopEngine(20000) == GOOD
        assert not engine.api.IsDeviceValid()
        again = harness.communicating()
        assert again.core_motion.config.GetGearRatio(POS)[1] == 131072.0
        assert again.io.GetOutBit(0, 7) == (GOOD, 0)

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

    # -- status --------------------------------------------------------------------------------------------------------

    def test_status_shapes_and_progress(self, harness: Harness) -> None:
        engine = harness.communicating()
        before = status(engine)
        assert before.engine_state == EngineState.Communicating
        assert before.cycle_time_s == pytest.approx(0.001)
        later = some_cycles(engine, 20)
        assert later.cycle_counter > before.cycle_counter
        assert later.engine_time_s == pytest.approx(later.cycle_counter * 0.001)
        assert later.n_axes == N_AXES
        assert later.reals.shape[1] == later.flags.shape[1] == N_AXES

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

    def test_switching_on_does_not_jump(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS_GEARED, 0.7)) == GOOD
        wait_idle(engine, POS_GEARED)
        engine.core_motion.axisControl.SetServoOn(POS_GEARED, 0)
        wait_status(engine, lambda now: not now.servo_on[POS_GEARED], "servo off")
        engine.core_motion.axisControl.SetServoOn(POS_GEARED, 1)
        snapshot = wait_status(engine, lambda now: now.servo_on[POS_GEARED], "servo on")
        assert snapshot.pos_cmd[POS_GEARED] == pytest.approx(snapshot.actual_pos[POS_GEARED], abs=1e-6)
        assert_at_rest(engine)

    def test_home_offset_of_an_absolute_axis(self, harness: Harness) -> None:
        # With polarity -1 and home offset 0.5, the user position is the mirrored encoder position minus 0.5.
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
            "Stop": lambda e: e.core_motion.motion.Stop(VEL),
            "ExecQuickStop": lambda e: e.core_motion.motion.ExecQuickStop(VEL),
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
                Velocity_TimedVelCommand(POS, 100.0, replace(SLOW_BY_TIMES))
            ),
            "Stop": lambda e: e.core_motion.velocity.Stop(POS),
            "ExecQuickStop": lambda e: e.core_motion.velocity.ExecQuickStop(POS),
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
        wait_idle(engine, POS)
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
        assert_at_rest(engine)

    @pytest.mark.parametrize(
        ("changes", "code"),
        [
            *[({"velocity": v}, CoreMotionErrorCode.VelocityArgumentOutOfRange) for v in (NAN, INF, -INF, 1e12)],
            *[({"accTimeMilliseconds": v}, CoreMotionErrorCode.TimeArgumentOutOfRange) for v in (NAN, INF, -1.0)],
            ({"endVelocity": NAN}, CoreMotionErrorCode.EndVelocityArgumentOutOfRange),
            ({"type": ProfileType.Sin}, CoreMotionErrorCode.ProfileTypeNotSupported),
        ],
        ids=str,
    )
    def test_profile_of_a_timed_motion(self, harness: Harness, changes: dict[str, float], code: int) -> None:
        engine = harness.ready()
        profile = replace(SLOW_BY_TIMES, **changes)
        assert engine.core_motion.velocity.StartVel_TimedVel(Velocity_TimedVelCommand(VEL, 100.0, profile)) == code
        assert_at_rest(engine)

    def test_timed_motions_take_profiles_by_times_only(self, harness: Harness) -> None:
        engine = harness.ready()
        code = CoreMotionErrorCode.ProfileTypeNotSupported
        timed_vel = Velocity_TimedVelCommand(VEL, 100.0, replace(FAST))
        assert engine.core_motion.velocity.StartVel_TimedVel(timed_vel) == code
        assert engine.core_motion.velocity.StartVel_TimedVel(1, [timed_vel]) == code
        assert_at_rest(engine)

    @pytest.mark.parametrize("time", [NAN, INF, -INF, 0.0, -1.0, 1e12])
    def test_run_time(self, harness: Harness, time: float) -> None:
        engine = harness.ready()
        code = CoreMotionErrorCode.RunTimeArgumentOutOfRange
        profile = Profile.SetupTimeAccTrapezoidal(5.0, 10.0, 10.0)
        timed_vel = Velocity_TimedVelCommand(VEL, time, profile)
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
        wait_idle(engine, axis)
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
        wait_idle(engine, POS, POS_MIRRORED)
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
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[POS] == 10.0

    def test_target_where_the_axis_is(self, harness: Harness) -> None:
        engine = harness.ready()
        here = status(engine).pos_cmd[POS]
        assert engine.core_motion.motion.StartPos(pos(POS, here)) == GOOD
        wait_idle(engine, POS)
        assert status(engine).motion_complete[POS]

    def test_start_mov_from_rest_is_relative_to_the_command(self, harness: Harness) -> None:
        engine = harness.ready()
        for expected in (0.5, 1.0):
            assert engine.core_motion.motion.StartMov(pos(POS, 0.5)) == GOOD
            wait_idle(engine, POS)
            assert status(engine).pos_cmd[POS] == pytest.approx(expected)

    def test_start_mov_in_motion_is_relative_to_the_running_target(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS, 2.0)) == GOOD
        assert engine.core_motion.motion.StartMov(pos(POS, 0.5)) == GOOD
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[POS] == pytest.approx(2.5)

    def test_position_override_continues_from_present_velocity(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartPos(pos(POS, LONG_WAY)) == GOOD
        wait_status(engine, cruising(POS, 20.0), "cruising")
        before = status(engine)
        assert motion.StartPos(pos(POS, before.pos_cmd[POS] + 20.0)) == GOOD
        after = status(engine)
        assert after.velocity_cmd[POS] == pytest.approx(20.0, abs=1e-6)
        assert after.op_state[POS] == OperationState.Pos
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[POS] == before.pos_cmd[POS] + 20.0

    def test_override_to_a_target_behind_comes_back(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartPos(pos(POS, LONG_WAY)) == GOOD
        wait_status(engine, cruising(POS, 20.0), "cruising")
        assert motion.StartPos(pos(POS, 0.0)) == GOOD
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[POS] == 0.0

    @pytest.mark.parametrize("kind", list(Config_ProhibitOvertravelType))
    def test_override_that_cannot_stop_in_time(self, harness: Harness, kind: int) -> None:
        # 4 rad/s at 4 rad/s2 needs 2 rad; the new target is 1 rad away.
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetMotionParam(POS)
        param.prohibitOvertravel = kind
        assert config.SetMotionParam(POS, param)[0] == GOOD
        assert motion.StartPos(pos(POS, LONG_WAY, Profile.SetupTrapezoidal(4.0, 100.0, 100.0))) == GOOD
        wait_status(engine, cruising(POS, 4.0), "cruising")
        target = status(engine).pos_cmd[POS] + 1.0
        assert motion.StartPos(pos(POS, target, Profile.SetupTrapezoidal(4.0, 100.0, 4.0))) == GOOD
        furthest = -INF
        while True:
            snapshot = status(engine)
            furthest = max(furthest, snapshot.pos_cmd[POS])
            if snapshot.op_state[POS] == OperationState.Idle:
                break
        assert snapshot.pos_cmd[POS] == target
        if kind == Config_ProhibitOvertravelType.Disabled:
            assert furthest > target + 0.25
        else:
            assert furthest <= target + 1e-9

    def test_position_motion_runs_until_stopped(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        assert motion.StartPos(along(POS, -3.0)) == GOOD
        wait_status(engine, cruising(POS, -3.0), "running")
        before = status(engine)
        after = some_cycles(engine, 100)
        cycles = after.cycle_counter - before.cycle_counter
        assert after.pos_cmd[POS] - before.pos_cmd[POS] == pytest.approx(-0.003 * cycles, rel=1e-6)
        assert after.op_state[POS] == OperationState.Pos
        assert motion.Stop(POS) == GOOD
        wait_idle(engine, POS)
        assert not status(engine).motion_complete[POS], "it has not arrived"

    def test_timed_motion_ends_by_itself(self, harness: Harness) -> None:
        engine = harness.ready()
        profile = Profile.SetupTimeAccTrapezoidal(5.0, 10.0, 10.0)
        assert engine.core_motion.velocity.StartVel_TimedVel(Velocity_TimedVelCommand(VEL, 1000.0, profile)) == GOOD
        wait_status(engine, cruising(VEL, 5.0), "cruising")
        last = wait_status(engine, in_state(VEL, OperationState.Idle), "the end")
        assert last.velocity_cmd[VEL] == 0.0
        assert not last.motion_complete[VEL]

    def test_new_command_replaces_the_end_of_a_timed_one(self, harness: Harness) -> None:
        engine = harness.ready()
        velocity = engine.core_motion.velocity
        assert velocity.StartVel_TimedVel(Velocity_TimedVelCommand(VEL, 1000.0, replace(SLOW_BY_TIMES))) == GOOD
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
            assert engine.core_motion.motion.StartPos(Motion_PosCommand(POS, LONG_WAY, profile)) == GOOD
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
        assert_at_rest(engine)

    @pytest.mark.parametrize("name", ["Stop_AxisSel", "ExecQuickStop_AxisSel"])
    def test_stop_of_several_axes_stops_possible_axes_and_returns_error(self, harness: Harness, name: str) -> None:
        """An error does not mean that nothing stops: only one of the axes is not in the mode of the call."""
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(along(POS, 5.0)) == GOOD
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        wait_status(engine, lambda now: cruising(POS, 5.0)(now) and cruising(VEL, 5.0)(now), "both")
        both = AxisSelection.of(POS, VEL)
        assert getattr(engine.core_motion.motion, name)(both) == CoreMotionErrorCode.NotPosMode
        wait_status(engine, in_state(POS, OperationState.Idle), "the one at rest")
        assert status(engine).op_state[VEL] == OperationState.Velocity

    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_quick_stop_overrides_stop_and_not_the_reverse(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        set_quick_stop(engine, axis, 20.0)
        family = engine.core_motion.motion if axis == POS else engine.core_motion.velocity
        profile = Profile.SetupTrapezoidal(40.0, 2000.0, 4.0)
        if axis == POS:
            assert engine.core_motion.motion.StartPos(Motion_PosCommand(POS, LONG_WAY, profile)) == GOOD
        else:
            assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, profile)) == GOOD
        wait_status(engine, cruising(axis, 40.0), "cruising")
        assert family.Stop(axis) == GOOD
        wait_status(engine, braking(axis, 4.0), "a soft stop")
        assert family.ExecQuickStop(axis) == GOOD
        wait_status(engine, braking(axis, 20.0), "a quick stop")
        assert family.Stop(axis) == GOOD
        snapshot = status(engine)
        assert snapshot.flags[Flag.DETAIL_OP_STATE, axis] == DetailOperationState.Stop_QStop
        assert braking(axis, 20.0)(snapshot)
        wait_status(engine, in_state(axis, OperationState.Idle), "rest")

    def test_start_while_stopping_is_refused(self, harness: Harness) -> None:
        engine = harness.ready()
        motion, velocity = engine.core_motion.motion, engine.core_motion.velocity
        assert motion.StartPos(along(POS, 10.0, dec=1.0)) == GOOD
        assert velocity.StartVel(vel(VEL, 10.0, dec=1.0)) == GOOD
        wait_status(engine, lambda now: cruising(POS, 10.0)(now) and cruising(VEL, 10.0)(now), "cruising")
        assert motion.Stop(POS) == GOOD
        assert velocity.Stop(VEL) == GOOD
        assert motion.StartPos(pos(POS, 1.0)) == CoreMotionErrorCode.NotIdleOrPosState
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
        wait_idle(engine, POS)
        there = wait_status(engine, lambda now: now.flags[Flag.POS_SET, POS], "the feedback within its width")
        assert there.in_pos[POS]
        assert there.flags[Flag.CMD_DISTRIBUTION_END, POS]
        assert there.reals[Real.PROFILE_REMAINING_MS, POS] == 0.0

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

    @pytest.mark.parametrize("stop", ["Stop", "ExecQuickStop"])
    @pytest.mark.parametrize("axis", [POS, VEL])
    def test_estop_wins_over_a_stop(self, harness: Harness, axis: int, stop: str) -> None:
        engine = harness.ready()
        set_quick_stop(engine, axis, 4.0)  # softer than the emergency stop
        set_estop(engine, 20.0)
        family = engine.core_motion.motion if axis == POS else engine.core_motion.velocity
        profile = Profile.SetupTrapezoidal(40.0, 2000.0, 4.0)
        if axis == POS:
            assert engine.core_motion.motion.StartPos(Motion_PosCommand(POS, LONG_WAY, profile)) == GOOD
        else:
            assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, profile)) == GOOD
        wait_status(engine, cruising(axis, 40.0), "cruising")
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

    def test_release_during_emergency_stop_ramp_completes_stop(self, harness: Harness) -> None:
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

    def test_servos_switch_off_after_emergency_stop_ramp_if_configured(self, harness: Harness) -> None:
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
        wait_idle(engine, axis)
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
        wait_idle(engine, POS)
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert motion.StartPos(pos(POS, 0.5)) == GOOD
        wait_idle(engine, POS)
        snapshot = status(engine)
        assert snapshot.pos_cmd[POS] == 0.5
        moved = snapshot.flags[Flag.ENCODER_COMMAND, POS] - start
        assert moved == pytest.approx(2.0 * 131072 / (2 * math.pi), abs=2)

    def test_homing_with_the_servo_off(self, harness: Harness) -> None:
        assert harness.communicating().core_motion.home.StartHome(POS) == CoreMotionErrorCode.NotServoOn

    def test_homing_in_motion(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(along(POS, 1.0)) == GOOD
        assert engine.core_motion.home.StartHome(POS) == ErrorCode.NotIdleState
        assert not status(engine).home_done[POS]

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

    def test_renaming_a_position(self, harness: Harness) -> None:
        engine = harness.ready()
        counts = status(engine).flags[Flag.ENCODER_COMMAND, POS]
        assert engine.core_motion.home.SetCommandPos(POS, 12.5) == GOOD
        assert status(engine).pos_cmd[POS] == pytest.approx(12.5, abs=1e-3)
        assert_at_rest(engine)
        assert status(engine).flags[Flag.ENCODER_COMMAND, POS] == pytest.approx(counts, abs=1)

    @pytest.mark.parametrize("position", [NAN, INF, -INF, 1e15])
    def test_renaming_to_nonsense(self, harness: Harness, position: float) -> None:
        engine = harness.ready()
        before = status(engine).pos_cmd[POS]
        rename = engine.core_motion.home.SetCommandPos
        assert rename(POS, position) == CoreMotionErrorCode.PositionArgumentOutOfRange
        assert status(engine).pos_cmd[POS] == before

    def test_renaming_in_motion(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(along(POS, 1.0)) == GOOD
        assert engine.core_motion.home.SetCommandPos(POS, 5.0) == ErrorCode.NotIdleState

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
        assert engine.core_motion.home.SetCommandPos(POS, 0.0) == GOOD  # in the new unit the position may be far away
        assert motion.StartPos(pos(POS, 3.0)) == GOOD
        wait_idle(engine, POS)
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
        assert engine.core_motion.motion.StartPos(along(POS, 1.0)) == GOOD
        assert engine.core_motion.config.SetGearRatio(POS, 10.0, 1.0) == ErrorCode.NotIdleState
        assert engine.core_motion.config.SetAxisPolarity(POS, -1) == ErrorCode.NotIdleState

    def test_polarity_mirrors_positions_and_moves_nothing(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        assert motion.StartPos(pos(POS, 1.0)) == GOOD
        wait_idle(engine, POS)
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

    def test_parameters_of_all_axes_at_once(self, harness: Harness) -> None:
        config = harness.connect().core_motion.config
        assert config.GetMotionParam(POS)[1].quickStopDec == QUICK_STOP_DEC
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
        before = config.GetFeedbackParam(0), config.GetLimitParam(N_AXES - 1), config.GetAxisParam()
        text = path.read_text(encoding="utf-8")
        # Axis 0 gets a good value and the last axis a bad one.
        head, mark, rest = text.partition(f'<AxisParameters Axis="{N_AXES - 1}">')
        head = head.replace("<InPosWidth>0.010000<", "<InPosWidth>0.500000<")
        assert "0.500000" in head
        bad = rest.replace("<LSDec>10000.000000<", "<LSDec>0.000000<", 1)
        path.write_text(head + mark + bad, encoding="utf-8")
        assert config.ImportAndSetAll(str(path)) == CoreMotionErrorCode.ParameterSettingsInvalid
        assert (config.GetFeedbackParam(0), config.GetLimitParam(N_AXES - 1), config.GetAxisParam()) == before

    def test_no_parameter_file_under_a_moving_axis(self, harness: Harness) -> None:
        engine = harness.ready()
        path = str(harness.folder / "parameters.xml")
        assert engine.core_motion.config.GetAndExportAll(path) == GOOD
        assert engine.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW)) == GOOD
        assert engine.core_motion.config.ImportAndSetAll(path) == ErrorCode.NotIdleState

    # -- soft limits ---------------------------------------------------------------------------------------------------

    def test_soft_limit_stops_axis_and_allows_motion_back(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetLimitParam(POS)
        param.softLimitType, param.softLimitPositivePos, param.lsDec = Config_LimitSwitchType.Dec, 1.0, 400.0
        assert config.SetLimitParam(POS, param)[0] == GOOD
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert motion.StartPos(pos(POS, 5.0, SLOW)) == GOOD
        wait_idle(engine, POS)
        snapshot = status(engine)
        assert snapshot.flags[Flag.POSITIVE_SOFT_LIMIT, POS]
        assert 1.0 < snapshot.pos_cmd[POS] < 1.1
        assert not snapshot.motion_complete[POS]
        assert motion.StartPos(pos(POS, 5.0)) == ErrorCode.AxisSoftLimit, "no further"
        assert motion.StartPos(pos(POS, 0.5)) == GOOD, "back is free"
        wait_idle(engine, POS)

    def test_soft_limit_needs_a_homed_axis(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetLimitParam(POS)
        param.softLimitType, param.softLimitPositivePos = Config_LimitSwitchType.Dec, 0.5
        assert config.SetLimitParam(POS, param)[0] == GOOD
        assert motion.StartPos(pos(POS, 1.0)) == GOOD
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[POS] == 1.0

    def test_negative_soft_limit_with_servo_off(self, harness: Harness) -> None:
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetLimitParam(POS)
        param.softLimitType, param.softLimitNegativePos = Config_LimitSwitchType.SlowDecServoOff, -0.5
        param.lsSlowDec = 100.0
        assert config.SetLimitParam(POS, param)[0] == GOOD
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert motion.StartPos(along(POS, -2.0)) == GOOD
        snapshot = wait_status(engine, lambda now: not now.servo_on[POS], "servo off")
        assert snapshot.flags[Flag.NEGATIVE_SOFT_LIMIT, POS]

    # -- I/O and network -----------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("byte", [-1, 4, 8000])
    def test_io_address(self, harness: Harness, byte: int) -> None:
        io = harness.communicating().io
        code = ErrorCode.IOAddressOutOfRange
        assert io.SetOutBit(byte, 0, 1) == code
        assert io.GetOutBit(byte, 0) == (code, 0)

    @pytest.mark.parametrize("bit", [-1, 8])
    def test_io_bit(self, harness: Harness, bit: int) -> None:
        io = harness.communicating().io
        assert io.SetOutBit(0, bit, 1) == ErrorCode.IOAddressOutOfRange
        assert io.GetOutBit(0, bit) == (ErrorCode.IOAddressOutOfRange, 0)

    def test_network(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.ecat.ScanNetwork(0) == GOOD
        assert engine.ecat.ScanNetwork(1) == ErrorCode.ArgumentOutOfRange
        engine.api.StartCommunication(20000)
        assert engine.ecat.ScanNetwork(0) == EcErrorCode.ScanNetworkFailed, "it would disturb a bus that runs"

    def test_output_bits(self, harness: Harness) -> None:
        io = harness.communicating().io
        assert io.SetOutBit(1, 3, 1) == GOOD
        assert io.SetOutBit(1, 0, 1) == GOOD
        assert [io.GetOutBit(1, bit) for bit in range(4)] == [(GOOD, 1), (GOOD, 0), (GOOD, 0), (GOOD, 1)]
        assert io.SetOutBit(1, 3, 0) == GOOD
        assert io.GetOutBit(1, 3) == (GOOD, 0)
        for value in (-1, 2):
            assert io.SetOutBit(0, 0, value) == ErrorCode.ArgumentOutOfRange
        assert io.GetOutBit(0, 0) == (GOOD, 0)

    def test_outputs_need_a_bus(self, harness: Harness) -> None:
        assert harness.connect().io.SetOutBit(0, 0, 1) == ErrorCode.CommNotStarted

    def test_error_texts(self, harness: Harness) -> None:
        engine = harness.connect()
        lock, not_on = ErrorCode.CreateDeviceLockError, CoreMotionErrorCode.NotServoOn
        assert "being created" in engine.api.ErrorToString(lock)
        assert "being created" in engine.core_motion.ErrorToString(lock)
        assert engine.core_motion.ErrorToString(not_on) == "the servo is not on"
        assert engine.api.ErrorToString(not_on) == "error code not defined", "another module's code"
        assert engine.io.ErrorToString(123456789) == "error code not defined"

    # -- several devices -----------------------------------------------------------------------------------------------

    def test_closing_a_device_stops_no_axis(self, harness: Harness) -> None:
        one, two = harness.ready("one"), harness.connect("two")
        assert one.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert two.core_motion.velocity.StartVel(vel(VEL_MIRRORED, 5.0)) == GOOD
        assert one.api.CloseDevice() == GOOD
        assert some_cycles(two, 50).op_state[[VEL, VEL_MIRRORED]].tolist() == [OperationState.Velocity] * 2

    def test_idle_client_keeps_device_and_motion(self, harness: Harness) -> None:
        """The library resets the watchdog while its process runs: the watchdog is no dead-man."""
        one, two = harness.ready("one"), harness.connect("two")
        assert [device.watchdog for device in two.api.GetAllDevices()[1].devices] == [15_000, 15_000]
        assert one.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        some_cycles(two, 2500)
        assert status(two).op_state[VEL] == OperationState.Velocity
        assert all(device.watchdogCount <= 200 for device in two.api.GetAllDevices()[1].devices)

    def test_many_devices(self, harness: Harness) -> None:
        engines = [harness.connect(f"client {index}") for index in range(20)]
        assert engines[0].api.GetAllDevices()[1].count == 20
        assert len({engine.api.GetDeviceID()[1] for engine in engines}) == 20
