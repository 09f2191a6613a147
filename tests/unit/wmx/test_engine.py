"""The engine alone, cycle by cycle, without clock and socket."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.api import (
    AxisCommandMode,
    Config_LimitParam,
    Config_LimitSwitchType,
    CoreMotionErrorCode,
    DetailOperationState,
    EngineState,
    ErrorCode,
    EStopLevel,
    Motion_PosCommand,
    OperationState,
    Profile,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from robot_stack.wmx.engine_server import kernel, profile
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.requests import METHODS, Session, execute
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from tests.unit.wmx.harness import (
    ESTOP_DEC,
    N_AXES,
    POS,
    POS_MIRRORED,
    VEL,
    VEL_MIRRORED,
    engine_config,
)

CYCLE_S = 0.001
FAST = Profile.SetupTrapezoidal(20.0, 400.0, 400.0)


class Bench:
    """An engine on virtual drives, stepped by hand."""

    def __init__(self, **changes: Any) -> None:
        config = engine_config(**changes)
        self.drives = VirtualDrives(config.n_axes, config.cycle_time_s)
        self.engine = Engine(config, self.drives)
        self.device = 0

    def ready(self) -> Bench:
        """A device, communication, all servos on."""
        code, device = self.engine.create_device(0)
        assert code == ErrorCode.PyNone
        assert device is not None
        self.device = device.id
        assert self.engine.start_communication() == ErrorCode.PyNone
        self.step(10)
        assert self.engine.condition.communicating
        assert self.engine.set_servo_on(range(N_AXES), 1) == ErrorCode.PyNone
        self.step(10)
        assert self.flag(Flag.SERVO_ON).all()
        return self

    def step(self, cycles: int = 1) -> None:
        for _ in range(cycles):
            self.engine.cycle()

    def flag(self, row: Flag) -> Any:
        return self.engine.arrays.flags[row]

    def real(self, row: Real) -> Any:
        return self.engine.arrays.reals[row]

    def start_pos(self, axis: int, target: float, motion: Profile = FAST) -> int:
        return self.engine.motion.start_position(self.device, [Motion_PosCommand(axis, target, motion)], relative=False)

    def start_vel(self, axis: int, velocity: float, acc: float = 400.0, dec: float = 400.0) -> int:
        command = Velocity_VelCommand(axis, Profile.SetupTrapezoidal(velocity, acc, dec))
        return self.engine.motion.start_velocity(self.device, [command])


@pytest.fixture
def bench() -> Bench:
    return Bench().ready()


class TestTiming:
    def test_communication_takes_its_cycles(self) -> None:
        bench = Bench()
        bench.engine.create_device(0)
        assert bench.engine.start_communication() == ErrorCode.PyNone
        bench.step(9)
        assert bench.engine.condition.state is EngineState.Running
        bench.step(1)
        assert bench.engine.condition.state is EngineState.Communicating

    def test_servo_request_is_delayed(self) -> None:
        bench = Bench()
        bench.engine.create_device(0)
        bench.engine.start_communication()
        bench.step(10)
        bench.engine.set_servo_on([POS], 1)
        bench.step(5)
        assert not bench.engine.commands.servo_on[POS]
        bench.step(1)
        assert bench.engine.commands.servo_on[POS]
        assert not bench.flag(Flag.SERVO_ON)[POS], "the drive takes its own time"
        bench.step(3)
        assert bench.flag(Flag.SERVO_ON)[POS]

    def test_trapezoid_to_the_cycle(self, bench: Bench) -> None:
        # 1 rad at 10 rad/s and 100 rad/s2: 0.1 s up, no cruise, 0.1 s down: 200 cycles.
        assert bench.start_pos(POS, 1.0, Profile.SetupTrapezoidal(10.0, 100.0, 100.0)) == ErrorCode.PyNone
        bench.step(100)
        assert bench.real(Real.VELOCITY_CMD)[POS] == pytest.approx(10.0)
        assert bench.real(Real.POS_CMD)[POS] == pytest.approx(0.5)
        bench.step(99)
        assert bench.flag(Flag.OP_STATE)[POS] == OperationState.Pos
        bench.step(1)
        assert bench.flag(Flag.OP_STATE)[POS] == OperationState.Idle
        assert bench.real(Real.POS_CMD)[POS] == 1.0
        assert bench.flag(Flag.MOTION_COMPLETE)[POS]

    def test_timed_velocity_to_the_cycle(self, bench: Bench) -> None:
        # 20 ms to 5 rad/s, 50 ms at it, 10 ms to rest: the sum of the three, as the vendor's manual has it.
        command = Velocity_TimedVelCommand(VEL, 50.0, Profile.SetupTimeAccTrapezoidal(5.0, 20.0, 10.0))
        assert bench.engine.motion.start_velocity(bench.device, [command]) == ErrorCode.PyNone
        bench.step(69)
        assert bench.flag(Flag.OP_STATE)[VEL] == OperationState.Velocity
        bench.step(1)
        assert bench.flag(Flag.OP_STATE)[VEL] == OperationState.Stop
        bench.step(8)
        assert bench.flag(Flag.OP_STATE)[VEL] == OperationState.Stop
        bench.step(1)
        assert bench.flag(Flag.OP_STATE)[VEL] == OperationState.Idle

    def test_timed_velocity_slows_down_at_the_rate_at_which_it_stops(self, bench: Bench) -> None:
        bench.start_vel(VEL, 5.0)
        bench.step(200)
        # 4 rad/s to rest in 40 ms is 100 rad/s2: from 5 to 4 rad/s in 10 ms, then 50 ms of it.
        command = Velocity_TimedVelCommand(VEL, 50.0, Profile.SetupTimeAccTrapezoidal(4.0, 1.0, 40.0))
        assert bench.engine.motion.start_velocity(bench.device, [command]) == ErrorCode.PyNone
        bench.step(5)
        assert bench.real(Real.VELOCITY_CMD)[VEL] == pytest.approx(4.5)
        bench.step(54)
        assert bench.flag(Flag.OP_STATE)[VEL] == OperationState.Velocity
        bench.step(6)
        assert bench.flag(Flag.OP_STATE)[VEL] == OperationState.Stop
        assert bench.real(Real.VELOCITY_CMD)[VEL] == pytest.approx(3.4)

    def test_acceleration_in_no_time_is_a_step_up_and_down(self, bench: Bench) -> None:
        for speed in (5.0, 3.0):
            command = Velocity_TimedVelCommand(VEL, 50.0, Profile.SetupTimeAccTrapezoidal(speed, 0.0, 100.0))
            assert bench.engine.motion.start_velocity(bench.device, [command]) == ErrorCode.PyNone
            bench.step(1)
            assert bench.real(Real.VELOCITY_CMD)[VEL] == speed

    def test_watchdog_closes_the_device_of_a_process_that_does_not_run_and_stops_nothing(self, bench: Bench) -> None:
        other = bench.engine.create_device(0)[1]
        assert other is not None
        session = Session(bench.device)
        _, _, limit_ms, silent_ms, _ = execute(bench.engine, session, "WMX3Api.GetAllDevices", [])[1][0][1][0]
        assert limit_ms == 15_000
        assert silent_ms <= 100
        bench.start_vel(VEL, 5.0)
        bench.step(3000)
        assert bench.engine.devices.get(bench.device) is not None, "its library reports, whatever it calls"
        bench.engine.alive = lambda device: device != bench.device
        bench.step(500)
        silent_ms = execute(bench.engine, session, "WMX3Api.GetAllDevices", [])[1][0][1][0][3]
        assert 400 <= silent_ms <= 600
        bench.step(15_000)
        assert bench.engine.devices.get(bench.device) is None
        assert bench.engine.devices.get(other.id) is not None
        assert bench.flag(Flag.OP_STATE)[VEL] == OperationState.Velocity, "nothing has stopped it"

    def test_shutdown_passes_through_its_state(self, bench: Bench) -> None:
        bench.engine.stop_engine()
        assert bench.engine.condition.state is EngineState.Shutdown
        assert bench.engine.create_device(0) == (ErrorCode.EngineNotStartedInSpecifiedTime, None)
        bench.step(5)
        assert bench.engine.condition.state is EngineState.Idle
        assert bench.engine.create_device(0)[0] == ErrorCode.PyNone

    def test_last_exchange_switches_the_servos_off(self, bench: Bench) -> None:
        seen: list[bool] = []
        exchange = bench.drives.exchange
        bench.drives.exchange = lambda out, inp: seen.append(bool(out.servo_on.any())) or exchange(out, inp)  # type: ignore[method-assign,func-returns-value]
        bench.engine.stop_communication()
        assert seen == [False]
        bench.step(50)
        assert seen == [False], "no exchange without communication"

    def test_bus_lost_for_just_as_long_as_allowed(self, bench: Bench) -> None:
        bench.drives.lose_cycles = 20
        bench.step(30)
        assert bench.engine.condition.communicating
        bench.drives.lose_cycles = 21
        bench.step(30)
        assert bench.engine.condition.state is EngineState.Running


class TestDriveCommands:
    def test_position_mode_sends_counts_and_feed_forward(self, bench: Bench) -> None:
        bench.start_pos(POS_MIRRORED, 100.0, Profile.SetupTrapezoidal(3.0, 400.0, 400.0))
        bench.step(50)
        scale = -131072 / (2 * math.pi)
        out = bench.engine.commands
        user = bench.real(Real.POS_CMD)[POS_MIRRORED] + bench.real(Real.HOME_OFFSET)[POS_MIRRORED]
        assert out.position_counts[POS_MIRRORED] == round(user * scale)
        assert out.velocity_counts_per_s[POS_MIRRORED] == pytest.approx(3.0 * scale)
        assert out.mode[POS_MIRRORED] == AxisCommandMode.Position

    def test_velocity_mode_sends_velocity_and_follows_the_position(self, bench: Bench) -> None:
        bench.start_vel(VEL_MIRRORED, 3.0)
        bench.step(50)
        out, scale = bench.engine.commands, -131072 / (2 * math.pi)
        assert out.velocity_counts_per_s[VEL_MIRRORED] == pytest.approx(3.0 * scale)
        before = int(bench.flag(Flag.ENCODER_FEEDBACK)[VEL_MIRRORED])
        bench.step()
        assert out.position_counts[VEL_MIRRORED] == before
        assert out.mode[VEL_MIRRORED] == AxisCommandMode.Velocity

    def test_servo_off_sends_rest_where_the_axis_is(self, bench: Bench) -> None:
        bench.engine.set_servo_on(range(N_AXES), 0)
        bench.step(5)
        bench.drives.position[:] = [1000, -2000, 3000, -4000, 5000]  # moved by hand
        bench.step(2)
        out = bench.engine.commands
        assert out.position_counts.tolist() == [1000, -2000, 3000, -4000, 5000]
        assert not out.velocity_counts_per_s.any()
        assert bench.real(Real.POS_CMD).tolist() == bench.real(Real.ACTUAL_POS).tolist()

    def test_bus_of_another_size_is_refused(self) -> None:
        with pytest.raises(ValueError, match="n_axes must be 5"):
            Engine(engine_config(), VirtualDrives(4, CYCLE_S))


MOTIONS: dict[str, Callable[[Bench], Any]] = {
    "idle": lambda b: None,
    "position": lambda b: b.start_pos(POS, 100.0),
    "velocity": lambda b: b.start_vel(VEL, 20.0),
    "override": lambda b: (b.start_pos(POS, 100.0), b.step(30), b.start_pos(POS, -100.0)),
    "stop": lambda b: (b.start_pos(POS, 100.0), b.step(60), b.engine.motion.stop([POS], AxisCommandMode.Position)),
    "soft stop": lambda b: (
        b.start_vel(VEL, 20.0),
        b.step(60),
        b.engine.motion.stop_axis(VEL, 4.0, DetailOperationState.Stop),
    ),
    "quick stop": lambda b: (
        b.start_vel(VEL, 20.0),
        b.step(60),
        b.engine.motion.quick_stop([VEL], AxisCommandMode.Velocity),
    ),
    "ownerless": lambda b: (b.engine.create_device(0), b.start_vel(VEL, 20.0), b.engine.remove_device(b.device)),
    "first cycle": lambda b: (b.step(1), b.start_vel(VEL, 20.0)),
}


class TestEmergencyStop:
    @pytest.mark.parametrize(
        ("cycles", "level"), [(0, EStopLevel.Level1), (1, EStopLevel.Final), (50, EStopLevel.Level1)]
    )
    @pytest.mark.parametrize("motion", list(MOTIONS.values()), ids=list(MOTIONS))
    def test_wins_over_everything(self, motion: Callable[[Bench], Any], cycles: int, level: EStopLevel) -> None:
        bench = Bench().ready()
        motion(bench)
        bench.step(cycles)
        speed = np.abs(bench.real(Real.VELOCITY_CMD)).max()
        assert bench.engine.exec_estop(level) == ErrorCode.PyNone
        for _ in range(math.ceil(speed / ESTOP_DEC / CYCLE_S) + 3):
            before = bench.real(Real.VELOCITY_CMD).copy()
            assert bench.start_pos(POS, 1.0) == CoreMotionErrorCode.EmergencyStopSignalOn
            assert bench.start_vel(VEL, 1.0) == CoreMotionErrorCode.EmergencyStopSignalOn
            bench.engine.motion.stop([POS], AxisCommandMode.Position)
            bench.engine.motion.stop_axis(VEL, 0.01, DetailOperationState.Stop)
            bench.step()
            after = bench.real(Real.VELOCITY_CMD)
            assert (np.abs(after) <= np.maximum(np.abs(before) - ESTOP_DEC * CYCLE_S, 0.0) + 1e-9).all()
        assert not bench.flag(Flag.OP_STATE).any()
        assert not bench.engine.commands.velocity_counts_per_s.any()
        assert bench.engine.condition.emergency_stop

    def test_final_level_sends_the_servos_off_in_the_next_cycle(self, bench: Bench) -> None:
        bench.start_vel(VEL, 20.0)
        bench.step(10)
        bench.engine.exec_estop(EStopLevel.Final)
        bench.step(1)
        assert not bench.engine.commands.servo_on.any()

    def test_first_cycle_after_the_call_brakes(self, bench: Bench) -> None:
        bench.start_vel(VEL, 20.0, acc=0.0)
        bench.step(2)
        bench.engine.exec_estop(EStopLevel.Level1)
        bench.step(1)
        assert bench.real(Real.VELOCITY_CMD)[VEL] == pytest.approx(20.0 - ESTOP_DEC * CYCLE_S)

    def test_configured_to_switch_off_after_the_ramp(self) -> None:
        bench = Bench(estop_servo_off=True).ready()
        bench.start_vel(VEL, 1.0, acc=0.0)
        bench.step(2)
        bench.engine.exec_estop(EStopLevel.Level1)
        bench.step(9)
        assert bench.engine.commands.servo_on[VEL]
        assert not bench.engine.commands.servo_on[POS], "an axis at rest goes off at once"
        bench.step(3)
        assert not bench.engine.commands.servo_on.any()


class TestOverrides:
    @settings(max_examples=40, deadline=None)
    @given(
        st.lists(
            st.tuples(
                st.integers(1, 120),
                st.floats(-5.0, 5.0),
                st.floats(0.5, 20.0),
                st.floats(20.0, 500.0),
                st.floats(20.0, 500.0),
            ),
            min_size=2,
            max_size=5,
        )
    )
    def test_velocity_is_continuous_over_any_sequence_of_targets(
        self, commands: list[tuple[int, float, float, float, float]]
    ) -> None:
        """Overshoot is allowed, so no deceleration exceeds the command's and no step exceeds acc or dec."""
        bench = _shared_bench()
        bench.engine.arrays.work[16, POS] = profile.OVERTRAVEL_DISABLED
        target = bench.real(Real.POS_CMD)[POS]
        for cycles, target, limit, acc, dec in commands:
            assert bench.start_pos(POS, target, Profile.SetupTrapezoidal(limit, acc, dec)) == ErrorCode.PyNone
            for _ in range(cycles):
                before = bench.real(Real.VELOCITY_CMD)[POS]
                position = bench.real(Real.POS_CMD)[POS]
                bench.step()
                after = bench.real(Real.VELOCITY_CMD)[POS]
                assert abs(after - before) <= max(acc, dec) * CYCLE_S * (1.0 + 1e-6) + 1e-9
                moved = bench.real(Real.POS_CMD)[POS] - position
                assert moved == pytest.approx(0.5 * (before + after) * CYCLE_S, abs=max(acc, dec) * CYCLE_S**2)
        for _ in range(20000):
            if not bench.flag(Flag.OP_STATE)[POS]:
                break
            bench.step()
        assert bench.real(Real.POS_CMD)[POS] == target


_BENCH: list[Bench] = []


def _shared_bench() -> Bench:
    """Returns one bench for all examples of a property, at rest."""
    if not _BENCH:
        _BENCH.append(Bench().ready())
    bench = _BENCH[0]
    bench.engine.motion.quick_stop_axis(POS)
    bench.engine.motion.quick_stop_axis(VEL)
    for _ in range(2000):
        bench.step()
        if bench.engine.at_rest:
            break
    assert bench.engine.at_rest
    return bench


class TestSoftLimits:
    def test_each_end_has_its_type(self, bench: Bench) -> None:
        limits = Config_LimitParam(
            softLimitType=Config_LimitSwitchType.SeparatePositiveLSNegativeLS,
            positiveSoftLimitType=Config_LimitSwitchType.SlowDec,
            softLimitPositivePos=0.5,
            softLimitNegativePos=-0.5,
            lsDec=10.0,
            lsSlowDec=2.0,
        )
        assert bench.engine.parameters.set("limit", POS, limits) == ErrorCode.PyNone
        bench.flag(Flag.HOME_DONE)[POS] = 1
        slow = Profile.SetupTrapezoidal(1.0, 10.0, 10.0)
        assert bench.start_pos(POS, 1000.0, slow) == ErrorCode.PyNone
        bench.step(1500)
        assert bench.flag(Flag.OP_STATE)[POS] == OperationState.Idle
        assert bench.real(Real.POS_CMD)[POS] == pytest.approx(0.5 + 1.0 / 4.0, abs=0.004)
        assert bench.start_pos(POS, 2.0, slow) == ErrorCode.AxisSoftLimit
        assert bench.start_pos(POS, -1000.0, slow) == ErrorCode.PyNone
        bench.step(2000)
        assert bench.real(Real.ACTUAL_POS)[POS] < -0.6, "no limit at this end"


class TestRequests:
    """Any request gets an answer and no exception, and only requested motion occurs."""

    VALUES = (
        st.none()
        | st.booleans()
        | st.integers()
        | st.floats()
        | st.text(max_size=5)
        | st.lists(st.integers(-2, 6) | st.floats() | st.lists(st.floats(), max_size=8), max_size=4)
        | st.dictionaries(st.text(max_size=3), st.floats(), max_size=2)
    )

    @settings(max_examples=200, deadline=None)
    @given(st.sampled_from([*METHODS, "nonsense", "", None, 7]), st.lists(VALUES, max_size=4))
    def test_any_arguments(self, method: Any, arguments: list[Any]) -> None:
        bench = _fuzz_bench()
        session = Session(bench.device)
        code, values = execute(bench.engine, session, method, arguments)
        assert isinstance(int(code), int)
        assert isinstance(values, list)
        bench.step(2)
        assert np.isfinite(bench.engine.arrays.reals).all()

    def test_wrong_number_of_arguments(self, bench: Bench) -> None:
        session = Session(bench.device)
        for method in METHODS:
            for count in range(6):
                code, _ = execute(bench.engine, session, method, [None] * count)
                if code == ErrorCode.PyNone:
                    assert count == 0, method
                session.device = bench.device

    def test_unknown_method(self, bench: Bench) -> None:
        for name in ("Reboot", "__class__", "", None, 5, ["StartPos"], {}):
            assert execute(bench.engine, Session(bench.device), name, []) == (ErrorCode.NoSupportedFunction, [])

    def test_without_a_device(self) -> None:
        bench = Bench()
        for method in set(METHODS) - {"CreateDevice"}:
            arity = next(n for n in range(6) if execute(bench.engine, Session(), method, [0] * n)[0] != 1555)
            assert execute(bench.engine, Session(), method, [0] * arity) == (ErrorCode.DeviceIsNull, [])


_FUZZED: list[Bench] = []


def _fuzz_bench() -> Bench:
    if not _FUZZED:
        _FUZZED.append(Bench().ready())
    bench = _FUZZED[0]
    if not bench.engine.condition.communicating or bench.engine.devices.get(bench.device) is None:
        _FUZZED[0] = Bench().ready()
    return _FUZZED[0]


class TestGearsOverTime:
    def test_a_wheel_that_turns_for_hours_keeps_its_precision(self, bench: Bench) -> None:
        """After 1e9 counts, velocity and position are still exact to the count."""
        bench.engine.set_servo_on([VEL], 0)
        bench.step(3)
        bench.drives.position[VEL] = 1e12
        bench.step(2)
        bench.engine.set_servo_on([VEL], 1)
        bench.step(20)
        assert bench.start_vel(VEL, 10.0) == ErrorCode.PyNone
        bench.step(100)
        start = bench.flag(Flag.ENCODER_FEEDBACK)[VEL]
        bench.step(1000)
        moved = (bench.flag(Flag.ENCODER_FEEDBACK)[VEL] - start) * 2 * math.pi / 131072
        assert moved == pytest.approx(10.0, abs=1e-3)


class TestBrokenBus:
    def test_feedback_of_lost_bus_cycle_is_ignored(self) -> None:
        """Feedback of a cycle that the bus reports as lost is not used."""

        class Liar(VirtualDrives):
            def exchange(self, out: DriveCommands, inp: DriveFeedback) -> bool:
                good = super().exchange(out, inp)
                if not good:
                    inp.position_counts[:] = 999
                return good

        config = engine_config()
        drives = Liar(N_AXES, CYCLE_S)
        engine = Engine(config, drives)
        engine.create_device(0)
        engine.start_communication()
        for _ in range(20):
            engine.cycle()
        drives.lose_cycles = 3
        for _ in range(3):
            engine.cycle()
        assert engine.arrays.reals[Real.ACTUAL_POS, POS] == 0.0

    def test_exception_of_the_bus_is_not_swallowed(self, bench: Bench) -> None:
        def broken(out: DriveCommands, inp: DriveFeedback) -> bool:
            raise RuntimeError("cable")

        bench.drives.exchange = broken  # type: ignore[method-assign]
        with pytest.raises(RuntimeError, match="cable"):
            bench.engine.cycle()


class TestCompilation:
    def test_nothing_is_compiled_once_the_engine_is_up(self, bench: Bench) -> None:
        """A compilation during a ride would stop the cycle for seconds."""
        compiled = [
            function
            for module in (kernel, profile)
            for function in vars(module).values()
            if hasattr(function, "signatures")
        ]
        assert len(compiled) > 10
        before = [len(function.signatures) for function in compiled]
        for motion in MOTIONS.values():
            fresh = Bench().ready()
            motion(fresh)
            fresh.engine.exec_estop(EStopLevel.Level1)
            fresh.step(5)
            fresh.engine.stop_communication()
        for motion_profile in (FAST, Profile.SetupTimeAccTrapezoidal(5, 10, 10), Profile.SetupTrapezoidal(5, 10, 10)):
            assert bench.start_pos(POS, 1, motion_profile) == ErrorCode.PyNone
            assert bench.start_vel(VEL, 1, 0, 0) == ErrorCode.PyNone
            bench.step(2)
            bench.engine.motion.stop([POS], AxisCommandMode.Position)
            bench.engine.motion.stop([VEL], AxisCommandMode.Velocity)
            bench.step(500)
        assert [len(function.signatures) for function in compiled] == before
