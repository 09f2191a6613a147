"""The lifecycle of one process, in fake time."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.contract.model import Criticality, Process
from robot_stack.supervisor.lifecycle import RUNNING, Lifecycle, Order, StartQueue, State, judged
from robot_stack.supervisor.params import Backoff, load_params

PARAMS = load_params().model_copy(
    update={
        "hang_after_s": 3.0,
        "construction_limit_s": 120.0,
        "stable_after_s": 60.0,
        "hung_kill_s": 2.0,
        "backoff": {Criticality.CRITICAL: Backoff(first_s=1.0, factor=2.0, longest_s=5.0)},
    }
)
ROW = Process("node", None, Criticality.CRITICAL, "", ("node",), max_restarts=3)


def started(now_s: float = 0.0) -> Lifecycle:
    life = Lifecycle(ROW, PARAMS)
    life.wanted(now_s)
    assert life.order(now_s) is Order.START
    life.started(now_s)
    return life


def ready(now_s: float = 0.0) -> Lifecycle:
    life = started(now_s)
    life.heartbeat(now_s, True, "")
    return life


def next_start_s(life: Lifecycle, from_s: float) -> float:
    """Returns the first time, in steps of 10 ms, at which a start is ordered."""
    step = 0
    while life.order(from_s + 0.01 * step) is not Order.START:
        step += 1
        assert step < 10_000, "never started again"
    return from_s + 0.01 * step


def test_first_start_is_at_once_and_no_restart() -> None:
    life = started()
    assert life.state is State.STARTING
    assert life.restarts == 0


def test_heartbeat_sets_waiting_and_ready_state() -> None:
    life = started()
    life.heartbeat(0.5, False, "/odom")
    assert (life.state, life.reason) == (State.WAITING, "/odom")
    life.heartbeat(0.7, True, "")
    assert (life.state, life.reason) == (State.READY, "")
    assert life.heartbeat_age_s(1.0) == pytest.approx(0.3)


def test_crash_restarts_with_growing_delay_up_to_the_longest() -> None:
    life = Lifecycle(replace(ROW, max_restarts=10), PARAMS)
    life.wanted(0.0)
    now_s, delays = 0.0, []
    assert life.order(now_s) is Order.START
    for _ in range(5):
        life.started(now_s)
        life.exited(now_s + 0.1, 1)
        again_s = next_start_s(life, now_s + 0.1)
        delays.append(again_s - now_s - 0.1)
        now_s = again_s
    assert delays == pytest.approx([1.0, 2.0, 4.0, 5.0, 5.0], abs=0.011)
    assert life.restarts == 5


def test_unexpected_exit_zero_is_a_crash_too() -> None:
    life = ready()
    life.exited(1.0, 0)
    assert life.state is State.BACKOFF


def test_gives_up_after_max_restarts_in_a_minute() -> None:
    life = started()
    now_s = 0.0
    for _ in range(3):
        life.exited(now_s, -11)
        now_s = next_start_s(life, now_s)
        life.started(now_s)
    life.exited(now_s, -11)
    assert life.state is State.FAILED
    assert "signal 11" in life.reason
    assert all(life.order(now_s + later) is Order.NONE for later in (0.1, 60.0, 3600.0))


def test_crashes_further_apart_than_the_window_are_forgiven() -> None:
    life = started()
    now_s = 0.0
    for _ in range(20):
        now_s += 59.0
        life.heartbeat(now_s, True, "")
        life.exited(now_s, 1)
        assert life.state is State.BACKOFF
        now_s = next_start_s(life, now_s)
        life.started(now_s)


def test_long_run_resets_backoff() -> None:
    life = started()
    life.exited(0.1, 1)
    now_s = next_start_s(life, 0.1)
    life.started(now_s)
    life.exited(now_s + 60.0, 1)
    assert next_start_s(life, now_s + 60.0) == pytest.approx(now_s + 61.0, abs=0.011)


def test_refusal_is_final_at_once() -> None:
    life = started()
    life.exited(0.3, 2)
    assert life.state is State.FAILED
    assert life.order(100.0) is Order.NONE


def test_process_that_was_given_up_can_be_started_on_request() -> None:
    life = started()
    life.exited(0.3, 2)
    life.wanted(1.0)
    assert life.order(1.0) is Order.START
    life.started(1.0)
    assert (life.state, life.restarts) == (State.STARTING, 1)


def test_silence_is_terminated_then_killed_then_restarted() -> None:
    life = ready()
    assert life.order(3.0) is Order.NONE
    assert life.order(3.1) is Order.TERMINATE
    assert life.state is State.HUNG
    assert life.order(3.2) is Order.NONE
    life.heartbeat(4.0, True, "")  # too late: SIGTERM has been sent
    assert life.state is State.HUNG
    assert life.order(5.2) is Order.KILL
    life.exited(5.3, -9)
    assert "hung" in life.reason
    assert next_start_s(life, 5.3) == pytest.approx(6.3, abs=0.011)


def test_construction_has_separate_timeout_and_reports_its_activity() -> None:
    life = started()
    life.constructing("compiling")
    assert (life.state, life.reason) == (State.STARTING, "compiling")
    assert life.order(119.9) is Order.NONE
    assert life.order(120.1) is Order.TERMINATE
    assert "never ready: compiling" in life.reason


def test_long_first_callback_before_ready_is_not_a_hang() -> None:
    """The loop has run, but the process is not ready: its callback may take as long as a construction."""
    life = started()
    life.heartbeat(1.0, False, "/sensors/lidar/half_sweep")
    assert life.order(100.0) is Order.NONE
    life.heartbeat(101.0, True, "")
    assert life.order(103.9) is Order.NONE
    assert life.order(104.1) is Order.TERMINATE


def test_a_process_that_was_ready_once_is_judged_also_while_it_waits() -> None:
    life = ready()
    life.heartbeat(1.0, False, "/odom")
    assert life.order(4.1) is Order.TERMINATE


def test_restarted_process_gets_construction_timeout_again() -> None:
    life = ready()
    life.exited(1.0, 1)
    life.started(2.0)
    life.heartbeat(2.5, False, "/odom")
    assert life.order(60.0) is Order.NONE


def test_silence_without_judgement_is_not_a_hang() -> None:
    life = ready()
    assert life.order(100.0, judge=False) is Order.NONE
    assert life.state is State.READY


def test_absence_of_the_supervisor_is_forgiven() -> None:
    life = ready()
    life.forgive(50.0)
    assert life.order(52.0) is Order.NONE
    assert life.order(53.1) is Order.TERMINATE


def test_starvation_time_extends_hang_timeout() -> None:
    life = ready()
    life.starved(2.0)
    assert life.order(4.9) is Order.NONE
    assert life.order(5.1) is Order.TERMINATE


def test_a_heartbeat_ends_the_account_of_a_silence() -> None:
    life = ready()
    life.starved(2.0)
    life.heartbeat(2.5, True, "")
    assert life.order(5.4) is Order.NONE
    assert life.order(5.6) is Order.TERMINATE


def test_restart_of_a_running_process_ends_it_and_starts_at_once() -> None:
    life = ready()
    life.wanted(10.0)
    assert life.state is State.RESTARTING
    assert life.order(11.0) is Order.NONE
    assert life.order(12.1) is Order.KILL  # the process did not react to the interrupt
    life.exited(12.2, -9)
    assert life.order(12.2) is Order.START
    assert life.restarts == 1


def test_stopped_stays_stopped() -> None:
    life = ready()
    life.stopped()
    assert life.order(1000.0) is Order.NONE
    life.heartbeat(1.0, True, "")
    assert life.state is State.STOPPED


@given(
    st.lists(
        st.tuples(
            st.floats(0.0, 30.0),
            st.sampled_from(["beat", "exit0", "exit1", "refuse", "kill", "order", "restart"]),
        ),
        max_size=60,
    )
)
def test_never_more_starts_in_a_minute_than_allowed(events: list[tuple[float, str]]) -> None:
    """For any events: between the operator's restarts, at most max_restarts + 1 starts fall into any minute."""
    life, now_s, alive, starts = Lifecycle(ROW, PARAMS), 0.0, False, []
    life.wanted(0.0)
    for later_s, event in [(0.0, "order"), *events]:
        now_s += later_s
        if event == "beat":
            life.heartbeat(now_s, True, "")
        elif event == "restart":
            life.wanted(now_s)
            starts.clear()
        elif event == "order":
            if life.order(now_s) is Order.START:
                assert not alive, "a second process of one name"
                life.started(now_s)
                alive = True
                starts.append(now_s)
        elif alive:
            alive = False
            life.exited(now_s, {"exit0": 0, "exit1": 1, "refuse": 2, "kill": -9}[event])
        assert (life.state in RUNNING) == alive
        assert len([s for s in starts if now_s - s <= 60.0]) <= ROW.max_restarts + 1


class TestJudged:
    """Processes whose silence counts as a fault."""

    def test_one_silent_among_others_counts(self) -> None:
        assert "a" in judged({"a": True, "b": False})

    def test_everybody_silent_is_nobodys_fault(self) -> None:
        assert judged({"a": True, "b": True}) == frozenset()

    def test_a_process_alone_counts(self) -> None:
        assert judged({"a": True}) == {"a"}


class TestStartQueue:
    """Processes whose first start has to wait."""

    @staticmethod
    def wanted() -> Lifecycle:
        life = Lifecycle(ROW, PARAMS)
        life.wanted(0.0)
        return life

    def test_one_too_many_waits(self) -> None:
        queue = StartQueue(2, frozenset())
        assert not queue.holds("a", self.wanted(), starting=1)
        assert queue.holds("a", self.wanted(), starting=2)

    def test_start_queue_never_holds_the_clock_process(self) -> None:
        assert not StartQueue(2, frozenset({"world"})).holds("world", self.wanted(), starting=9)

    def test_start_queue_does_not_hold_restart_of_died_process(self) -> None:
        life = started()
        life.exited(1.0, -9)
        assert not StartQueue(1, frozenset()).holds("a", life, starting=9)
