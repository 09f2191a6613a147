"""A goal tick by tick in fake time: every way it can end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.goals import GoalStatus
from robot_stack.wmx.api import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.trajectory.arm import Blind
from robot_stack.wmx.trajectory.execution import Execution, Phase
from robot_stack.wmx.trajectory.goal import CheckedGoal
from robot_stack.wmx.trajectory.results import Fault, GoalCode, Result, aborted, canceled
from robot_stack.wmx.trajectory.settings import ExecutionSettings
from robot_stack.wmx.trajectory.tolerances import Tolerances
from tests.unit.wmx.trajectory.fake_arm import SETTINGS, TICK_S, FakeArm, goal

THERE = goal((0.0, (0.0, 0.0)), (1.0, (0.4, 0.2)), (2.0, (1.0, -0.2)))
SILENT = Blind(Fault(ErrorCode.StatusChannelError, "engine status: stale"), gone=False)
GONE = Blind(Fault(ErrorCode.IMLibIsNotRunning, "the motion engine has ended"), gone=True)


class Run:
    """An execution and its arm on one fake clock."""

    def __init__(
        self, requested: CheckedGoal = THERE, arm: FakeArm | None = None, settings_: ExecutionSettings = SETTINGS
    ) -> None:
        self.arm = arm or FakeArm()
        self.now_s = 0.0
        self.execution = Execution(requested, self.arm, settings_, self.now_s)
        self.blind: Blind | None = None
        self.result = self.execution.tick(self.now_s, self.arm.state())

    def tick(self) -> None:
        self.now_s += TICK_S
        self.arm.advance()
        self.result = self.execution.tick(self.now_s, self.blind or self.arm.state())

    def until(self, condition: Callable[[], bool], limit_s: float = 10.0) -> None:
        end_s = self.now_s + limit_s
        while not condition():
            assert self.now_s < end_s, "waited in vain"
            self.tick()

    def to_end(self) -> Result:
        self.until(lambda: self.result is not None)
        assert self.result is not None
        return self.result

    def to(self, time_s: float) -> None:
        self.until(lambda: self.now_s >= time_s)
        assert self.result is None

    def stop(self, ending: Result, quick: bool = False) -> None:
        self.execution.stop(self.now_s, ending, quick=quick)


def test_a_goal_begins_at_once_and_succeeds_when_the_arm_is_there() -> None:
    run = Run()
    assert run.arm.calls == ["start"]
    assert run.execution.phase is Phase.RUNNING
    result = run.to_end()
    assert (result.outcome, result.code, result.text) == (GoalStatus.SUCCEEDED, 0, "")
    assert run.now_s == pytest.approx(2.0, abs=0.02)
    assert run.arm.calls == ["start"]
    assert run.arm.command == pytest.approx([1.0, -0.2])


@pytest.mark.parametrize("delay_s", [0.0, 0.001, 0.004, 0.012])
def test_samples_compare_with_the_spline_at_the_time_of_the_engine(delay_s: float) -> None:
    run = Run()
    run.arm._began_s += delay_s - run.arm.start_takes_s
    run.arm.offset[:] = (0.003, -0.001)
    run.to(1.3)
    sample = run.execution.sample
    assert sample is not None
    assert sample.time_s == pytest.approx(run.now_s - delay_s, abs=1e-4)
    assert sample.actual_position - sample.position == pytest.approx([0.003, -0.001], abs=1e-4)
    expected = run.arm.splines[0].evaluate(run.now_s - delay_s)
    assert sample.velocity == pytest.approx(expected[1], abs=1e-3)
    assert sample.acceleration == pytest.approx(expected[2], abs=1e-2)


def test_the_time_of_a_sample_is_that_of_the_goal() -> None:
    """A start 0.3 s late, at half speed."""
    slow = replace(SETTINGS, plan=replace(SETTINGS.plan, speed_scaling=0.5, catch_up_acceleration_radps2=9.0))
    run = Run(goal((0.0, (0.0, 0.0)), (1.0, (0.4, 0.2)), (2.0, (1.0, -0.2)), late_s=0.3), settings_=slow)
    run.to(1.0)
    assert run.execution.sample is not None
    assert run.execution.sample.time_s == pytest.approx(0.3 + 0.5, abs=0.01)
    assert run.to_end().outcome is GoalStatus.SUCCEEDED
    assert run.now_s == pytest.approx(2.0 * 1.7, abs=0.02)


def test_a_late_start_waits_for_its_time() -> None:
    run = Run(goal((1.0, (0.5, 0.0)), start_in_s=0.5))
    run.to(0.49)
    assert run.arm.calls == []
    run.to(0.51)
    assert run.arm.calls == ["start"]
    assert run.to_end().outcome is GoalStatus.SUCCEEDED
    assert run.now_s == pytest.approx(1.5, abs=0.02)


def test_nothing_to_do_succeeds_without_the_engine() -> None:
    for requested, words in ((goal(), "no points"), (goal((1.0, (0.0, 0.0))), "already there")):
        run = Run(requested)
        assert run.result is not None
        assert (run.result.outcome, run.result.code) == (GoalStatus.SUCCEEDED, 0)
        assert words in run.result.text
        assert run.arm.calls == []


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"communicating": False}, ErrorCode.CommNotStarted, "communication"),
        ({"emergency_stop": True}, CoreMotionErrorCode.EmergencyStopSignalOn, "emergency stop"),
        ({"servo_on": np.array([True, False])}, ErrorCode.ServoOff, "elbow: the servo is off"),
        ({"alarm_code": np.array([0x7500, 0])}, ErrorCode.AxisAmpAlarm, "shoulder: amplifier alarm 0x7500"),
        ({"following_error": np.array([False, True])}, ErrorCode.AxisAmpAlarm, "elbow: following error"),
        ({"position_mode": np.array([True, False])}, CoreMotionErrorCode.NotPosMode, "elbow: is not in position mode"),
        ({"foreign_motion": np.array([True, False])}, ErrorCode.NotIdleState, "shoulder: is being moved"),
        ({"refusal": Fault(94222, "too close")}, 94222, "too close"),
    ],
)
def test_an_arm_that_cannot_move_aborts_before_the_start(change: dict[str, object], code: int, words: str) -> None:
    arm = FakeArm()
    for name, value in change.items():
        setattr(arm, name, value)
    result = Run(arm=arm).result
    assert result is not None
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, code)
    assert words in result.text
    assert len(arm.splines) == 0


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"servo_on": np.array([True, False])}, ErrorCode.ServoOff, "elbow: the servo is off, 0.7"),
        ({"alarm_code": np.array([0x7500, 0])}, ErrorCode.AxisAmpAlarm, "shoulder: amplifier alarm 0x7500, 0.7"),
        ({"following_error": np.array([True, False])}, ErrorCode.AxisAmpAlarm, "shoulder: following error alarm"),
        ({"emergency_stop": True}, CoreMotionErrorCode.EmergencyStopSignalOn, "emergency stop"),
    ],
)
def test_a_fault_in_motion_stops_the_others_and_aborts(change: dict[str, object], code: int, words: str) -> None:
    run = Run()
    run.to(0.7)
    for name, value in change.items():
        setattr(run.arm, name, value)
    run.tick()
    assert run.arm.calls == ["start", "quick_stop"]
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, code)
    assert words in result.text
    assert "stood" in result.text
    assert run.arm.state().idle.all()


@pytest.mark.parametrize(
    ("blind", "code"), [(None, ErrorCode.CommNotStarted), (GONE, GONE.fault.code)], ids=["bus lost", "engine gone"]
)
def test_a_lost_bus_or_engine_ends_the_goal_at_once(blind: Blind | None, code: int) -> None:
    run = Run()
    run.to(0.7)
    run.arm.communicating, run.blind = False, blind
    run.tick()
    assert run.result is not None
    assert (run.result.outcome, run.result.code) == (GoalStatus.ABORTED, code)


def test_missing_status_is_tolerated_until_timeout_then_stops_motion() -> None:
    run = Run()
    run.to(0.7)
    run.blind = SILENT
    run.to(0.7 + SETTINGS.watch.status_timeout_s - TICK_S)
    run.blind = None
    run.to(1.2)
    run.blind = SILENT
    assert run.to_end() == aborted(SILENT.fault)
    assert run.now_s == pytest.approx(1.2 + SETTINGS.watch.status_timeout_s, abs=3 * TICK_S)
    assert run.arm.calls == ["start", "quick_stop"]


def test_no_engine_at_the_start() -> None:
    execution = Execution(THERE, FakeArm(), SETTINGS, 0.0)
    assert execution.tick(0.0, GONE) == aborted(GONE.fault)
    late = Execution(goal((1.0, (1.0, 0.0)), start_in_s=1.0), FakeArm(), SETTINGS, 0.0)
    assert late.tick(0.5, GONE) is None
    assert late.tick(1.0, GONE) == aborted(GONE.fault)


@pytest.mark.parametrize("cut_at_s", [0.03, 0.6])
@pytest.mark.parametrize(
    ("reason", "code", "words"),
    [
        (0, ErrorCode.NoMotion, "stopped by another client before the end: shoulder, elbow"),
        (ErrorCode.AxisSoftLimit, ErrorCode.AxisSoftLimit, "elbow: stopped by the engine, AxisSoftLimit"),
    ],
)
def test_a_motion_cut_short_is_aborted_at_once(reason: int, code: int, words: str, cut_at_s: float) -> None:
    run = Run()
    run.arm.cut_at_s = cut_at_s
    run.arm.end_reason[1] = reason
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, code)
    assert words in result.text
    assert run.now_s == pytest.approx(cut_at_s, abs=0.02)


def test_a_motion_that_never_begins() -> None:
    """The status still shows the completion of the previous motion, which must not count as success."""
    arm = FakeArm()
    arm.start_takes_s = 100.0
    run = Run(arm=arm)
    arm.complete[:] = True
    run.to(2.9)
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, CoreMotionErrorCode.WaitTimeout)
    arm = FakeArm()
    arm.start_takes_s = 100.0
    run = Run(arm=arm)
    assert run.to_end().code == ErrorCode.NoMotion
    assert run.now_s == pytest.approx(SETTINGS.watch.start_timeout_s, abs=0.02)


def test_a_motion_that_does_not_end_is_stopped() -> None:
    run = Run()
    run.arm.hangs = True
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, CoreMotionErrorCode.WaitTimeout)
    assert run.now_s == pytest.approx(2.0 + SETTINGS.watch.end_timeout_s + 0.1, abs=0.02)
    assert run.arm.calls == ["start", "stop"]


def test_an_engine_that_is_held_up_is_not_late() -> None:
    run = Run()
    for _ in range(round(8.0 / TICK_S)):  # a quarter of real time
        run.now_s += TICK_S
        run.arm.advance(0.25 * TICK_S)
        run.result = run.execution.tick(run.now_s, run.arm.state())
    run.arm.advance(TICK_S)
    run.tick()
    assert run.result is not None
    assert run.result.outcome is GoalStatus.SUCCEEDED


def test_frozen_engine_clock_aborts_with_timeout() -> None:
    run = Run()
    run.to(0.5)
    held = run.arm.state()
    while run.result is None:
        run.now_s += TICK_S
        assert run.now_s < 100.0
        run.result = run.execution.tick(run.now_s, held)
    assert (run.result.outcome, run.result.code) == (GoalStatus.ABORTED, CoreMotionErrorCode.WaitTimeout)
    assert run.arm.calls == ["start", "stop", "quick_stop"]
    assert "STOP FAILED" in run.result.text


def test_path_tolerance_stops_and_aborts() -> None:
    requested = goal((1.0, (0.4, 0.2)), path=Tolerances(np.array([np.inf, 0.05]), np.full(2, np.inf)))
    run = Run(requested)
    run.arm.offset[:] = (9.0, 0.049)
    run.to(0.5)
    run.arm.offset[1] = -0.06
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, GoalCode.PATH_TOLERANCE_VIOLATED)
    assert "elbow: position error +0.06" in result.text
    assert run.arm.calls == ["start", "stop"]
    assert run.now_s == pytest.approx(0.6, abs=0.02)


def test_goal_tolerance_is_waited_for() -> None:
    requested = goal((1.0, (0.4, 0.2)), at_goal=Tolerances(np.full(2, 0.01), np.full(2, np.inf)), goal_time_s=0.5)
    run = Run(requested)
    run.arm.offset[0] = 0.02
    run.to(1.4)
    assert run.execution.phase is Phase.SETTLING
    run.arm.offset[0] = 0.009
    assert run.to_end().outcome is GoalStatus.SUCCEEDED
    run = Run(requested)
    run.arm.offset[0] = -0.02
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, GoalCode.GOAL_TOLERANCE_VIOLATED)
    assert "0.5 s after the end: shoulder: position error +0.02000 rad, tolerance 0.01" in result.text
    assert run.now_s == pytest.approx(1.5, abs=0.02)


def test_fault_while_settling_aborts_goal() -> None:
    run = Run(goal((1.0, (0.4, 0.2)), at_goal=Tolerances(np.full(2, 0.01), np.full(2, np.inf))))
    run.arm.offset[0] = 0.02
    run.to(1.2)
    assert run.execution.phase is Phase.SETTLING
    run.arm.offset[0] = 0.0
    run.arm.servo_on[0] = False
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, ErrorCode.ServoOff)


def test_cancel_ends_when_the_axes_stand() -> None:
    run = Run()
    run.to(0.7)
    run.stop(canceled("canceled"))
    run.tick()
    assert run.result is None
    result = run.to_end()
    assert (result.outcome, result.code, result.text) == (GoalStatus.CANCELED, 0, "canceled; stood 100 ms later")
    assert run.arm.calls == ["start", "stop"]
    assert run.now_s == pytest.approx(0.8, abs=0.02)


def test_a_joint_that_swings_back_does_not_stand_yet() -> None:
    run = Run(settings_=replace(SETTINGS, watch=SETTINGS.watch.model_copy(update={"standstill_s": 0.02})))
    run.to(0.7)
    run.stop(canceled("canceled"))
    run.to(0.805)
    run.arm.swing_radps = 0.05
    run.to(0.9)
    run.arm.swing_radps = 0.0
    result = run.to_end()
    assert result.text == "canceled; stood 205 ms later"
    assert run.now_s == pytest.approx(0.925, abs=0.011)


def test_cancel_while_waiting_and_while_settling() -> None:
    waiting = Run(goal((1.0, (1.0, 0.0)), start_in_s=9.0))
    waiting.stop(canceled("canceled"))
    assert waiting.to_end().outcome is GoalStatus.CANCELED
    assert waiting.arm.calls == []
    settling = Run(goal((1.0, (0.4, 0.2)), at_goal=Tolerances(np.full(2, 0.01), np.full(2, np.inf))))
    settling.arm.offset[0] = 0.02
    settling.to(1.2)
    settling.stop(canceled("canceled"))
    assert settling.to_end().outcome is GoalStatus.CANCELED


def test_a_stop_without_effect_a_refused_one_and_an_emergency_become_a_quick_stop() -> None:
    run = Run()
    run.arm.stop_refusal = Fault(ErrorCode.APIChannelTimeOut, "stop: no answer")
    run.to(0.7)
    run.stop(canceled("canceled"))
    assert run.arm.calls == ["start", "stop", "quick_stop"]
    assert run.to_end().outcome is GoalStatus.CANCELED
    run = Run()
    run.to(0.7)
    run.stop(canceled("canceled"))
    run.tick()
    run.stop(aborted(Fault(65632, "emergency stop")), quick=True)
    assert run.arm.calls == ["start", "stop", "quick_stop"]
    assert run.to_end() == aborted(Fault(65632, run.to_end().text))
    assert run.now_s < 0.74
    run = Run()
    run.arm.stop_takes_s = None
    run.to(0.7)
    run.stop(canceled("canceled"))
    run.stop(aborted(Fault(-1, "preempted")))
    result = run.to_end()
    assert result.outcome is GoalStatus.CANCELED, "the first ending counts"
    assert run.arm.calls == ["start", "stop", "quick_stop"]
    own_s = run.execution._spline.longest_stop_s()
    assert run.now_s == pytest.approx(0.7 + own_s + SETTINGS.watch.stop_timeout_s + 0.02, abs=0.02)


def test_a_gentle_trajectory_is_stopped_gently() -> None:
    """The trajectory's own maximum acceleration stops it slowly, without a quick stop."""
    run = Run(goal((0.0, (0.0, 0.0)), (20.0, (1.0, 0.0))))
    own_s = run.execution._spline.longest_stop_s()
    assert own_s == pytest.approx(2.0 * 0.25 * 20.0)  # 1.5 / 20 rad/s at 6 / 20^2 rad/s2, doubled
    run.arm.stop_takes_s = 5.0
    run.to(3.0)
    run.stop(canceled("canceled"))
    assert run.to_end().outcome is GoalStatus.CANCELED
    assert run.arm.calls == ["start", "stop"]


def test_a_failed_stop_is_reported_and_not_called_canceled() -> None:
    run = Run(goal((0.0, (0.0, 0.0)), (8.0, (1.0, 0.0))))
    run.arm.stop_takes_s = run.arm.quick_stop_takes_s = None
    run.to(0.7)
    run.stop(canceled("canceled"))
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, CoreMotionErrorCode.WaitTimeout)
    assert "STOP FAILED: shoulder moves at" in result.text
    assert run.now_s == pytest.approx(0.7 + 2.0 * 0.25 * 8.0 + 0.5 + 0.3, abs=0.03)


def test_an_alarm_while_stopping_is_not_called_canceled() -> None:
    run = Run()
    run.to(0.7)
    run.stop(canceled("canceled"))
    run.arm.alarm_code[0] = 0x10
    result = run.to_end()
    assert (result.outcome, result.code) == (GoalStatus.ABORTED, ErrorCode.AxisAmpAlarm)
    assert "canceled; while stopping: shoulder: amplifier alarm 0x0010" in result.text


EVENTS = st.sampled_from(
    [
        "cancel",
        "preempt",
        "emergency",
        "alarm",
        "servo",
        "bus",
        "silent",
        "gone",
        "cut",
        "drift",
        "deaf",
        "recover",
        "-",
    ]
)


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 120), EVENTS), max_size=8))
def test_whatever_happens_a_goal_ends_in_time_and_ends_once(story: list[tuple[int, str]]) -> None:
    run = Run(goal((1.0, (0.4, 0.2)), path=Tolerances(np.full(2, 0.1), np.full(2, np.inf))))
    results = []
    for ticks, event in story:
        for _ in range(ticks):
            run.tick()
            results += [run.result] if run.result is not None else []
        _happen(run, event)
    for _ in range(round(6.0 / TICK_S)):
        run.tick()
        results += [run.result] if run.result is not None else []
    assert results, "the goal never ended"
    assert all(result == results[0] for result in results)
    if results[0].outcome is GoalStatus.SUCCEEDED:
        assert run.arm.command == pytest.approx([0.4, 0.2])
    if results[0].outcome is not GoalStatus.ABORTED:
        assert results[0].code == 0
    else:
        assert results[0].code != 0
        assert results[0].text


def _happen(run: Run, event: str) -> None:
    arm = run.arm
    if event == "cancel":
        run.stop(canceled("canceled"))
    elif event == "preempt":
        run.stop(aborted(Fault(-1, "preempted")))
    elif event == "emergency":
        run.stop(aborted(Fault(65632, "emergency stop")), quick=True)
    elif event == "alarm":
        arm.alarm_code[1] = 7
    elif event == "servo":
        arm.servo_on[0] = False
    elif event == "bus":
        arm.communicating = False
    elif event in ("silent", "gone"):
        run.blind = SILENT if event == "silent" else GONE
    elif event == "cut":
        arm.cut_at_s = 0.0
    elif event == "drift":
        arm.offset[0] = 0.2
    elif event == "deaf":
        arm.stop_takes_s = arm.quick_stop_takes_s = None
    elif event == "recover":
        run.blind = None
        arm.communicating = True
        arm.servo_on[:] = True
        arm.alarm_code[:] = 0
