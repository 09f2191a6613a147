"""The lifecycle of one process, in fake time."""

from __future__ import annotations

from collections.abc import Callable
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


def test_heartbeat_sets_waiting_and_ready_state() -> None:
    life = started()
    assert (life.state, life.restarts) == (State.STARTING, 0)
    life.heartbeat(0.5, False, "/odom")
    assert (life.state, life.reason) == (State.WAITING, "/odom")
    life.heartbeat(0.7, True, "")
    assert (life.state, life.reason) == (State.READY, "")
    assert life.heartbeat_age_s(1.0) == pytest.approx(0.3)


def test_exit_zero_is_a_crash_too_after_which_the_construction_has_its_timeout_again() -> None:
    life = ready()
    life.exited(1.0, 0)
    assert life.state is State.BACKOFF
    life.started(2.0)
    life.heartbeat(2.5, False, "/odom")
    assert life.order(60.0) is Order.NONE


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


def test_refusal_is_final_at_once_until_a_start_on_request() -> None:
    life = started()
    life.exited(0.3, 2)
    assert life.state is State.FAILED
    assert life.order(100.0) is Order.NONE
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


@pytest.mark.parametrize(
    ("happens", "hung_at_s"),
    [
        (lambda life: life.heartbeat(1.0, False, "/odom"), 4.0),  # ready once, now waiting
        (lambda life: life.forgive(50.0), 53.0),  # the supervisor was absent
        (lambda life: life.starved(2.0), 5.0),
        (lambda life: (life.starved(2.0), life.heartbeat(2.5, True, "")), 5.5),
    ],
    ids=["waits", "absent supervisor", "starved", "heartbeat after starvation"],
)
def test_silence_is_a_hang_after_its_time(happens: Callable[[Lifecycle], object], hung_at_s: float) -> None:
    life = ready()
    happens(life)
    assert life.order(hung_at_s - 0.1) is Order.NONE
    assert life.order(hung_at_s + 0.1) is Order.TERMINATE


def test_silence_without_judgement_is_not_a_hang() -> None:
    life = ready()
    assert life.order(100.0, judge=False) is Order.NONE
    assert life.state is State.READY


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


@pytest.mark.parametrize(
    ("silent", "counts"),
    [({"a": True, "b": False}, {"a"}), ({"a": True, "b": True}, set()), ({"a": True}, {"a"})],
    ids=["one among others", "everybody silent", "a process alone"],
)
def test_silence_that_counts_as_a_fault(silent: dict[str, bool], counts: set[str]) -> None:
    assert set(judged(silent)) & {"a"} == counts


def test_start_queue_holds_first_starts_but_neither_the_clock_nor_a_restart() -> None:
    first, died = Lifecycle(ROW, PARAMS), started()
    first.wanted(0.0)
    died.exited(1.0, -9)
    queue = StartQueue(2, frozenset({"world"}))
    assert not queue.holds("a", first, starting=1)
    assert queue.holds("a", first, starting=2)
    assert not queue.holds("world", first, starting=9)
    assert not queue.holds("a", died, starting=9)
