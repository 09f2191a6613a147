"""Pacing, requests between threads, and the loop, with a fake clock where possible."""

from __future__ import annotations

import itertools
import math
import threading

import pytest

from sim.plant.faults import FaultRefused, Faults
from sim.plant.imu import ImuSample
from sim.plant.simulation import Simulation
from sim.plant.world import Setup
from sim.run.loop import Loop, Task
from sim.run.pacing import Pacer
from sim.run.requests import NotServed, RequestQueue
from sim.worldfile import load_world

from .bench import PARAMS, ROBOT


def test_steps_are_due_on_absolute_deadlines() -> None:
    pacer = Pacer(0.001, 1.0, 0.1, 10.0)
    assert pacer.wait_s(10.0) == 0.0
    assert pacer.wait_s(10.0004) == pytest.approx(0.0006)
    assert pacer.wait_s(10.0010 + 0.0003) == pytest.approx(0.0007), "a late wake-up does not move the deadline"
    five_times = Pacer(0.001, 5.0, 0.1, 0.0)
    five_times.start(50.0)
    assert five_times.wait_s(50.0) == 0.0, "the time before the start does not count"
    assert five_times.wait_s(50.0) == pytest.approx(0.0002)


def test_a_short_lag_is_caught_up_at_twice_the_pace_and_counted() -> None:
    pacer = Pacer(0.001, 1.0, 0.1, 0.0)
    pacer.wait_s(0.0)
    now_s, steps = 0.0205, 1
    begun_s = []
    while True:
        wait_s = pacer.wait_s(now_s)
        steps += 1
        now_s += wait_s
        begun_s.append(now_s)
        if now_s < 0.001 * steps:  # on time again
            break
        now_s += 1e-6
    # 19.5 ms behind: each half period catches up by half a period.
    assert len(begun_s) == pytest.approx(39, abs=2)
    assert min(later - earlier for earlier, later in itertools.pairwise(begun_s)) > 0.00049
    report = pacer.report(now_s)
    assert (report.drops, report.dropped_s) == (0, 0.0)
    assert report.worst_lag_s == pytest.approx(0.0195)
    assert report.overruns > 30


def test_a_long_lag_is_given_up_not_run_after() -> None:
    pacer = Pacer(0.001, 1.0, 0.1, 0.0)
    pacer.wait_s(0.0)
    assert pacer.wait_s(2.0) == 0.0
    assert pacer.wait_s(2.0) == pytest.approx(0.001), "the next step has a whole period again"
    report = pacer.report(2.0)
    assert report.drops == 1
    assert report.dropped_s == pytest.approx(1.999)
    assert pacer.total_dropped_s == pytest.approx(1.999)
    assert pacer.total_overruns == 1
    later = pacer.report(3.0)
    assert (later.steps, later.drops, later.overruns, later.speed) == (0, 0, 0, 0.0), "a report resets the counters"


@pytest.mark.parametrize("arguments", [(0.0, 1.0, 0.1), (0.001, 0.0, 0.1), (0.001, 1.0, 0.0)])
def test_nonsense_is_refused(arguments: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="above zero"):
        Pacer(*arguments, now_s=0.0)


def test_requests_run_in_the_serving_thread_and_their_errors_are_raised_in_the_asking_one() -> None:
    queue, errors, served = RequestQueue(), [], []

    def ask() -> None:
        served.append(queue.ask(threading.get_ident, 5.0))
        try:
            queue.ask(lambda: 1 / 0, 5.0)
        except ZeroDivisionError as error:
            errors.append(error)

    asker = threading.Thread(target=ask)
    asker.start()
    while not errors:
        queue.serve()
    asker.join()
    assert served == [threading.get_ident()]
    with pytest.raises(NotServed, match=r"0\.01 s"):
        queue.ask(lambda: None, 0.01)


def make_loop(tasks: tuple[Task, ...], samples: list[ImuSample]) -> tuple[Loop, Simulation]:
    file = load_world("flat")
    sim = Simulation(ROBOT, PARAMS, Setup(file, 1, file.start.pose()))
    pacer = Pacer(0.001, 1000.0, 0.1, 0.0)
    return Loop(sim, Faults(sim), pacer, tasks, samples.append), sim


def test_the_loop_does_its_tasks_at_their_rates() -> None:
    calls: list[int] = []
    samples: list[ImuSample] = []
    sim: Simulation
    loop, sim = make_loop((Task(20, lambda: calls.append(sim.world.steps)),), samples)
    loop.run(lambda: sim.world.steps >= 100)
    assert calls == [20, 40, 60, 80, 100]
    assert [round(sample.time_s * 1000) for sample in samples] == [10, 20, 30, 40, 50, 60, 70, 80, 90]


def test_block_of_steps_runs_one_engine_turn_with_one_cycle_per_step() -> None:
    file = load_world("flat")
    sim = Simulation(ROBOT, PARAMS, Setup(file, 1, file.start.pose()))
    turns: list[str] = []
    sim.engine_begin = lambda: turns.append("begin")
    sim.engine_cycle = lambda: turns.append("cycle")
    sim.engine_end = lambda: turns.append("end")
    seen: list[tuple[int, float]] = []
    task = Task(2, lambda: seen.append((sim.world.steps, loop.block_end_s)))
    loop = Loop(sim, Faults(sim), Pacer(0.005, 1000.0, 0.1, 0.0), (task,), lambda _: None, block_steps=5)
    loop.run(lambda: sim.world.steps >= 10)
    assert turns == ["begin", *["cycle"] * 5, "end"] * 2
    assert seen == [(2, 0.005), (4, 0.005), (6, 0.01), (8, 0.01), (10, 0.01)], "tasks keep their steps"
    sim.engine_stalled = True
    loop.run(lambda: sim.world.steps >= 20)
    assert len(turns) == 14, "a stalled engine is not called"


def test_faults_enter_the_loop_from_another_thread() -> None:
    samples: list[ImuSample] = []
    loop, sim = make_loop((), samples)
    answers: list[str] = []

    def ask() -> None:
        answers.append(loop.inject("imu_silent", "", 0.0, 0.0))
        try:
            loop.inject("meteor", "", 0.0, 0.0)
        except FaultRefused as refused:
            answers.append(str(refused))

    asker = threading.Thread(target=ask)
    asker.start()
    limit_s = 60.0
    loop.run(lambda: len(answers) == 2 or sim.time_s > limit_s)
    asker.join()
    assert answers[0] == "the inertial unit is silent"
    assert answers[1].startswith("no fault 'meteor'")
    assert sim.imu.silent
    assert math.isfinite(sim.time_s)
