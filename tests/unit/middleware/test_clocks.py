"""Sleep times of a node on the clock of a simulated world."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from robot_stack.core.world_clock import WorldClock
from robot_stack.middleware.clocks import SharedWorldClock

STEP_S = 0.005


class Machine:
    """The clock of a world, and the computer's own clock in fake time."""

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000
        self._world = WorldClock.make()
        self.clock = SharedWorldClock(self._world)

    def write(self, time_s: float, speed: float = 1.0) -> None:
        self._world.write(time_s, STEP_S, speed)

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(1e9 * seconds)


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path))
    made = Machine()
    monkeypatch.setattr(time, "monotonic_ns", lambda: made.now_ns)
    return made


def test_a_node_sleeps_until_its_timer_is_due(machine: Machine) -> None:
    machine.write(10.0, speed=2.0)
    assert machine.clock.real_wait_s(10.1) == pytest.approx(0.05)
    assert machine.clock.real_wait_s(math.inf) == math.inf
    machine.sleep(0.001)
    assert machine.clock.real_wait_s(10.1) == pytest.approx(0.049)


def test_a_node_looks_ever_less_often_at_a_clock_that_stands(machine: Machine) -> None:
    """Twenty nodes that poll every 0.5 ms would leave no processor time for the node the world waits for."""
    machine.write(10.0)
    woken, due_s = 0, 10.006
    end_ns = machine.now_ns + 1_000_000_000
    while machine.now_ns < end_ns:
        machine.sleep(machine.clock.real_wait_s(due_s))
        woken += 1
    assert woken < 65


def test_wake_up_delay_after_clock_resumes_is_bounded(machine: Machine) -> None:
    """The delay is at most half of the time the clock was stopped, and at most 20 ms."""
    for stood_s in (0.001, 0.003, 0.01, 0.03, 0.3, 3.0):
        machine.write(10.0)
        due_s, stood_ns = 10.006, machine.now_ns + round(1e9 * (STEP_S + stood_s))
        while machine.now_ns < stood_ns:
            machine.sleep(machine.clock.real_wait_s(due_s))
        assert 1e-9 * (machine.now_ns - stood_ns) <= max(0.001, min(0.5 * stood_s, 0.02))


def test_a_world_that_has_not_begun_is_looked_at(machine: Machine) -> None:
    assert 0.0 < machine.clock.real_wait_s(0.0) <= 0.02
