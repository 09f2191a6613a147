"""Requirements for the motion of any engine behind the port, compared with kinematics computed by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AxisSelection,
    Config_EStopLevel1Type,
    Config_LimitSwitchType,
    Config_ProhibitOvertravelType,
    CoreMotionErrorCode,
    DetailOperationState,
    ErrorCode,
    EStopLevel,
    OperationState,
    Profile,
    Velocity_TimedVelCommand,
)
from robot_stack.wmx.axes import Flag, Real
from tests.unit.wmx.conformance import (
    GOOD,
    SLOW,
    SLOW_BY_TIMES,
    STARTS,
    CallConformance,
    along,
    assert_at_rest,
    braking,
    cruise,
    cruising,
    in_state,
    pos,
    set_estop,
    set_quick_stop,
    vel,
)
from tests.unit.wmx.harness import (
    N_AXES,
    POS,
    POS_GEARED,
    VEL,
    VEL_MIRRORED,
    Harness,
    some_cycles,
    status,
    wait_idle,
    wait_status,
)
from tests.unit.wmx.spline_conformance import SplineMotionConformance

BOTH = pytest.mark.parametrize("axis", [POS, VEL])
MOTIONS = pytest.mark.parametrize(
    ("name", "axis"), [("StartPos", POS), ("StartVel", VEL), ("StartVel_TimedVel", VEL)], ids=lambda v: str(v)
)


class MotionConformance(SplineMotionConformance):
    """Needs: a fixture ``harness`` (Harness) with an idle engine."""

    @MOTIONS
    def test_servo_off_ends_motion(self, harness: Harness, name: str, axis: int) -> None:
        engine = harness.ready()
        assert STARTS[name](engine) == GOOD
        wait_status(engine, lambda now: now.velocity_cmd[axis] > 0.0, "motion")
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

    def test_position_override(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        cruise(engine, POS, Profile.SetupTrapezoidal(20.0, 400.0, 400.0))
        before = status(engine)
        assert motion.StartPos(pos(POS, before.pos_cmd[POS] + 20.0)) == GOOD
        after = status(engine)
        assert after.velocity_cmd[POS] == pytest.approx(20.0, abs=1e-6), "it continues from the present velocity"
        assert after.op_state[POS] == OperationState.Pos
        assert motion.StartPos(pos(POS, 0.0)) == GOOD
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[POS] == 0.0, "it comes back"
        assert motion.StartPos(pos(POS, 0.0)) == GOOD, "the target is where the axis is"
        wait_idle(engine, POS)
        assert status(engine).motion_complete[POS]

    @pytest.mark.parametrize("kind", list(Config_ProhibitOvertravelType))
    def test_override_that_cannot_stop_in_time(self, harness: Harness, kind: int) -> None:
        # 4 rad/s at 4 rad/s2 needs 2 rad; the new target is 1 rad away.
        engine = harness.ready()
        config, motion = engine.core_motion.config, engine.core_motion.motion
        _, param = config.GetMotionParam(POS)
        param.prohibitOvertravel = kind
        assert config.SetMotionParam(POS, param)[0] == GOOD
        cruise(engine, POS, Profile.SetupTrapezoidal(4.0, 100.0, 100.0))
        target = status(engine).pos_cmd[POS] + 1.0
        assert motion.StartPos(pos(POS, target, Profile.SetupTrapezoidal(4.0, 100.0, 4.0))) == GOOD
        furthest = -math.inf
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

    @BOTH
    def test_stop_uses_the_commands_own_deceleration(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        family = cruise(engine, axis, Profile.SetupTrapezoidal(10.0, 400.0, 8.0))
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
        family = cruise(engine, VEL, Profile.SetupTimeAccTrapezoidal(10.0, 20.0, 1000.0))
        assert family.Stop(VEL) == GOOD
        slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[VEL] < 10.0, "slowing")
        assert slowing.reals[Real.CMD_ACC, VEL] == pytest.approx(-10.0)

    @BOTH
    def test_quick_stop_overrides_stop_and_not_the_reverse(self, harness: Harness, axis: int) -> None:
        engine = harness.ready()
        set_quick_stop(engine, axis, 20.0)
        family = cruise(engine, axis, Profile.SetupTrapezoidal(40.0, 2000.0, 4.0))
        assert family.Stop(axis) == GOOD
        wait_status(engine, braking(axis, 4.0), "a soft stop")
        assert family.ExecQuickStop(axis) == GOOD
        wait_status(engine, braking(axis, 20.0), "a quick stop")
        assert family.Stop(axis) == GOOD
        snapshot = status(engine)
        assert snapshot.flags[Flag.DETAIL_OP_STATE, axis] == DetailOperationState.Stop_QStop
        assert braking(axis, 20.0)(snapshot)
        wait_status(engine, in_state(axis, OperationState.Idle), "rest")

    @MOTIONS
    def test_estop_stops_every_kind_of_motion(self, harness: Harness, name: str, axis: int) -> None:
        engine = harness.ready()
        set_estop(engine, 2.0)
        assert STARTS[name](engine) == GOOD
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
    @BOTH
    def test_estop_wins_over_a_stop(self, harness: Harness, axis: int, stop: str) -> None:
        engine = harness.ready()
        set_quick_stop(engine, axis, 4.0)  # softer than the emergency stop
        set_estop(engine, 20.0)
        family = cruise(engine, axis, Profile.SetupTrapezoidal(40.0, 2000.0, 4.0))
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
        family = cruise(engine, VEL, Profile.SetupTrapezoidal(40.0, 2000.0, 400.0))
        assert family.ExecQuickStop(VEL) == GOOD
        wait_status(engine, braking(VEL, 20.0), "the quick stop")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert braking(VEL, 20.0)(some_cycles(engine, 2))

    def test_release_during_the_ramp_completes_the_stop_and_moves_nothing(self, harness: Harness) -> None:
        engine = harness.ready()
        set_estop(engine, 40.0)
        assert engine.core_motion.velocity.StartVel(vel(VEL, 80.0, acc=0.0)) == GOOD
        wait_status(engine, cruising(VEL, 80.0), "cruising")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert engine.core_motion.ReleaseEStop() == GOOD
        assert engine.core_motion.velocity.StartVel(vel(VEL, 80.0)) == CoreMotionErrorCode.NotIdleOrVelocityState
        wait_status(engine, in_state(VEL, OperationState.Idle), "rest")
        assert not status(engine).emergency_stop
        assert_at_rest(engine)

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

    def limit(self, engine: MotionEngine, **changes: float) -> None:
        config = engine.core_motion.config
        _, param = config.GetLimitParam(POS)
        assert config.SetLimitParam(POS, replace(param, **changes))[0] == GOOD

    def test_soft_limit_stops_a_homed_axis_and_allows_motion_back(self, harness: Harness) -> None:
        engine = harness.ready()
        motion = engine.core_motion.motion
        self.limit(engine, softLimitType=Config_LimitSwitchType.Dec, softLimitPositivePos=1.0, lsDec=400.0)
        for target in (1.5, 0.0):
            assert motion.StartPos(pos(POS, target)) == GOOD
            wait_idle(engine, POS)
            assert status(engine).pos_cmd[POS] == target, "an axis without home has no limits"
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

    def test_negative_soft_limit_with_servo_off(self, harness: Harness) -> None:
        engine = harness.ready()
        kind = Config_LimitSwitchType.SlowDecServoOff
        self.limit(engine, softLimitType=kind, softLimitNegativePos=-0.5, lsSlowDec=100.0)
        assert engine.core_motion.home.StartHome(POS) == GOOD
        assert engine.core_motion.motion.StartPos(along(POS, -2.0)) == GOOD
        snapshot = wait_status(engine, lambda now: not now.servo_on[POS], "servo off")
        assert snapshot.flags[Flag.NEGATIVE_SOFT_LIMIT, POS]

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


class EngineConformance(CallConformance, MotionConformance):
    """Every requirement."""
