"""One goal at a time, and the newest one wins."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot_stack.core.goals import GoalStatus
from robot_stack.wmx.trajectory.arm import Blind
from robot_stack.wmx.trajectory.goal import CheckedGoal
from robot_stack.wmx.trajectory.goal_queue import GoalQueue
from robot_stack.wmx.trajectory.results import Fault, GoalCode, Result
from robot_stack.wmx.trajectory.settings import ExecutionSettings
from tests.unit.wmx.trajectory.fake_arm import SETTINGS, TICK_S, FakeArm, goal

FIRST = goal((0.0, (0.0, 0.0)), (2.0, (1.0, 0.0)))
SECOND = goal((0.0, (0.0, 0.0)), (1.0, (0.0, 1.0)))
EMERGENCY = Fault(65632, "emergency stop")


class Desk:
    def __init__(self, settings: ExecutionSettings = SETTINGS) -> None:
        self.arm = FakeArm()
        self.ended: dict[str, Result] = {}
        self.ended_at_s: dict[str, float] = {}
        self.now_s = 0.0
        self.queue: GoalQueue[str] = GoalQueue(self.arm, settings, self._end)

    def _end(self, key: str, result: Result) -> None:
        assert key not in self.ended, "ended twice"
        self.ended[key], self.ended_at_s[key] = result, self.now_s

    def submit(self, key: str, requested: CheckedGoal) -> None:
        self.queue.submit(key, requested, self.now_s, self.arm.state())

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            self.arm.advance()
            self.queue.tick(self.now_s, self.arm.state())


def test_a_newer_goal_stops_the_present_one_and_begins_from_rest() -> None:
    desk = Desk()
    desk.submit("a", FIRST)
    desk.run(0.9)
    desk.submit("b", SECOND)
    assert desk.arm.calls == ["start", "stop"]
    assert "a" not in desk.ended
    assert desk.queue.active is not None
    desk.run(0.15)
    assert (desk.ended["a"].outcome, desk.ended["a"].code) == (GoalStatus.ABORTED, GoalCode.INVALID_GOAL)
    assert "preempted by a newer goal" in desk.ended["a"].text
    assert desk.arm.calls == ["start", "stop", "start"]
    desk.run(1.1)
    assert desk.ended["b"].outcome is GoalStatus.SUCCEEDED
    assert desk.arm.command == pytest.approx([0.0, 1.0])


def test_empty_goal_stops_running_goal() -> None:
    desk = Desk()
    desk.submit("a", FIRST)
    desk.run(0.9)
    desk.submit("empty", goal())
    desk.run(0.2)
    assert desk.ended["a"].code == GoalCode.INVALID_GOAL
    assert desk.ended["empty"].outcome is GoalStatus.SUCCEEDED
    assert desk.arm.state().idle.all()


def test_a_goal_that_waits_for_its_start_gives_way_at_once() -> None:
    desk = Desk()
    desk.submit("a", goal((1.0, (1.0, 0.0)), start_in_s=5.0))
    desk.run(0.1)
    desk.submit("b", SECOND)
    assert desk.ended["a"].code == GoalCode.INVALID_GOAL
    assert desk.arm.calls == ["start"]


def test_cancel_of_the_running_the_waiting_and_an_unknown_goal() -> None:
    desk = Desk()
    desk.submit("a", FIRST)
    desk.run(0.5)
    desk.submit("b", SECOND)
    desk.queue.cancel("b", desk.now_s)
    assert desk.ended["b"].outcome is GoalStatus.CANCELED
    desk.queue.cancel("nobody", desk.now_s)
    desk.run(0.2)
    assert desk.ended["a"].code == GoalCode.INVALID_GOAL
    desk.submit("c", SECOND)
    desk.run(0.5)
    desk.queue.cancel("c", desk.now_s)
    assert "c" not in desk.ended
    desk.run(0.2)
    assert desk.ended["c"].outcome is GoalStatus.CANCELED


def test_repeated_cancellations_do_not_postpone_the_quick_stop() -> None:
    desk = Desk()
    desk.arm.stop_takes_s = None
    desk.submit("a", goal((0.0, (0.0, 0.0)), (8.0, (1.0, 0.0))))
    desk.run(0.5)
    for _ in range(round(4.6 / TICK_S)):  # this spline may take 4 s to stop, plus 0.5 s
        desk.queue.cancel("a", desk.now_s)
        desk.run(TICK_S)
    assert desk.ended["a"].outcome is GoalStatus.CANCELED
    assert desk.arm.calls.count("stop") == 1
    assert desk.arm.calls.count("quick_stop") == 1


def test_an_emergency_ends_everything() -> None:
    desk = Desk()
    desk.submit("a", FIRST)
    desk.run(0.5)
    desk.submit("b", SECOND)
    desk.submit("hasty", replace(SECOND, start_in_s=5.0))
    assert desk.ended["b"].code == GoalCode.INVALID_GOAL, "the newest counts"
    desk.queue.stop_all(EMERGENCY, desk.now_s)
    assert desk.ended["hasty"] == Result(GoalStatus.ABORTED, 65632, "emergency stop")
    desk.run(0.05)
    assert desk.ended["a"].outcome is GoalStatus.ABORTED
    assert desk.arm.calls == ["start", "stop", "quick_stop"]
    assert desk.queue.active is None


# --- goals that come while another one runs ---------------------------------------------------------------------------

STRICT = replace(SETTINGS, plan=replace(SETTINGS.plan, max_velocity_radps=(2.0, 2.0)))
HASTY = goal((0.1, (3.0, 0.0)))


def test_a_goal_that_cannot_be_planned_leaves_the_running_one_alone() -> None:
    desk = Desk(STRICT)
    desk.submit("a", FIRST)
    desk.run(0.9)
    desk.submit("hasty", HASTY)
    assert (desk.ended["hasty"].outcome, desk.ended["hasty"].code) == (GoalStatus.ABORTED, GoalCode.INVALID_GOAL)
    assert "velocity" in desk.ended["hasty"].text
    desk.run(1.3)
    assert desk.ended["a"].outcome is GoalStatus.SUCCEEDED
    assert desk.arm.calls == ["start"]


def test_running_goal_continues_until_start_time_of_newer_goal() -> None:
    desk = Desk()
    desk.submit("a", FIRST)
    desk.run(0.5)
    desk.submit("b", replace(SECOND, start_in_s=0.6))
    desk.run(0.55)
    assert desk.arm.calls == ["start"]
    assert desk.queue.active is not None
    assert desk.queue.active[0] == "a"
    assert desk.ended == {}
    desk.run(0.2)
    assert desk.arm.calls == ["start", "stop", "start"]
    assert desk.ended["a"].code == GoalCode.INVALID_GOAL
    assert desk.ended_at_s["a"] == pytest.approx(1.2, abs=0.02)
    desk.run(1.2)
    assert desk.ended["b"].outcome is GoalStatus.SUCCEEDED


def test_a_goal_that_ends_before_the_start_of_the_newer_one_succeeds() -> None:
    desk = Desk()
    desk.submit("a", FIRST)
    desk.run(0.5)
    desk.submit("b", goal((1.0, (0.0, 1.0)), start_in_s=2.0))
    desk.run(1.6)
    assert desk.ended["a"].outcome is GoalStatus.SUCCEEDED
    assert desk.arm.calls == ["start"]
    desk.run(1.7)
    assert desk.ended["b"].outcome is GoalStatus.SUCCEEDED
    assert desk.ended_at_s["b"] == pytest.approx(3.5, abs=0.03)


def test_a_goal_is_planned_from_where_the_running_one_will_be() -> None:
    """From the current position the goal is too far for its time; from the predicted position it is not."""
    desk = Desk(STRICT)
    desk.submit("a", goal((0.0, (0.0, 0.0)), (4.0, (4.0, 0.0))))
    desk.run(0.2)
    near_the_end = goal((1.0, (4.2, 0.0)), start_in_s=3.9)
    desk.submit("b", near_the_end)
    assert desk.ended == {}
    desk.run(5.5)
    assert desk.ended["b"].outcome is GoalStatus.SUCCEEDED


def test_without_a_status_the_newer_goal_is_planned_when_the_joints_stand() -> None:
    desk = Desk(STRICT)
    desk.submit("a", FIRST)
    desk.run(0.5)
    desk.queue.submit("hasty", HASTY, desk.now_s, Blind(Fault(1, "silent"), gone=False))
    assert desk.arm.calls == ["start", "stop"]
    desk.run(0.2)
    assert desk.ended["hasty"].code == GoalCode.INVALID_GOAL
