"""Requirements for any implementation of the engine port. A test class inherits them and adds the fixture ``harness``.

``CallConformance`` makes every call with good and bad arguments: what an adapter or a transport can get wrong. The
motion of an engine is in motion_conformance.py. The tests use the port alone: commands, codes and status. Expected
codes are the vendor's names. The observer is a separate process and may read late: phases that a test must see last at
least half a second of engine time, and exact cycles are tested in the engine's own tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AxisCommandMode,
    AxisSelection,
    Config_HomeType,
    Config_LimitSwitchType,
    CoreMotionErrorCode,
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
from tests.unit.wmx.spline_conformance import SplineCallConformance, start_of_one_axis

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


# Calls that start motion, on axes in the matching mode, at 2 rad/s.
STARTS: dict[str, Call] = {
    "StartPos": lambda e: e.core_motion.motion.StartPos(pos(POS, LONG_WAY, SLOW)),
    "StartPos_n": lambda e: e.core_motion.motion.StartPos(
        2, [pos(POS, LONG_WAY, SLOW), pos(POS_MIRRORED, -LONG_WAY, SLOW)]
    ),
    "StartMov": lambda e: e.core_motion.motion.StartMov(pos(POS, LONG_WAY, SLOW)),
    "StartVel": lambda e: e.core_motion.velocity.StartVel(vel(VEL, 2.0)),
    "StartVel_n": lambda e: e.core_motion.velocity.StartVel(2, [vel(VEL, 2.0), vel(VEL_MIRRORED, -2.0)]),
    "StartVel_TimedVel": lambda e: e.core_motion.velocity.StartVel_TimedVel(
        Velocity_TimedVelCommand(VEL, 60000.0, replace(SLOW_BY_TIMES))
    ),
}

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


def cruise(engine: MotionEngine, axis: int, profile: Profile) -> Any:
    """Waits for an axis to run at the velocity of the profile; returns the calls of the axis's mode."""
    core = engine.core_motion
    if axis in POSITION_AXES:
        assert core.motion.StartPos(Motion_PosCommand(axis, LONG_WAY, profile)) == GOOD
    else:
        assert core.velocity.StartVel(Velocity_VelCommand(axis, profile)) == GOOD
    wait_status(engine, cruising(axis, profile.velocity), "cruising")
    return core.motion if axis in POSITION_AXES else core.velocity


def refused(call: Callable[[Any], int], cases: list[tuple[Any, int]]) -> None:
    """Asserts the code of the call for each argument."""
    assert [(argument, call(argument)) for argument, _ in cases] == cases


def answers(engine: MotionEngine, calls: dict[str, Call]) -> dict[str, int]:
    return {name: code_of(call(engine)) for name, call in calls.items()}


def on_axis(calls: dict[str, AxisCall], axis: int) -> dict[str, Call]:
    return {name: (lambda engine, call=call: call(engine, axis)) for name, call in calls.items()}


_BAD = CoreMotionErrorCode
_BAD_PROFILES: list[tuple[dict[str, float], int]] = [
    *[({"velocity": v}, _BAD.VelocityArgumentOutOfRange) for v in (NAN, INF, -INF, 0.0, -1.0, 1e-7, 1e12)],
    *[({"acc": v}, _BAD.AccArgumentOutOfRange) for v in (NAN, INF, -INF, 0.0, -1.0, 1e-7, 1e12)],
    *[({"dec": v}, _BAD.DecArgumentOutOfRange) for v in (NAN, INF, -INF, 0.0, -1.0, 1e-7, 1e12)],
    *[({"startingVelocity": v}, _BAD.StartingVelocityArgumentOutOfRange) for v in (NAN, INF, 1.0)],
    *[({"endVelocity": v}, _BAD.EndVelocityArgumentOutOfRange) for v in (NAN, INF, 1.0)],
    *[({"type": v}, _BAD.ProfileTypeNotSupported) for v in (ProfileType.SCurve, -1, 99)],
]
_BAD_PROFILE_TIMES: list[tuple[dict[str, float], int]] = [
    ({field: v}, _BAD.TimeArgumentOutOfRange)
    for field in ("accTimeMilliseconds", "decTimeMilliseconds")
    for v in (NAN, INF, -1.0)
]
_BAD_VEL_PROFILES: list[tuple[dict[str, float], int]] = [
    *[({"velocity": v}, _BAD.VelocityArgumentOutOfRange) for v in (NAN, INF, -INF, 1e12)],
    *[({"acc": v}, _BAD.AccArgumentOutOfRange) for v in (NAN, INF, -1.0, 1e-9)],
    *[({"dec": v}, _BAD.DecArgumentOutOfRange) for v in (NAN, INF, -1.0, 1e-9)],
    ({"startingVelocity": NAN}, _BAD.StartingVelocityArgumentOutOfRange),
    ({"endVelocity": NAN}, _BAD.EndVelocityArgumentOutOfRange),
    ({"type": ProfileType.Sin}, _BAD.ProfileTypeNotSupported),
]
_BAD_TIMED_PROFILES: list[tuple[dict[str, float], int]] = [
    *[({"velocity": v}, _BAD.VelocityArgumentOutOfRange) for v in (NAN, INF, -INF, 1e12)],
    *_BAD_PROFILE_TIMES[:3],
    ({"endVelocity": NAN}, _BAD.EndVelocityArgumentOutOfRange),
    ({"type": ProfileType.Sin}, _BAD.ProfileTypeNotSupported),
    ({"type": ProfileType.Trapezoidal}, _BAD.ProfileTypeNotSupported),
]
_BLOCKS: dict[str, dict[str, Any]] = {
    "FeedbackParam": {"inPosWidth": 0.5, "posSetWidth": 0.25, "delayedPosSetMilliseconds": 10.0},
    "HomeParam": {"homePosition": 1.5, "clearHomeDoneOnServoOff": True},
    "LimitParam": {"softLimitType": Config_LimitSwitchType.Dec, "softLimitPositivePos": 3.0, "lsDec": 50.0},
    "MotionParam": {"quickStopDec": 123.0},
    "AlarmParam": {"followingErrorMoving": 0.5, "velocityFollowingErrorMoving": 2.0},
}
_BAD_BLOCKS: list[tuple[str, dict[str, Any]]] = [
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
]
_BAD_ESTOP_BLOCKS: list[dict[str, Any]] = [
    {"eStopDec": []},
    {"eStopDec": [0.0] * N_AXES},
    {"eStopDec": [NAN] * N_AXES},
    {"eStopSignalLevel": 7},
    {"eStopSignalByteAddress": 4},
    {"eStopSignalBitAddress": 8},
    {"eStopSignalSource": 1},
    {"eStopLevel1Type": 2},
]


class CallConformance(SplineCallConformance):
    """Every call with its codes and effects. Needs: a fixture ``harness`` (Harness) with an idle engine."""

    # -- devices and engine --------------------------------------------------------------------------------------------

    def test_devices_start_and_end_the_engine(self, harness: Harness) -> None:
        assert engine_state(harness.folder) is EngineState.Idle
        one = harness.connect("one")
        assert one.api.IsDeviceValid()
        assert one.api.GetEngineStatus()[1].state == EngineState.Running
        two = harness.communicating("two")
        assert one.api.CloseDevice() == GOOD
        assert two.api.GetEngineStatus()[1].state == EngineState.Communicating
        assert two.api.GetAllDevices()[1].count == 1
        assert two.api.CloseDevice() == GOOD
        wait_for(lambda: engine_state(harness.folder) is EngineState.Idle, "the engine to end")

    def test_every_call_on_a_closed_device(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.api.CloseDevice() == GOOD
        assert not engine.api.IsDeviceValid()
        assert answers(engine, ALL_CALLS) == dict.fromkeys(ALL_CALLS, ErrorCode.DeviceIsNull)

    def test_every_call_after_another_device_stopped_the_engine(self, harness: Harness) -> None:
        engine, other = harness.connect("one"), harness.connect("other")
        assert other.api.StopEngine(20000) == GOOD
        assert answers(engine, ALL_CALLS) == dict.fromkeys(ALL_CALLS, ErrorCode.DeviceIsNull)
        assert not engine.api.IsDeviceValid()

    @pytest.mark.parametrize("name", ["StartCommunication", "SetDeviceName", "GetAllDevices", "read_status"])
    def test_first_call_after_another_device_stopped_the_engine(self, harness: Harness, name: str) -> None:
        engine, other = harness.connect("one"), harness.connect("other")
        assert other.api.StopEngine(20000) == GOOD
        call = ALL_CALLS.get(f"WMX3Api.{name}") or ALL_CALLS[name]
        assert code_of(call(engine)) == ErrorCode.DeviceIsNull

    def test_create_device(self, harness: Harness) -> None:
        engine = harness.connect()
        create = engine.api.CreateDevice
        assert create(str(harness.folder), 0, 0) == ErrorCode.ResourceInUse
        assert engine.api.IsDeviceValid(), "refused and harmless"
        engine.api.CloseDevice()
        for device_type in (-1, 4, 1000):
            assert create(str(harness.folder), device_type, 0) == ErrorCode.ArgumentOutOfRange
        assert create(str(harness.folder / "nowhere"), 0, 0) == ErrorCode.IMLibIsNotRunning
        assert create(str(harness.folder), 0, 20000) == GOOD
        assert engine.api.IsDeviceValid()

    def test_names_and_ids(self, harness: Harness) -> None:
        one, two = harness.connect("one"), harness.connect("two")
        assert one.api.GetDeviceName() == (GOOD, "one")
        assert one.api.SetDeviceName("uno") == GOOD
        assert one.api.SetDeviceName("n" * 64) == ErrorCode.ArgumentOutOfRange
        (_, first), (_, second) = one.api.GetDeviceID(), two.api.GetDeviceID()
        assert first != second
        code, devices = one.api.GetAllDevices()
        assert code == GOOD
        assert devices.count == 2
        assert {(device.id, device.name) for device in devices.devices} == {(first, "uno"), (second, "two")}

    def test_many_devices(self, harness: Harness) -> None:
        engines = [harness.connect(f"client {index}") for index in range(20)]
        assert engines[0].api.GetAllDevices()[1].count == 20
        assert len({engine.api.GetDeviceID()[1] for engine in engines}) == 20

    def test_restarted_engine_has_default_parameters_and_outputs(self, harness: Harness) -> None:
        engine = harness.communicating()
        assert engine.core_motion.config.SetGearRatio(POS, 10.0, 1.0) == GOOD
        assert engine.io.SetOutBit(0, 7, 1) == GOOD
        assert engine.api.StopEngine(20000) == GOOD
        assert not engine.api.IsDeviceValid()
        again = harness.communicating()
        assert again.core_motion.config.GetGearRatio(POS)[1] == 131072.0
        assert again.io.GetOutBit(0, 7) == (GOOD, 0)

    # -- communication and status --------------------------------------------------------------------------------------

    def test_start_communication(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.api.StartCommunication(20000) == GOOD
        assert engine.api.GetEngineStatus()[1].state == EngineState.Communicating, "it is waited for"
        assert engine.api.StartCommunication(20000) == GOOD
        before = status(engine)
        assert before.communicating
        assert not before.servo_on.any()
        assert not before.servo_requested.any()
        assert before.home_done.tolist() == [axis == POS_MIRRORED for axis in range(N_AXES)], "the absolute encoder"
        assert (before.command_mode == np.isin(range(N_AXES), VELOCITY_AXES)).all(), "modes as configured"
        # With polarity -1 and home offset 0.5, the user position is the mirrored encoder position minus 0.5.
        encoder = before.flags[Flag.ENCODER_FEEDBACK, POS_MIRRORED] * 2.0 * math.pi / 131072
        assert before.actual_pos[POS_MIRRORED] == pytest.approx(-encoder - 0.5)
        assert before.cycle_time_s == pytest.approx(0.001)
        later = some_cycles(engine, 20)
        assert later.engine_time_s == pytest.approx(later.cycle_counter * 0.001)
        assert later.n_axes == later.reals.shape[1] == later.flags.shape[1] == N_AXES

    def test_start_communication_without_waiting(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.api.StartCommunication(0) == GOOD
        wait_status(engine, lambda now: now.communicating, "communication")

    def test_before_communication(self, harness: Harness) -> None:
        engine = harness.connect()
        commands = on_axis(AXIS_COMMANDS, POS) | STARTS
        assert answers(engine, commands) == dict.fromkeys(commands, ErrorCode.CommNotStarted)
        assert engine.io.SetOutBit(0, 0, 1) == ErrorCode.CommNotStarted
        assert answers(engine, on_axis(AXIS_SETTINGS, POS)) == dict.fromkeys(AXIS_SETTINGS, GOOD)
        assert engine.api.StartCommunication(20000) == GOOD
        assert_at_rest(engine)
        assert not status(engine).servo_on.any()

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
        assert engine.api.StopCommunication() == GOOD, "there is nothing to stop"
        assert engine.api.StartCommunication(20000) == GOOD
        assert_at_rest(engine)
        assert not status(engine).servo_on.any()

    # -- arguments -----------------------------------------------------------------------------------------------------

    def test_axis_out_of_range(self, harness: Harness) -> None:
        engine = harness.ready()
        calls = {**AXIS_COMMANDS, **AXIS_SETTINGS}
        for axis in (-1, N_AXES, 128, 10**9):
            assert answers(engine, on_axis(calls, axis)) == dict.fromkeys(calls, ErrorCode.AxisOutOfRange)
        assert_at_rest(engine)
        assert status(engine).servo_on.all()

    def test_counts_and_selections(self, harness: Harness) -> None:
        engine = harness.ready()
        motion, velocity = engine.core_motion.motion, engine.core_motion.velocity
        commands = [pos(POS, LONG_WAY, SLOW), pos(POS_MIRRORED, LONG_WAY, SLOW)]
        assert motion.Stop_AxisSel(AxisSelection()) == ErrorCode.AxisCountOutOfRange
        assert motion.Stop_AxisSel(AxisSelection.of(POS, POS)) == ErrorCode.DuplicateAxis
        assert motion.StartPos(0, []) == ErrorCode.AxisCountOutOfRange
        assert motion.StartPos(2, [pos(POS, 1.0), pos(POS, 2.0)]) == ErrorCode.DuplicateAxis
        assert motion.StartPos(2, [pos(POS, 1.0), pos(VEL, 1.0)]) == CoreMotionErrorCode.NotPosMode
        assert motion.StartPos(2, [pos(POS, 1.0), pos(N_AXES, 1.0)]) == ErrorCode.AxisOutOfRange
        for count in (-1, 3):
            assert motion.StartPos(count, commands) == ErrorCode.ArgumentOutOfRange
            assert velocity.StartVel(count, [vel(VEL, 1.0)] * 2) == ErrorCode.ArgumentOutOfRange
        assert_at_rest(engine)
        assert motion.StartPos(1, commands) == GOOD, "a count below the list starts the first"
        assert status(engine).op_state[[POS, POS_MIRRORED]].tolist() == [OperationState.Pos, OperationState.Idle]

    def test_bad_position_commands(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        by_times = Profile.SetupTimeAccTrapezoidal(5.0, 10.0, 10.0)
        cases = [(pos(POS, 1.0, replace(FAST, **changes)), code) for changes, code in _BAD_PROFILES]
        cases += [(pos(POS, 1.0, replace(by_times, **changes)), code) for changes, code in _BAD_PROFILE_TIMES]
        cases += [(pos(POS, way), _BAD.PositionArgumentOutOfRange) for way in (NAN, INF, -INF, 1e15, -1e300)]
        for start in (motion.StartPos, motion.StartMov):
            refused(start, cases)
            refused(lambda command: start(2, [pos(POS_MIRRORED, 1.0), command]), cases)  # noqa: B023
        assert_at_rest(engine)

    def test_bad_velocity_commands(self, harness: Harness) -> None:
        engine = harness.ready()
        velocity = engine.core_motion.velocity
        by_times = Profile.SetupTimeAccTrapezoidal(5.0, 10.0, 10.0)
        cases = [(Velocity_VelCommand(VEL, replace(FAST, **changes)), code) for changes, code in _BAD_VEL_PROFILES]
        cases += [
            (Velocity_VelCommand(VEL, replace(by_times, **changes)), code) for changes, code in _BAD_PROFILE_TIMES
        ]
        refused(velocity.StartVel, cases)
        refused(lambda command: velocity.StartVel(2, [vel(VEL_MIRRORED, 1.0), command]), cases)
        timed = [
            (Velocity_TimedVelCommand(VEL, 100.0, replace(SLOW_BY_TIMES, **changes)), code)
            for changes, code in _BAD_TIMED_PROFILES
        ]
        timed += [
            (Velocity_TimedVelCommand(VEL, time, by_times), _BAD.RunTimeArgumentOutOfRange)
            for time in (NAN, INF, -INF, 0.0, -1.0, 1e12)
        ]
        refused(velocity.StartVel_TimedVel, timed)
        refused(lambda command: velocity.StartVel_TimedVel(1, [command]), timed)
        assert_at_rest(engine)

    def test_calls_in_the_wrong_mode(self, harness: Harness) -> None:
        engine = harness.ready()
        motion, velocity = engine.core_motion.motion, engine.core_motion.velocity
        by_time = Velocity_TimedVelCommand(POS, 100.0, replace(SLOW_BY_TIMES))
        of_position = [motion.StartPos(pos(VEL, 1.0)), motion.StartMov(pos(VEL, 1.0))]
        of_position += [motion.Stop(VEL), motion.ExecQuickStop(VEL)]
        assert set(of_position) == {CoreMotionErrorCode.NotPosMode}
        of_velocity = [velocity.StartVel(vel(POS, 1.0)), velocity.StartVel_TimedVel(by_time)]
        of_velocity += [velocity.Stop(POS), velocity.ExecQuickStop(POS)]
        assert set(of_velocity) == {CoreMotionErrorCode.NotVelocityMode}
        assert_at_rest(engine)

    # -- servos, modes and motion --------------------------------------------------------------------------------------

    def test_servo_on_and_off(self, harness: Harness) -> None:
        engine = harness.communicating()
        control = engine.core_motion.axisControl
        for value in (-1, 2, 10**12):
            assert control.SetServoOn(POS, value) == ErrorCode.ArgumentOutOfRange
        assert not some_cycles(engine, 20).servo_on.any()
        assert answers(engine, STARTS) == dict.fromkeys(STARTS, CoreMotionErrorCode.NotServoOn)
        assert engine.core_motion.home.StartHome(POS) == CoreMotionErrorCode.NotServoOn
        assert_at_rest(engine)
        assert control.SetServoOn(POS, 1) == GOOD
        snapshot = wait_status(engine, lambda now: now.servo_on[POS], "servo on")
        assert snapshot.servo_on.tolist() == [axis == POS for axis in range(N_AXES)]
        assert control.SetServoOn(POS, 0) == GOOD
        wait_status(engine, lambda now: not now.servo_on[POS], "servo off")

    def test_unknown_mode(self, harness: Harness) -> None:
        control = harness.communicating().core_motion.axisControl
        unsupported = CoreMotionErrorCode.CurrentAxisCommandModeNotSupported
        assert control.SetAxisCommandMode(POS, AxisCommandMode.Torque) == unsupported
        for mode in (-1, 3):
            assert control.SetAxisCommandMode(POS, mode) == CoreMotionErrorCode.AxisCommandModeOutOfRange
        assert control.GetAxisCommandMode(POS) == (GOOD, AxisCommandMode.Position)

    def test_mode_change_at_rest_does_not_move(self, harness: Harness) -> None:
        engine = harness.ready()
        control = engine.core_motion.axisControl
        assert engine.core_motion.motion.StartPos(pos(POS, 0.5)) == GOOD
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

    def test_changes_in_motion_are_refused(self, harness: Harness) -> None:
        engine = harness.ready()
        core, path = engine.core_motion, str(harness.folder / "parameters.xml")
        assert core.config.GetAndExportAll(path) == GOOD
        timed = Velocity_TimedVelCommand(VEL_MIRRORED, 60000.0, replace(SLOW_BY_TIMES))
        assert core.motion.StartPos(along(POS, 1.0)) == GOOD
        assert core.velocity.StartVel(vel(VEL, 2.0)) == core.velocity.StartVel_TimedVel(timed) == GOOD
        before = status(engine).command_mode[[POS, VEL, VEL_MIRRORED]].tolist()
        changes = [
            core.axisControl.SetAxisCommandMode(POS, AxisCommandMode.Velocity),
            core.axisControl.SetAxisCommandMode(VEL, AxisCommandMode.Position),
            core.axisControl.SetAxisCommandMode(VEL_MIRRORED, AxisCommandMode.Position),
            core.home.StartHome(POS),
            core.home.SetCommandPos(POS, 5.0),
            core.config.SetGearRatio(POS, 10.0, 1.0),
            core.config.SetAxisPolarity(POS, -1),
            core.config.ImportAndSetAll(path),
        ]
        assert changes == [ErrorCode.NotIdleState] * len(changes)
        after = status(engine)
        assert after.command_mode[[POS, VEL, VEL_MIRRORED]].tolist() == before
        assert not after.home_done[POS]
        assert after.op_state[POS] == OperationState.Pos

    def test_start_pos_arrives_exactly(self, harness: Harness) -> None:
        engine = harness.ready()
        axes, targets = list(POSITION_AXES), [1.25, -0.75, 0.5]
        before = status(engine).flags[Flag.ENCODER_COMMAND]
        commands = [pos(axis, target) for axis, target in zip(axes, targets, strict=True)]
        assert engine.core_motion.motion.StartPos(3, commands) == GOOD
        moving = status(engine)
        assert (moving.op_state[axes] == OperationState.Pos).all(), "visible as soon as the call returns"
        assert not moving.motion_complete[axes].any()
        wait_idle(engine, *axes)
        snapshot = status(engine)
        assert snapshot.pos_cmd[axes].tolist() == targets
        assert not snapshot.velocity_cmd[axes].any()
        assert snapshot.motion_complete[axes].all()
        counts = snapshot.flags[Flag.ENCODER_COMMAND] - before
        assert counts[POS] == pytest.approx(1.25 * 131072 / (2 * math.pi), abs=1)
        assert counts[POS_MIRRORED] == pytest.approx(0.75 * 131072 / (2 * math.pi), abs=1), (
            "its drive turns the other way"
        )
        wait_status(engine, lambda now: np.abs(now.actual_pos[axes] - targets).max() < 1e-3, "the feedback to settle")

    def test_start_mov_is_relative(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        for expected in (0.5, 1.0):
            assert motion.StartMov(pos(POS, 0.5)) == GOOD
            wait_idle(engine, POS)
            assert status(engine).pos_cmd[POS] == pytest.approx(expected)
        assert motion.StartPos(pos(POS, 2.0)) == GOOD
        assert motion.StartMov(pos(POS, 0.5)) == GOOD
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[POS] == pytest.approx(2.5), "in motion: relative to the running target"

    @pytest.mark.parametrize("speed", [4.0, -4.0])
    def test_start_vel_runs_for_ever(self, harness: Harness, speed: float) -> None:
        engine, axes = harness.ready(), list(VELOCITY_AXES)
        assert engine.core_motion.velocity.StartVel(2, [vel(VEL, speed), vel(VEL_MIRRORED, -speed)]) == GOOD
        speeds = np.array([speed, -speed])
        wait_status(engine, lambda now: np.abs(now.actual_velocity[axes] - speeds).max() < 0.01, "drives at speed")
        before = status(engine)
        after = some_cycles(engine, 100)
        assert (after.op_state[axes] == OperationState.Velocity).all()
        cycles = after.cycle_counter - before.cycle_counter
        assert after.actual_pos[axes] - before.actual_pos[axes] == pytest.approx(speeds * 1e-3 * cycles, rel=0.02)
        assert (after.pos_cmd[axes] == after.actual_pos[axes]).all(), "the command follows in velocity mode"
        assert not after.motion_complete[axes].any()
        assert not after.in_pos[axes].any()

    def test_stops_on_an_idle_axis(self, harness: Harness) -> None:
        engine = harness.ready()
        for calls, axis in ((engine.core_motion.motion, POS), (engine.core_motion.velocity, VEL)):
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

    def test_start_during_estop(self, harness: Harness) -> None:
        engine, other = harness.ready("one"), harness.connect("other")
        assert engine.core_motion.ReleaseEStop() == GOOD, "without an emergency stop it does nothing"
        assert other.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        stopped = CoreMotionErrorCode.EmergencyStopSignalOn
        assert answers(engine, STARTS) == dict.fromkeys(STARTS, stopped)
        assert engine.core_motion.home.StartHome(POS) == stopped
        assert engine.core_motion.axisControl.SetServoOn(POS, 0) == GOOD, "the servo may be switched off"
        wait_status(engine, lambda now: not now.servo_on[POS], "servo off")
        assert engine.core_motion.axisControl.SetServoOn(POS, 1) == stopped
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert some_cycles(engine, 20).emergency_stop
        assert_at_rest(engine)
        assert not status(engine).servo_on[POS]
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert not status(engine).emergency_stop
        assert STARTS["StartVel"](engine) == GOOD

    def test_final_level_switches_servos_off(self, harness: Harness) -> None:
        engine = harness.ready()
        core = engine.core_motion
        for level in (-1, 2, 10**9):
            assert core.ExecEStop(level) == ErrorCode.ArgumentOutOfRange
        assert not status(engine).emergency_stop
        assert core.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        assert core.ExecEStop(EStopLevel.Final) == GOOD
        snapshot = wait_status(engine, lambda now: not now.servo_on.any(), "servos off")
        assert core.ExecEStop(EStopLevel.Level1) == CoreMotionErrorCode.CurrentEmergencyStopLevelIsHigher
        assert snapshot.emergency_stop_level == status(engine).emergency_stop_level == EStopLevel.Final
        assert_at_rest(engine)
        assert core.ReleaseEStop() == GOOD
        assert not some_cycles(engine, 20).servo_on.any(), "servos stay off after the release"

    @pytest.mark.parametrize("level", list(EStopLevel))
    def test_estop_before_communication_holds_after_it(self, harness: Harness, level: int) -> None:
        engine = harness.connect()
        assert engine.core_motion.ExecEStop(level) == GOOD
        for _ in range(2):
            assert engine.api.StartCommunication(20000) == GOOD
            assert status(engine).emergency_stop
            assert engine.core_motion.axisControl.SetServoOn(POS, 1) == CoreMotionErrorCode.EmergencyStopSignalOn
            assert engine.api.StopCommunication() == GOOD

    # -- homing and names of positions ---------------------------------------------------------------------------------

    def test_home_to_the_current_position(self, harness: Harness) -> None:
        engine = harness.ready()
        home, config = engine.core_motion.home, engine.core_motion.config
        before = status(engine)
        for axis in range(N_AXES):
            _, param = config.GetHomeParam(axis)
            param.homeType, param.homePosition = Config_HomeType.CurrentPos, 0.25
            assert config.SetHomeParam(axis, param)[0] == GOOD
            assert home.StartHome(axis) == GOOD
            wait_idle(engine, axis)
        after = status(engine)
        assert after.home_done.all()
        assert after.pos_cmd == pytest.approx(0.25, abs=1e-6)
        assert after.flags[Flag.ENCODER_COMMAND] == pytest.approx(before.flags[Flag.ENCODER_COMMAND], abs=1)
        assert_at_rest(engine)

    def test_homing_that_needs_a_sensor_the_drives_lack(self, harness: Harness) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        kinds = {
            Config_HomeType.ZPulse: CoreMotionErrorCode.ZPulseDetectionUnsupported,
            Config_HomeType.HS: CoreMotionErrorCode.HomeSwitchDetectionUnsupported,
            Config_HomeType.TouchProbe: CoreMotionErrorCode.TouchProbeDetectionUnsupported,
            Config_HomeType.LS: CoreMotionErrorCode.LimitSwitchDetectionUnsupported,
        }
        for kind, code in kinds.items():
            _, param = config.GetHomeParam(POS)
            assert config.SetHomeParam(POS, replace(param, homeType=kind))[0] == GOOD
            assert engine.core_motion.home.StartHome(POS) == code
        assert not status(engine).home_done[POS]

    def test_renaming_a_position(self, harness: Harness) -> None:
        engine = harness.ready()
        rename, counts = engine.core_motion.home.SetCommandPos, status(engine).flags[Flag.ENCODER_COMMAND, POS]
        assert rename(POS, 12.5) == GOOD
        assert status(engine).pos_cmd[POS] == pytest.approx(12.5, abs=1e-3)
        for position in (NAN, INF, -INF, 1e15):
            assert rename(POS, position) == CoreMotionErrorCode.PositionArgumentOutOfRange
        assert_at_rest(engine)
        assert status(engine).pos_cmd[POS] == pytest.approx(12.5, abs=1e-3)
        assert status(engine).flags[Flag.ENCODER_COMMAND, POS] == pytest.approx(counts, abs=1)

    def test_home_is_lost_with_communication_and_by_another_gear(self, harness: Harness) -> None:
        engine = harness.ready()
        assert engine.core_motion.home.StartHome(POS) == engine.core_motion.home.StartHome(POS_GEARED) == GOOD
        assert engine.core_motion.config.SetGearRatio(POS, 2000.0, 1.0) == GOOD
        assert status(engine).home_done[[POS, POS_GEARED]].tolist() == [False, True]
        engine.api.StopCommunication()
        engine.api.StartCommunication(20000)
        assert not status(engine).home_done[POS_GEARED]

    # -- parameters ----------------------------------------------------------------------------------------------------

    def test_gear_ratio_scales_positions(self, harness: Harness) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        assert config.SetGearRatio(POS, 1000.0, 2.0) == GOOD
        for value in (NAN, INF, 0.0, -1.0, 1e-7, 3e9):
            assert config.SetGearRatio(POS, value, 1.0) == ErrorCode.ArgumentOutOfRange
            assert config.SetGearRatio(POS, 1.0, value) == ErrorCode.ArgumentOutOfRange
        assert config.GetGearRatio(POS) == (GOOD, 1000.0, 2.0)
        assert_at_rest(engine)
        assert engine.core_motion.home.SetCommandPos(POS, 0.0) == GOOD  # in the new unit the position may be far away
        assert engine.core_motion.motion.StartPos(pos(POS, 3.0)) == GOOD
        wait_idle(engine, POS)
        snapshot = status(engine)
        machine = 3.0 + snapshot.reals[Real.HOME_OFFSET, POS]
        assert snapshot.flags[Flag.ENCODER_COMMAND, POS] == pytest.approx(500.0 * machine, abs=0.51)

    def test_polarity_mirrors_positions_and_moves_nothing(self, harness: Harness) -> None:
        engine = harness.ready()
        config = engine.core_motion.config
        for polarity in (0, 2, -2):
            assert config.SetAxisPolarity(POS, polarity) == ErrorCode.ArgumentOutOfRange
        assert config.GetAxisPolarity(POS) == (GOOD, 1)
        assert engine.core_motion.motion.StartPos(pos(POS, 1.0)) == GOOD
        wait_idle(engine, POS)
        counts = status(engine).flags[Flag.ENCODER_COMMAND, POS]
        assert config.SetAxisPolarity(POS, -1) == GOOD
        assert config.GetAxisPolarity(POS) == (GOOD, -1)
        snapshot = some_cycles(engine)
        offset = snapshot.reals[Real.HOME_OFFSET, POS]
        assert snapshot.pos_cmd[POS] == pytest.approx(-(1.0 + offset) - offset, abs=1e-4)
        assert snapshot.flags[Flag.ENCODER_COMMAND, POS] == counts

    @pytest.mark.parametrize("block", list(_BLOCKS))
    def test_blocks(self, harness: Harness, block: str) -> None:
        config = harness.connect().core_motion.config
        read, write = getattr(config, f"Get{block}"), getattr(config, f"Set{block}")
        code, param = read(POS)
        assert code == GOOD
        wanted = replace(param, **_BLOCKS[block])
        assert wanted != param
        assert write(POS, wanted) == (GOOD, wanted)
        for changes in (changes for of, changes in _BAD_BLOCKS if of == block):
            assert write(POS, replace(wanted, **changes))[0] == CoreMotionErrorCode.ParameterSettingsInvalid, changes
        assert read(POS) == (GOOD, wanted)
        assert read(VEL)[1] != wanted, "other axes keep theirs"

    def test_emergency_stop_block(self, harness: Harness) -> None:
        config = harness.connect().core_motion.config
        _, param = config.GetEmergencyStopParam()
        assert len(param.eStopDec) == N_AXES
        param.eStopDec[VEL] = 10.0
        assert config.SetEmergencyStopParam(param)[0] == GOOD
        for changes in _BAD_ESTOP_BLOCKS:
            code, _ = config.SetEmergencyStopParam(replace(param, **changes))
            assert code == CoreMotionErrorCode.ParameterSettingsInvalid, changes
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

    # -- I/O, network and texts ----------------------------------------------------------------------------------------

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
        for byte, bit in ((-1, 0), (4, 0), (8000, 0), (0, -1), (0, 8)):
            assert io.SetOutBit(byte, bit, 1) == ErrorCode.IOAddressOutOfRange
            assert io.GetOutBit(byte, bit) == (ErrorCode.IOAddressOutOfRange, 0)

    def test_network(self, harness: Harness) -> None:
        engine = harness.connect()
        assert engine.ecat.ScanNetwork(0) == GOOD
        assert engine.ecat.ScanNetwork(1) == ErrorCode.ArgumentOutOfRange
        engine.api.StartCommunication(20000)
        assert engine.ecat.ScanNetwork(0) == EcErrorCode.ScanNetworkFailed, "it would disturb a bus that runs"

    def test_error_texts(self, harness: Harness) -> None:
        engine = harness.connect()
        lock, not_on = ErrorCode.CreateDeviceLockError, CoreMotionErrorCode.NotServoOn
        assert "being created" in engine.api.ErrorToString(lock)
        assert "being created" in engine.core_motion.ErrorToString(lock)
        assert engine.core_motion.ErrorToString(not_on) == "the servo is not on"
        assert engine.api.ErrorToString(not_on) == "error code not defined", "another module's code"
        assert engine.io.ErrorToString(123456789) == "error code not defined"
