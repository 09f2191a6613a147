"""Which processes a simulated world waits for, and when."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_stack.contract import topics
from robot_stack.core.deliveries import NUMBERS, PUBLISHES, TAKES, WAKES, Delivery
from robot_stack.core.node_record import NodeRecord
from sim.plant.fault_table import FaultRefused
from sim.run.lockstep import Mail, describe, late
from sim.run.processes import Processes, process_runs
from tests.support.waiting import wait_for

TOLERANCE_S = 0.03
ROW = NUMBERS[topics.JOINT_STATES]


def test_late_nodes_are_reported() -> None:
    assert late({"a": 1.0, "b": 1.0}, 1.02, TOLERANCE_S) == {}
    assert late({"a": 1.0, "b": 1.02}, 1.04, TOLERANCE_S) == {"a": "40 ms late"}
    assert late({"a": 1.04, "b": 1.02}, 1.04, TOLERANCE_S) == {}
    assert late({"a": 1.0, "b": math.inf}, 1000.0, TOLERANCE_S) == {"a": "999000 ms late"}
    assert describe({"a": "late"}) == "a (late)"
    assert describe(dict.fromkeys("abcde", "x")) == "a (x), b (x), c (x) and 2 more"


def test_a_message_that_wakes_is_waited_for_and_others_are_the_timers() -> None:
    sender, woken, polling = Delivery(), Delivery(), Delivery()
    sender.uses[ROW], sender.published[ROW] = PUBLISHES, 100
    woken.uses[ROW], woken.taken[ROW] = TAKES | WAKES, 50
    polling.uses[ROW], polling.taken[ROW] = TAKES, 50
    pages = {"sender": sender, "woken": woken, "polling": polling}
    mail = Mail(pages, list(pages))
    assert mail.owed() == mail.owed({"woken"}) == {"woken": "message on /joint_states"}
    assert mail.owed({"sender", "polling"}) == {}
    assert Mail(pages, ["sender", "polling"]).owed() == {}
    woken.taken[ROW] = 101
    assert mail.owed() == {}


class TestProcesses:
    @pytest.fixture
    def process(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[subprocess.Popen[str]]:
        """A process with a node of the name ``other``."""
        monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path))
        script = (
            "from robot_stack.core.node_record import NodeRecord; import time\n"
            "NodeRecord('other').beat(True, ''); print('on', flush=True); time.sleep(300)"
        )
        started = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        assert started.stdout is not None
        assert started.stdout.readline() == "on\n"
        yield started
        started.kill()
        started.wait()
        started.stdout.close()

    def test_one_that_a_fault_stops_does_not_until_the_fault_ends(self, process: subprocess.Popen[str]) -> None:
        """A stop from outside, as by a debugger, makes the world wait."""
        processes = Processes()
        process.send_signal(signal.SIGSTOP)
        assert processes.takes_part("other")
        process.send_signal(signal.SIGCONT)
        processes.stop("other")
        assert not processes.takes_part("other")
        wait_for(lambda: _state(process.pid) == "T", "the process to stand still")
        processes.resume("other")
        wait_for(lambda: _state(process.pid) != "T", "the process to go on")
        assert processes.takes_part("other")
        processes.resume("other")

    def test_ended_process_does_not_take_part_even_if_not_reaped(self, process: subprocess.Popen[str]) -> None:
        processes = Processes()
        processes.kill("other")
        wait_for(lambda: not process_runs(process.pid), "the end of the process")
        assert not processes.takes_part("other")
        with pytest.raises(FaultRefused, match="no process of a node 'other' runs"):
            processes.stop("other")

    def test_unknown_process_and_world_do_not_take_part(self, process: subprocess.Popen[str]) -> None:
        processes = Processes()
        NodeRecord("sim_world").beat(True, "")
        assert not processes.takes_part("nobody")
        assert not processes.takes_part("sim_world")
        with pytest.raises(FaultRefused, match="world's own process"):
            processes.kill("sim_world")
        assert os.getpid() != process.pid


def _state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
