"""Dockings and undockings: the normal sequence, and every disturbance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.contract.states import DockingState
from robot_stack.core.docks import Place
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.goals import GoalStatus, NavigationEnded
from robot_stack.docking.controller import DockingController
from robot_stack.docking.latch import LatchCommand
from robot_stack.docking.results import DockCode, UndockCode
from robot_stack.docking.situation import Safety
from tests.unit.docking.bench import CAMERAS, TICK_S, Bench, Faults, emergency, params, stopped

SEEING = (DockingState.SEARCH, DockingState.SERVOING, DockingState.FINE_ALIGN)


def began(bench: Bench) -> Bench:
    assert bench.begin() is None
    return bench


def begun_far() -> Bench:
    """A docking in APPROACH, while navigation still drives."""
    bench = Bench()
    bench.at_staging = False
    return began(bench)


def stands(bench: Bench) -> bool:
    """The last commands are all zero."""
    return all(abs(value) < 1e-12 for twist in bench.commands for value in (twist.vx, twist.vy, twist.omega))


def drive_by_hand(bench: Bench, ticks: int) -> None:
    """Drives 1 cm forward each tick."""
    for _ in range(ticks):
        bench.commands[0] = Twist2(0.01 / TICK_S, 0.0, 0.0)
        bench.step()


def board(bench: Bench) -> tuple[float, float]:
    """The dock's (distance, bearing) from the robot."""
    seen = bench.dock_in_odom.relative_to(bench.base)
    return math.hypot(seen.x, seen.y), math.atan2(seen.y, seen.x)


@pytest.mark.parametrize("name", ["chair_1", "charger"])
def test_a_docking_passes_its_states_in_order(name: str) -> None:
    approach_sign = 1.0 if name == "chair_1" else -1.0
    bench = began(Bench(name, start=Pose2(-approach_sign * 1.5, 0.5, 0.35), noise_m=0.0002))
    start_s = bench.now_s
    result = bench.run_to_end()
    assert bench.now_s - start_s < (30.0 if name == "chair_1" else 40.0)
    assert result.success
    assert result.tries == 1
    assert bench.states[1:] == [*SEEING, DockingState.DOCKED]
    assert math.hypot(bench.error.x, bench.error.y) < 0.002
    assert abs(bench.error.yaw) < math.radians(0.3)
    assert bench.outputs[-1].attached is (name == "chair_1")
    assert [found.dockings for found in bench.controller.corrections.values()] == [1] * (name == "chair_1")


@settings(max_examples=5, deadline=None)
@given(
    x=st.floats(-2.0, -1.0),
    y=st.floats(-0.5, 0.5),
    yaw=st.floats(-0.35, 0.35),
    noise_m=st.floats(0.0, 0.0005),
    dock_yaw=st.floats(-3.1, 3.1),
)
def test_from_anywhere_around_staging_it_docks_smoothly(
    x: float, y: float, yaw: float, noise_m: float, dock_yaw: float
) -> None:
    bench = began(Bench(start=Pose2(x, y, yaw), noise_m=noise_m, dock_in_odom=Pose2(1.0, 2.0, dock_yaw)))
    assert bench.run_to_end().success
    twists = [output.twist for output in bench.outputs if output.twist is not None]
    motion = params().motion
    fastest = math.hypot(motion.along_mps, motion.across_mps) + motion.max_correction_mps
    assert max(twist.speed() for twist in twists) <= fastest + 1e-9
    near = [o for o in bench.outputs if o.twist is not None and o.state is DockingState.FINE_ALIGN]
    assert max(o.twist.speed() for o in near if o.twist) <= motion.final_mps + motion.max_correction_mps + 1e-9
    assert all(twist.is_finite() for twist in twists)


def test_no_motion_is_commanded_without_a_job() -> None:
    bench = Bench()
    bench.run(lambda: False, 2.0)
    assert all(output.twist is None for output in bench.outputs)
    bench.docked()
    count = len(bench.outputs)
    bench.run(lambda: False, 5.0)
    assert all(output.twist is None for output in bench.outputs[count:])


def test_approach_only_ends_at_staging() -> None:
    bench = begun_far()
    bench.controller.cancel()
    with_alternative(bench)
    assert bench.controller.dock("chair_1", bench.dock, approach_only=True) is None
    bench.run(lambda: False, 1.0)
    assert bench.goals[-1].pose == bench.dock.staging.pose()
    count = len(bench.goals)
    gives_up(bench)
    assert len(bench.goals) == count, "the other staging pose is not used"
    bench.run(lambda: len(bench.goals) > count, 5.0)  # navigation is asked again
    bench.at_staging = True
    assert bench.run_to_end().success
    assert bench.state is DockingState.IDLE
    assert bench.outputs[-1].cancel_goal
    assert {goal.pose for goal in bench.goals} == {bench.dock.staging.pose()}


@pytest.mark.parametrize(
    ("status", "pause_s"),
    [
        (GoalStatus.ABORTED, 2.0),
        (GoalStatus.SUCCEEDED, 2.0),  # reached, but not by the pose that docking has
        (GoalStatus.UNKNOWN, 0.05),  # navigation has restarted
    ],
)
def test_a_goal_that_ends_before_staging_is_sent_again_after_a_pause(status: GoalStatus, pause_s: float) -> None:
    bench = begun_far()
    bench.run(lambda: False, 5.0)
    assert len(bench.goals) == 1
    bench.end_goal(status)
    ended_s = bench.now_s
    assert bench.run(lambda: len(bench.goals) == 2, 3.0)
    assert bench.now_s - ended_s == pytest.approx(pause_s, abs=0.051)
    assert bench.goals[1].call > bench.goals[0].call
    bench.controller.on_navigation(NavigationEnded(bench.goals[0].call, GoalStatus.ABORTED))  # late, and repeated
    bench.run(lambda: False, 5.0)
    assert len(bench.goals) == 2


def test_the_goal_waits_for_navigation_and_not_at_staging() -> None:
    bench = Bench(faults=Faults(no_navigation=True))
    bench.at_staging = False
    began(bench).run(lambda: False, 5.0)
    assert bench.goals == []
    assert bench.outputs[-1].text == "waiting for navigation_controller"
    bench.faults.no_navigation = False
    bench.step()
    assert len(bench.goals) == 1
    assert began(Bench(faults=Faults(no_navigation=True))).run_to_end().success


@pytest.mark.parametrize("end", ["cancelled", "failed", "staged"])
def test_a_goal_is_cancelled_with_the_docking_until_it_has_ended(end: str) -> None:
    bench = begun_far()
    bench.run(lambda: False, 1.0)
    assert not any(output.cancel_goal for output in bench.outputs)
    if end == "cancelled":
        bench.controller.cancel()
    elif end == "failed":
        bench.safety = emergency()
    else:
        bench.at_staging = True
    bench.step()
    assert bench.outputs[-1].cancel_goal
    bench.run(lambda: False, 3.0)
    assert sum(output.cancel_goal for output in bench.outputs) == 2  # after 0 s and 2 s
    bench.end_goal(GoalStatus.CANCELED)
    bench.run(lambda: False, 5.0)
    assert sum(output.cancel_goal for output in bench.outputs) == 2


def test_undocking_backs_off_straight_and_then_detaches() -> None:
    bench = Bench(noise_m=0.0002).docked()
    before = bench.base
    assert bench.controller.undock(bench.situation()) is None
    result = bench.run_to_end()
    assert result.success
    assert result.distance_m == pytest.approx(0.5, abs=0.02)
    moved = bench.base.relative_to(before)
    assert (moved.x, moved.y, moved.yaw) == pytest.approx((-0.5, 0.0, 0.0), abs=0.02)
    assert bench.outputs[-1].attached is False
    attached = [output.attached for output in bench.outputs]
    assert attached[-2] is True  # the passenger counts until the robot is clear of the dock
    assert bench.state is DockingState.IDLE


def test_a_charger_that_does_not_charge_is_left_and_tried_again() -> None:
    bench = Bench("charger", start=Pose2(1.5, 0.0, 0.0))
    bench.faults.no_charge = True
    began(bench)
    bench.run(lambda: bench.state is DockingState.DOCKED, 60.0)
    assert bench.state is DockingState.DOCKED
    begun_s = bench.now_s
    bench.run(lambda: bench.state is not DockingState.DOCKED, 60.0)
    assert bench.now_s - begun_s == pytest.approx(params().latch.charge_timeout_s, abs=0.1)
    bench.faults.no_charge = False
    result = bench.run_to_end()
    assert result.success
    assert result.tries == 2


@pytest.mark.parametrize("faults", [Faults(no_charge=True), Faults(charge_for_s=1.5)], ids=["never", "in bursts"])
def test_a_charger_that_does_not_charge_is_a_failure_with_its_own_code(faults: Faults) -> None:
    bench = began(Bench("charger", start=Pose2(1.5, 0.0, 0.0), faults=faults))
    result = bench.run_to_end()
    assert (result.code, result.tries) == (DockCode.NOT_CHARGING, params().tries)
    assert "not charged within 10 s" in result.reason
    assert bench.state is DockingState.FAILED
    assert {output.latch for output in bench.outputs} <= {LatchCommand.HOLD, LatchCommand.OPEN}


@pytest.mark.parametrize("contact", [True, False])
@pytest.mark.parametrize("end", ["cancelled", "failed"])
def test_an_interrupted_docking_with_a_closed_charging_contact_counts_as_docked(end: str, contact: bool) -> None:
    bench = began(Bench("charger", start=Pose2(1.5, 0.0, 0.0), faults=Faults(no_charge=not contact)))
    bench.reach(DockingState.DOCKED)
    if end == "cancelled":
        assert bench.controller.cancel() is not None
    else:
        bench.safety = emergency()
        assert bench.run_to_end(1.0).code is DockCode.SAFETY_STOP
        bench.safety = Safety(known=True)
    bench.step()
    if not contact:
        assert (bench.state is not DockingState.DOCKED, bench.controller.station) == (True, "")
        return
    assert (bench.state, bench.controller.station) == (DockingState.DOCKED, "charger")
    opened = bench.faults.no_charge = end == "failed"  # meanwhile
    place = bench.base
    assert bench.begin() is None
    if opened:
        bench.reach(DockingState.APPROACH, 11.0)
        bench.faults.no_charge = False
    result = bench.run_to_end()
    assert (result.success, result.tries) == (True, 1 + opened)
    assert bench.base.distance_to(place) < (0.01 if opened else 0.001)


def test_a_latch_found_closed_means_a_passenger() -> None:
    bench = Bench()
    bench.latch_position = 8
    bench.step()
    assert bench.state is DockingState.DOCKED
    assert bench.outputs[-1].attached is True
    assert bench.controller.undock(bench.situation()) is None
    assert bench.run_to_end().success


def test_a_wheelchair_latched_after_a_job_at_the_charger_is_left_backwards() -> None:
    bench = began(Bench("charger", start=Pose2(1.5, 0.0, 0.0)))
    bench.controller.cancel()
    bench.latch_position = 8
    bench.step()
    docked = bench.base
    assert bench.controller.undock(bench.situation()) is None
    assert bench.run_to_end().success
    assert bench.base.relative_to(docked).x == pytest.approx(-0.5, abs=0.02)


@pytest.mark.parametrize("restarted", [False, True])
def test_a_wheelchair_latched_at_the_charger_is_undocked_only_after_driving_clear_by_hand(restarted: bool) -> None:
    bench = Bench("charger", start=Pose2(1.5, 0.0, 0.0)).docked()
    bench.latch_position = 8
    bench.step()
    if restarted:
        bench.controller = DockingController(params(), CAMERAS, bench.departure)
        bench.controller.recall(True)
        bench.controller.recall_station("charger", bench.dock)
        bench.step()
    for ticks in (1, 40):
        drive_by_hand(bench, ticks)
        refused = bench.controller.undock(bench.situation())
        assert refused is not None
        assert refused.code is UndockCode.BLOCKED
        assert "by hand" in refused.reason
    assert (bench.state, bench.outputs[-1].attached) == (DockingState.DOCKED, True)
    assert bench.outputs[-1].twist == ZERO_TWIST, "no navigation moves it meanwhile"
    drive_by_hand(bench, 10)
    assert bench.outputs[-1].twist is None
    bench.run(lambda: False, 0.1)
    left = bench.base
    assert bench.controller.undock(bench.situation()) is None
    assert bench.run_to_end().success
    assert bench.base.relative_to(left).x == pytest.approx(-0.5, abs=0.02)


def test_a_robot_driven_off_the_charger_by_hand_is_not_docked() -> None:
    bench = Bench("charger", start=Pose2(1.5, 0.0, 0.0)).docked()
    drive_by_hand(bench, 49)
    assert (bench.state, bench.controller.station) == (DockingState.DOCKED, "charger")
    assert bench.outputs[-1].twist == ZERO_TWIST
    drive_by_hand(bench, 2)
    assert (bench.state, bench.controller.station) == (DockingState.IDLE, "")
    assert bench.outputs[-1].twist is None
    bench.run(lambda: False, 0.1)
    refused = bench.controller.undock(bench.situation())
    assert refused is not None
    assert refused.code is UndockCode.NOT_ATTACHED


def test_jobs_that_cannot_be_are_refused() -> None:
    docking, attached = began(Bench()), Bench().docked()
    at_station = Bench("charger", start=Pose2(1.5, 0.0, 0.0)).docked()
    idle = Bench()
    refused = [
        (docking.begin(), DockCode.BUSY),
        (docking.controller.undock(docking.situation()), UndockCode.BUSY),
        (attached.begin(), DockCode.ALREADY_ATTACHED),
        (at_station.controller.dock("chair_1", idle.dock), DockCode.ALREADY_ATTACHED),
        (Bench(faults=Faults(latch_dead=True)).begin(), DockCode.LATCH_FAILED),
        (idle.controller.undock(idle.situation()), UndockCode.NOT_ATTACHED),
    ]
    assert [result and result.code for result, _ in refused] == [code for _, code in refused]


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"twist": None}, UndockCode.ROBOT_MOVING),
        ({"safety": Safety(known=True, faults=("SLOPE",))}, UndockCode.SLOPE_TOO_STEEP),
        ({"safety": emergency()}, UndockCode.SAFETY_STOP),
        ({"safety": Safety()}, UndockCode.SAFETY_STOP),
    ],
)
def test_undocking_is_refused(change: dict[str, object], code: UndockCode) -> None:
    bench = Bench().docked()
    result = bench.controller.undock(replace(bench.situation(), **change))  # type: ignore[arg-type]
    assert result is not None
    assert result.code is code
    assert bench.outputs[-1].latch is LatchCommand.HOLD


@pytest.mark.parametrize("state", [DockingState.APPROACH, *SEEING, DockingState.DOCKED])
def test_a_cancel_and_an_emergency_stop_end_a_docking_in_every_state(state: DockingState) -> None:
    bench, cancelled = (begun_far() if state is DockingState.APPROACH else began(Bench()) for _ in range(2))
    cancelled.reach(state)
    result = cancelled.controller.cancel()
    assert result is not None
    assert result.code is DockCode.CANCELED
    cancelled.run(lambda: False, 1.0)
    assert (cancelled.state, stands(cancelled)) == (DockingState.IDLE, True)
    assert cancelled.controller.cancel() is None
    bench.reach(state)
    bench.safety = emergency()
    result = bench.run_to_end(1.0)
    assert result.code is DockCode.SAFETY_STOP
    bench.run(lambda: False, 1.0)
    assert (bench.state, stands(bench)) == (DockingState.FAILED, True)
    assert bench.outputs[-1].text == "emergency stop"
    assert bench.outputs[-1].latch is LatchCommand.HOLD


@pytest.mark.parametrize("phase", ["opening", "backing off"])
def test_an_emergency_stop_ends_an_undocking_with_the_passenger_still_counted(phase: str) -> None:
    bench = Bench().docked()
    bench.controller.undock(bench.situation())
    assert bench.run(lambda: phase in bench.outputs[-1].text)
    bench.safety = emergency()
    assert bench.run_to_end(1.0).code is UndockCode.SAFETY_STOP
    bench.run(lambda: False, 1.0)
    assert stands(bench)
    assert bench.outputs[-1].attached is True
    assert not any(output.emergency for output in bench.outputs)
    bench.safety = Safety(known=True)
    bench.step()
    assert bench.controller.undock(bench.situation()) is None  # an interrupted undocking can be finished
    assert bench.run_to_end().success


@pytest.mark.parametrize("state", SEEING)
def test_a_dead_camera_ends_a_docking(state: DockingState) -> None:
    """In SERVOING the safety monitor reports it."""
    bench = Bench()
    if state is DockingState.SEARCH:
        bench.faults.blind = True
    began(bench)
    bench.reach(state)
    if state is DockingState.SERVOING:
        bench.safety = Safety(known=True, faults=("CAMERA_TIMEOUT",))
    bench.faults.camera_dead = state is not DockingState.SERVOING
    assert bench.run_to_end(2.0).code is DockCode.CAMERA_TIMEOUT
    assert bench.state is DockingState.FAILED
    bench.run(lambda: False, 1.0)
    assert stands(bench)


@pytest.mark.parametrize("state", [DockingState.SERVOING, DockingState.FINE_ALIGN])
def test_markers_out_of_sight_for_a_second_only_make_it_wait(state: DockingState) -> None:
    bench = began(Bench())
    bench.reach(state)
    bench.faults.blind = True
    bench.run(lambda: False, 1.0)
    assert bench.outputs[-1].text == "markers out of sight"
    assert stands(bench)
    bench.faults.blind = False
    assert bench.run_to_end().success
    assert bench.outputs[-1].tries == 1


def test_markers_lost_for_long_are_searched_for_away_from_the_dock() -> None:
    bench = began(Bench())
    bench.reach(DockingState.FINE_ALIGN)
    bench.faults.blind = True
    bench.reach(DockingState.SEARCH, 6.0)
    turned = bench.run(lambda: abs(bench.commands[-1].omega) > 0.3, 20.0)
    assert turned
    assert -bench.error.x >= params().search.clear_m - 0.05  # turning beside the dock would cause a collision
    bench.faults.blind = False
    assert bench.run_to_end().success


def test_markers_that_are_nowhere_end_after_three_searches_of_one_turn() -> None:
    bench = Bench()
    bench.faults.blind = True
    began(bench)
    result = bench.run_to_end()
    assert result.code is DockCode.MARKERS_NOT_FOUND
    assert result.tries == 3
    turned = sum(abs(output.twist.omega) * 0.05 for output in bench.outputs if output.twist)
    assert turned <= 3 * (2.0 * math.pi + 0.15)  # the measured rate lags by two ticks, the end by one more
    bench.run(lambda: False, 0.5)
    assert stands(bench)


def test_a_dock_that_is_moved_is_docked_to_in_another_try() -> None:
    bench = began(Bench())
    bench.reach(DockingState.FINE_ALIGN)
    bench.dock_in_odom = bench.dock_in_odom.compose(Pose2(0.0, 0.2, 0.0))
    assert bench.run(lambda: "moved" in bench.outputs[-1].text, 3.0)
    result = bench.run_to_end()
    assert result.success
    assert result.tries == 2
    assert math.hypot(bench.error.x, bench.error.y) < 0.002


def test_a_dock_that_keeps_moving_is_given_up() -> None:
    bench = began(Bench())

    def shift() -> bool:
        if bench.state is DockingState.FINE_ALIGN and bench.outputs[-2].state is not DockingState.FINE_ALIGN:
            bench.dock_in_odom = bench.dock_in_odom.compose(Pose2(0.0, 0.2, 0.0))
        return bool(bench.results)

    assert bench.run(shift, 300.0)
    assert bench.results[-1].code is DockCode.DOCK_MOVED
    assert bench.state is DockingState.FAILED


def test_a_sighting_that_jumps_once_is_refused() -> None:
    bench = began(Bench())
    bench.reach(DockingState.SERVOING)
    bench.run(lambda: False, 2.0)
    truth = bench.dock_in_odom
    bench.dock_in_odom = truth.compose(Pose2(0.3, 0.3, 0.0))
    bench.step()
    bench.step()
    bench.dock_in_odom = truth
    result = bench.run_to_end()
    assert result.success
    assert result.tries == 1


def test_a_latch_that_does_not_confirm_is_opened_again_and_given_up_after_three_tries() -> None:
    bench = Bench()
    bench.faults.no_confirm = True
    began(bench)
    result = bench.run_to_end()
    assert result.code is DockCode.LATCH_FAILED
    assert result.tries == 3
    assert "closed=0" in result.reason
    assert bench.state is DockingState.FAILED
    assert bench.outputs[-1].attached is False
    assert bench.latch_position == 0
    bench.run(lambda: False, 0.5)
    assert stands(bench)


def test_a_latch_that_neither_closes_nor_opens_ends_at_once_because_it_may_hold() -> None:
    bench = began(Bench())
    bench.reach(DockingState.DOCKED)
    assert bench.run(lambda: bench.latch_position == 4)
    bench.faults.latch_stuck = True
    result = bench.run_to_end()
    assert result.code is DockCode.LATCH_FAILED
    assert result.tries == 1
    assert "did not open" in result.reason
    assert bench.outputs[-1].attached is True


@pytest.mark.parametrize("end", ["cancelled", "emergency stop", "restart"])
def test_a_latch_that_was_closing_holds_until_it_is_undocked(end: str) -> None:
    bench = began(Bench())
    bench.reach(DockingState.DOCKED)
    assert bench.run(lambda: bench.latch_position == 4)
    assert bench.controller.attached is False, "LATCH_NOT_CLOSED would stop the docking"
    if end == "cancelled":
        bench.controller.cancel()
    elif end == "emergency stop":
        bench.safety = emergency()
    else:
        bench.controller = DockingController(params(), CAMERAS, bench.departure)
    bench.step()
    assert bench.outputs[-1].attached is True
    bench.safety = Safety(known=True)
    refused = bench.begin()
    assert refused is not None
    assert refused.code is DockCode.ALREADY_ATTACHED
    docked = bench.base
    assert bench.controller.undock(bench.situation()) is None
    if end != "restart":  # which also forgets the board, by which an undocking is checked
        bench.faults.latch_stuck = True
        assert bench.run_to_end().code is UndockCode.UNLATCH_FAILED
        assert (bench.outputs[-1].attached, bench.base) == (True, docked)
        bench.faults.latch_stuck = False
        assert bench.controller.undock(bench.situation()) is None
    assert bench.run_to_end().success
    assert (bench.outputs[-1].attached, bench.latch_position) == (False, 0)
    assert bench.base.relative_to(docked).x == pytest.approx(-0.5, abs=0.02)


def half_closed() -> Bench:
    """A docking that begins with hooks that a person has moved."""
    bench = Bench()
    bench.at_staging = False
    bench.latch_position = 4
    return began(bench)


def test_hooks_that_are_not_open_are_opened_before_the_robot_moves() -> None:
    bench = half_closed()
    assert bench.run(lambda: bench.latch_position == 1, 1.0)
    assert (bench.goals, bench.outputs[-1].text) == ([], "opening the latch")
    assert bench.run(lambda: len(bench.goals) == 1, 0.2)
    bench.latch_position = 4  # on the way
    bench.step()
    assert bench.outputs[-1].twist == ZERO_TWIST, "docking overrides navigation"
    bench.at_staging = True
    assert bench.run_to_end().success


def test_hooks_that_cannot_be_opened_end_the_docking_before_the_robot_moves() -> None:
    bench = half_closed()
    bench.faults.latch_stuck = True
    result = bench.run_to_end(params().latch.confirm_timeout_s + 0.2)
    assert (result.code, result.tries, bench.goals) == (DockCode.LATCH_FAILED, 1, [])
    assert "did not open" in result.reason


def test_unexpected_latch_release_requests_one_emergency_stop() -> None:
    bench = Bench().docked()
    bench.latch_position = 3
    bench.run(lambda: False, 2.0)
    assert sum(output.emergency for output in bench.outputs) == 1
    assert bench.state is DockingState.FAILED
    assert bench.outputs[-1].attached is True
    assert "let go" in bench.outputs[-1].text


def test_latch_release_during_docking_fails_docking() -> None:
    bench = began(Bench())
    assert bench.run(lambda: "measuring the board again" in bench.outputs[-1].text)
    bench.latch_position = 3
    result = bench.run_to_end(1.0)
    assert result.code is DockCode.LATCH_FAILED
    assert sum(output.emergency for output in bench.outputs) == 1
    assert bench.state is DockingState.FAILED
    assert stands(bench)


def test_latch_release_during_restart_requests_emergency_stop_and_keeps_attached() -> None:
    bench = Bench()
    bench.outputs.clear()
    bench.controller = DockingController(params(), CAMERAS, bench.departure)
    bench.controller.recall(True)
    bench.run(lambda: False, 1.0)
    assert sum(output.emergency for output in bench.outputs) == 1
    assert bench.outputs[0].emergency
    assert all(output.attached is True for output in bench.outputs)
    assert bench.controller.attached is True
    assert bench.state is DockingState.FAILED
    assert bench.controller.undock(bench.situation()) is None  # undocking clears the fault
    assert bench.run_to_end().success
    assert bench.controller.attached is False


def test_an_undocking_that_is_cancelled_on_its_way_is_not_docked_and_can_be_finished() -> None:
    bench = Bench().docked()
    assert bench.controller.undock(bench.situation()) is None
    bench.reach(DockingState.SERVOING)
    bench.run(lambda: False, 1.0)
    result = bench.controller.cancel()
    assert result is not None
    assert result.code is UndockCode.CANCELED
    bench.run(lambda: False, 1.0)
    assert bench.state is DockingState.IDLE
    assert stands(bench)
    assert bench.outputs[-1].attached is True
    assert bench.controller.undock(bench.situation()) is None
    assert bench.run_to_end().success


@pytest.mark.parametrize(("end", "restarted"), [("cancelled", False), ("failed", True)])
def test_an_interrupted_undocking_from_a_charger_can_be_finished(end: str, restarted: bool) -> None:
    """Forwards and without a latch."""
    bench = Bench("charger", start=Pose2(1.5, 0.0, 0.0)).docked()
    docked = bench.base
    assert bench.controller.undock(bench.situation()) is None
    bench.reach(DockingState.SERVOING)
    bench.run(lambda: False, 1.0)
    if end == "cancelled":
        assert bench.controller.cancel() is not None
    else:
        bench.safety = emergency()
        assert bench.run_to_end(1.0).code is UndockCode.SAFETY_STOP
        bench.safety = Safety(known=True)
    bench.run(lambda: False, 1.0)
    assert (bench.state, stands(bench), bench.controller.station) == (DockingState.DOCKED, True, "charger")
    assert ("emergency stop" if end == "failed" else "cancelled") in bench.outputs[-1].text
    refused = bench.controller.dock("chair_1", Bench().dock)
    assert refused is not None
    assert refused.code is DockCode.ALREADY_ATTACHED
    if restarted:
        bench.controller = DockingController(params(), CAMERAS, bench.departure)
        bench.controller.recall_station("charger", bench.dock)
        bench.step()
        assert (bench.state, bench.outputs[-1].text) == (DockingState.DOCKED, "docked")
        assert bench.outputs[-1].attached is False
        docked = bench.base
    assert bench.controller.undock(bench.situation()) is None
    assert bench.run_to_end().success
    assert {output.latch for output in bench.outputs} == {LatchCommand.HOLD}
    assert bench.base.relative_to(docked).x >= 0.48
    assert (bench.state, bench.controller.station) == (DockingState.IDLE, "")
    assert bench.begin() is None


def test_an_engine_that_cannot_be_read_changes_nothing_about_the_passenger() -> None:
    bench = Bench().docked()
    bench.faults.latch_dead = True
    bench.run(lambda: False, 5.0)
    assert bench.outputs[-1].attached is True
    assert not any(output.emergency for output in bench.outputs)


def test_contact_ends_a_try() -> None:
    bench = began(Bench())
    bench.reach(DockingState.FINE_ALIGN)
    bench.run(lambda: -bench.error.x < 0.05)
    bench.faults.force_n = 60.0
    assert bench.run(lambda: "touched" in bench.outputs[-1].text, 2.0)
    bench.faults.force_n = 12.0
    result = bench.run_to_end()
    assert result.success
    assert result.tries == 2


def test_constant_slope_force_is_not_detected_as_contact() -> None:
    bench = Bench()
    bench.faults.force_n = 60.0  # 3 deg with 120 kg, during the whole approach
    assert began(bench).run_to_end().tries == 1


def test_a_robot_that_cannot_move_gives_up() -> None:
    bench = began(Bench())
    bench.reach(DockingState.SERVOING)
    bench.faults.stuck_wheels = True
    assert bench.run_to_end(600.0).code in (DockCode.NOT_CONVERGED, DockCode.STAGING_FAILED)


def test_a_safety_stop_makes_it_wait_and_go_on() -> None:
    bench = began(Bench())
    bench.reach(DockingState.SERVOING)
    bench.run(lambda: False, 2.0)
    bench.safety = stopped()
    bench.run(lambda: False, 4.0)
    assert stands(bench)
    assert bench.outputs[-1].text == "stopped by safety"
    bench.safety = Safety(known=True)
    assert bench.run_to_end().success


@pytest.mark.parametrize("safety", [stopped(), Safety()])
def test_a_safety_stop_that_lasts_ends_the_docking(safety: Safety) -> None:
    bench = began(Bench())
    bench.reach(DockingState.SERVOING)
    bench.safety = safety
    result = bench.run_to_end(params().safety_hold_s + 1.0)
    assert result.code is DockCode.SAFETY_STOP
    assert ("COLLISION_IMMINENT" in result.reason) is safety.known


def test_no_odometry_stops_the_robot_and_then_the_docking() -> None:
    bench = began(Bench())
    bench.reach(DockingState.SERVOING)
    bench.run(lambda: False, 2.0)
    bench.faults.odometry_dead = True
    bench.step()
    bench.step()
    assert stands(bench) or bench.commands[-1].speed() == 0.0
    assert bench.run_to_end(2.0).code is DockCode.LOCALIZATION_LOST
    far = begun_far()
    far.faults.located = False  # no pose on the way to staging
    assert far.run_to_end(10.0).code is DockCode.LOCALIZATION_LOST


def test_a_staging_pose_that_is_not_reached_ends_the_docking() -> None:
    bench = begun_far()
    bench.step()
    bench.run(lambda: False, params().staging.timeout_s - 1.0)
    bench.end_goal(GoalStatus.ABORTED, 208, "no path")
    assert bench.run(lambda: bench.outputs[-1].tries == 2, 2.0)
    assert bench.outputs[-1].text == "try 2: not at staging after 90 s; navigation: no path (error 208)"
    result = bench.run_to_end(400.0)
    assert result.code is DockCode.STAGING_FAILED
    assert result.tries == 3
    assert len(bench.goals) == 3


def with_alternative(bench: Bench) -> Bench:
    """The dock has another staging pose, 0.4 m beside the first."""
    other = bench.dock.staging.pose().compose(Pose2(-0.3, 0.4, -0.2))
    place = Place(x_m=other.x, y_m=other.y, yaw_rad=other.yaw)
    bench.dock = bench.dock.model_copy(update={"staging_alternatives": (place,)})
    return bench


def gives_up(bench: Bench) -> None:
    """Navigation, on the way to the newest goal."""
    bench.end_goal(GoalStatus.ABORTED, 208, "no path")
    bench.step()
    bench.step()


def test_another_staging_pose_is_used_if_navigation_gives_up_the_first() -> None:
    bench = with_alternative(Bench())
    bench.at_staging = False
    began(bench).step()
    gives_up(bench)
    first, other = (place.pose() for place in bench.dock.stagings)
    assert [goal.pose for goal in bench.goals] == [first, other]
    gives_up(bench)
    assert len(bench.goals) == 2, "the last one that is left is not given up at once"
    bench.at_staging = True
    result = bench.run_to_end()
    assert (result.success, result.tries) == (True, 1)


def test_the_next_try_begins_at_another_staging_pose() -> None:
    bench = began(with_alternative(Bench()))
    bench.faults.no_confirm = True
    assert bench.run(lambda: bool(bench.goals))
    assert bench.goals[-1].pose == bench.dock.stagings[1].pose()
    assert bench.outputs[-1].tries == 2
    assert bench.error.x == pytest.approx(-params().staging.distance_m, abs=0.02), "straight back first"
    bench.faults.no_confirm = False
    assert bench.run_to_end().success


def test_a_next_try_without_a_way_to_another_staging_pose_begins_at_the_first() -> None:
    bench = began(with_alternative(Bench()))
    bench.faults.no_confirm = True
    assert bench.run(lambda: bool(bench.goals))
    bench.faults.no_confirm = bench.at_staging = False
    gives_up(bench)
    assert bench.goals[-1].pose == bench.dock.staging.pose()
    bench.at_staging = True
    result = bench.run_to_end()
    assert (result.success, result.tries) == (True, 2)


def test_far_from_the_dock_bearing_and_range_are_enough() -> None:
    bench = Bench(start=Pose2(-3.0, 0.8, 0.3))
    bench.faults.quality = float(np.float32(0.2))  # the orientation is ambiguous
    bench.run(lambda: False, 0.5)
    began(bench)
    bench.reach(DockingState.SERVOING)
    assert bench.run(lambda: bench.outputs[-1].text == "approaching on bearing and range", 1.0)
    nearest_m = -bench.dock.dock_pose.x_m + params().servo.bearing_distance_m
    assert bench.run(lambda: board(bench)[0] < nearest_m + 0.1, params().servo.timeout_s)
    assert abs(board(bench)[1]) < 0.05  # the camera points at the dock
    assert board(bench)[0] > nearest_m - 0.05


def test_a_wheelchair_that_follows_stops_the_undocking() -> None:
    bench = Bench().docked()
    assert bench.controller.undock(bench.situation()) is None
    bench.reach(DockingState.SERVOING)
    beside = bench.dock_in_odom.relative_to(bench.base)

    def drag() -> bool:
        bench.dock_in_odom = bench.base.compose(beside)
        return bool(bench.results[1:])

    assert bench.run(drag, 20.0)
    assert bench.results[-1].code is UndockCode.UNLATCH_FAILED
    assert "follows" in bench.results[-1].reason
    assert bench.outputs[-1].attached is True
    bench.run(lambda: False, 0.5)
    assert stands(bench)


def test_a_latch_that_does_not_open_keeps_everything_as_it_is() -> None:
    bench = Bench().docked()
    bench.faults.latch_stuck = True
    before = bench.base
    assert bench.controller.undock(bench.situation()) is None
    assert bench.run_to_end().code is UndockCode.UNLATCH_FAILED
    assert bench.base == before
    assert bench.outputs[-1].attached is True
    assert bench.outputs[-1].latch is LatchCommand.HOLD


def test_undocking_with_stuck_wheels_returns_blocked() -> None:
    bench = Bench().docked()
    assert bench.controller.undock(bench.situation()) is None
    bench.reach(DockingState.SERVOING)
    bench.faults.stuck_wheels = True
    assert bench.run_to_end(20.0).code is UndockCode.BLOCKED


def test_time_that_stands_still_or_runs_back_moves_nothing() -> None:
    bench = began(Bench())
    bench.reach(DockingState.SERVOING)
    bench.run(lambda: False, 1.0)
    for now_s in (bench.now_s, bench.now_s - 50.0, math.nan):
        output = bench.controller.tick(replace(bench.situation(), now_s=now_s))
        assert output.twist is None or output.twist.is_finite()
