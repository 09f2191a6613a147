"""Switches and homing as a client of the port sees them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    Config_HomeType,
    Config_LimitSwitchType,
    ErrorCode,
    HomeError,
    HomeState,
    OperationState,
)
from robot_stack.wmx.axes import Flag
from robot_stack.wmx.simulated.switches import DriveSwitches
from tests.unit.wmx.conformance import GOOD, along
from tests.unit.wmx.harness import N_AXES, POS, ThreadHarness, engine_in_thread, status, wait_idle, wait_status

TURN = 131072.0
"""Counts of a turn of the axis. A new drive of the tests is at 0."""


@pytest.fixture(scope="module")
def running() -> Iterator[ThreadHarness]:
    with engine_in_thread() as made:
        yield made


@pytest.fixture
def harness(running: ThreadHarness) -> Iterator[ThreadHarness]:
    yield running
    running.end_test()
    running.drives.switches = [None] * N_AXES


def ready(harness: ThreadHarness, sensors: DriveSwitches) -> MotionEngine:
    """Returns a client, servos on. ``sensors`` are in counts relative to the drive of POS."""
    engine = harness.ready()
    here = float(harness.drives.position[POS])
    harness.drives.switches[POS] = DriveSwitches(
        *(
            value + here
            for value in (sensors.positive_limit, sensors.negative_limit, sensors.home_from, sensors.home_to)
        )
    )
    config = engine.core_motion.config
    home = config.GetHomeParam(POS)[1]
    home.homeType, home.homingVelocityFast, home.homeShiftVelocity = Config_HomeType.HS, 20.0, 5.0
    home.homingVelocityFastAcc = home.homingVelocityFastDec = home.homingVelocitySlowDec = 400.0
    assert config.SetHomeParam(POS, home)[0] == GOOD
    limit = config.GetLimitParam(POS)[1]
    limit.lsType, limit.lsDec = Config_LimitSwitchType.Dec, 400.0
    assert config.SetLimitParam(POS, limit)[0] == GOOD
    return engine


def record(engine: MotionEngine) -> tuple[bool, bool, bool, int, int]:
    """Returns positiveLS, negativeLS, homeSwitch, homeState, homeError."""
    flags = status(engine).flags[:, POS].tolist()
    state, error = flags[Flag.HOME_STATE], flags[Flag.HOME_ERROR]
    return bool(flags[Flag.POSITIVE_LS]), bool(flags[Flag.NEGATIVE_LS]), bool(flags[Flag.HOME_SWITCH]), state, error


def test_home_switch(harness: ThreadHarness) -> None:
    engine = ready(harness, DriveSwitches(home_from=5 * TURN, home_to=100 * TURN))
    assert engine.core_motion.home.StartHome(POS) == GOOD
    snapshot = wait_status(engine, lambda now: now.flags[Flag.HOME_STATE, POS] == HomeState.HSSearch, "the search")
    assert snapshot.op_state[POS] == OperationState.Home
    assert not snapshot.home_done[POS]
    wait_idle(engine, POS)
    snapshot = wait_status(engine, lambda now: now.home_done[POS], "home")
    assert snapshot.motion_complete[POS]
    assert snapshot.pos_cmd[POS] == pytest.approx(0.0, abs=1e-9)
    # 20 rad/s: two cycles are 0.04 rad
    assert harness.drives.position[POS] == pytest.approx(5 * TURN, abs=0.05 * TURN / 6.28 + 1)
    assert record(engine)[3:] == (HomeState.Idle, HomeError.NoError)


def test_cancel(harness: ThreadHarness) -> None:
    engine = ready(harness, DriveSwitches(home_from=1e9, home_to=2e9))
    assert engine.core_motion.home.StartHome(POS) == GOOD
    wait_status(engine, lambda now: now.flags[Flag.HOME_STATE, POS] == HomeState.HSSearch, "the search")
    assert engine.core_motion.home.Cancel(POS) == GOOD
    snapshot = wait_status(engine, lambda now: now.op_state[POS] == OperationState.Idle, "the end")
    assert not snapshot.home_done[POS]
    assert record(engine)[3:] == (HomeState.Idle, HomeError.NoError)


def test_limit_while_homing(harness: ThreadHarness) -> None:
    engine = ready(harness, DriveSwitches(2 * TURN, -2 * TURN, home_from=1e9, home_to=2e9))
    assert engine.core_motion.home.StartHome(POS) == GOOD
    assert wait_idle(engine, POS).flags[Flag.END_REASON, POS] == ErrorCode.AxisHardLimit
    positive, negative, _, state, error = record(engine)
    assert (positive, negative) == (False, True), "it had turned round at the other one"
    assert (state, error) == (HomeState.Idle, HomeError.LSTriggered)


def test_limit_switch(harness: ThreadHarness) -> None:
    engine = ready(harness, DriveSwitches(2 * TURN, -2 * TURN))
    motion = engine.core_motion.motion
    assert motion.StartPos(along(POS, 10.0)) == GOOD
    assert wait_idle(engine, POS).flags[Flag.END_REASON, POS] == ErrorCode.AxisHardLimit
    assert record(engine)[:2] == (True, False)
    assert motion.StartPos(along(POS, 1.0)) == ErrorCode.AxisHardLimit
    assert "limit" in engine.api.ErrorToString(ErrorCode.AxisHardLimit)
    assert motion.StartPos(along(POS, -10.0)) == GOOD
    wait_status(engine, lambda now: not now.flags[Flag.POSITIVE_LS, POS], "the switch to let go")
    assert wait_idle(engine, POS).flags[Flag.END_REASON, POS] == ErrorCode.AxisHardLimit
    assert record(engine)[:2] == (False, True)
