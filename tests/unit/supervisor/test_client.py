"""``start`` waits for a supervisor that computes, and gives up on one that hangs or ends."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from robot_stack.supervisor import client
from robot_stack.supervisor.client import Launch, StartError
from robot_stack.supervisor.control import NotRunning

DEADLINE_S = 10.0
READY = {"ready": True, "processes": []}
IMPORTING = {"ready": False, "log_dir": "", "processes": [{"name": "a", "state": "backoff", "reason": "", "pid": None}]}


class Computer:
    """A computer in fake time. Its supervisor computes share of the time and answers from a processor time on."""

    def __init__(self, share: Callable[[float], float], answers_at_s: float, forks_at_s: float = 0.0) -> None:
        self.now_s = self.computed_s = 0.0
        self._share, self._answers_at_s, self._forks_at_s = share, answers_at_s, forks_at_s

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s
        self.computed_s += duration_s * self._share(self.now_s)

    def ask(self, verb: str, timeout_s: float = 5.0) -> dict[str, Any]:
        if self.computed_s < self._answers_at_s:
            raise NotRunning("no supervisor")
        return READY if self.computed_s >= self._forks_at_s else IMPORTING


class Silent:
    """A supervisor that runs."""

    pid = 1
    stderr = sys.stderr

    def poll(self) -> None:
        return None


def started(computer: Computer, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.setattr(client, "time", computer)
    monkeypatch.setattr(client, "ask", computer.ask)
    monkeypatch.setattr(client, "refuse_second", lambda: None)
    monkeypatch.setattr(client, "_processor_s", lambda _: round(computer.computed_s, 2))  # counted in ticks
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: Silent())
    return client.start(Launch("sim"), DEADLINE_S)


@pytest.mark.parametrize("share", [1.0, 0.01])
def test_supervisor_may_start_slowly_on_a_busy_computer(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    computer = Computer(lambda _: share, answers_at_s=3.0)
    assert started(computer, monkeypatch) == READY
    assert computer.now_s == pytest.approx(3.0 / share, abs=0.1)


def test_the_deadline_does_not_count_while_the_forkserver_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    computer = Computer(lambda _: 0.01, answers_at_s=1.0, forks_at_s=3.0)
    assert started(computer, monkeypatch) == READY
    with pytest.raises(StartError, match="not ready"):
        started(Computer(lambda now_s: float(now_s < 2.0), answers_at_s=1.0, forks_at_s=3.0), monkeypatch)


def test_supervisor_that_hangs_before_its_first_answer_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    computer = Computer(lambda now_s: 0.5 if now_s < 4.0 else 0.0, answers_at_s=3.0)
    with pytest.raises(StartError, match="the supervisor does not answer"):
        started(computer, monkeypatch)
    assert computer.now_s == pytest.approx(4.0 + DEADLINE_S, abs=0.2)


def test_supervisor_that_computes_without_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    computer = Computer(lambda _: 1.0, answers_at_s=1e9)
    with pytest.raises(StartError, match="the supervisor does not answer"):
        started(computer, monkeypatch)
    assert computer.now_s == pytest.approx(60.0 + DEADLINE_S, abs=0.2)


def test_processor_time_is_the_kernels() -> None:
    assert client._processor_s(os.getpid()) > 0.0
    assert client._processor_s(2**22 + 1) == 0.0
