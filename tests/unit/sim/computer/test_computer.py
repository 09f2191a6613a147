"""The simulated computer's files and disk, read by the system monitor's own code."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from robot_stack.core.config import load
from robot_stack.core.runtime import tell_touch_screen
from robot_stack.system_monitor.nodes.computer_reader import ComputerReader
from sim.computer.computer import SimComputer
from sim.computer.faults import BY_NAME, ComputerFaults
from sim.computer.params import SimComputerParams
from sim.plant.fault_table import CLEAR, FaultRefused
from tests.support.waiting import wait_for

PARAMS = load(SimComputerParams, "sim_computer")


@pytest.fixture
def computer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimComputer]:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path / "runtime"))
    simulated = SimComputer(PARAMS, tmp_path / "computer", tmp_path)
    yield simulated
    simulated.close()
    assert not (tmp_path / "computer").exists(), "it leaves nothing behind"


@pytest.fixture
def reader(computer: SimComputer, tmp_path: Path) -> ComputerReader:
    folder = tmp_path / "computer"
    return ComputerReader(folder / "proc", folder / "thermal", folder / "disk")


def user_namespaces() -> bool:
    done = subprocess.run(["unshare", "--map-root-user", "--mount", "true"], check=False, capture_output=True)
    return done.returncode == 0


def test_computer_reports_configured_and_injected_values(computer: SimComputer, reader: ComputerReader) -> None:
    faults = ComputerFaults(computer)

    def shown() -> tuple[float, float]:
        computer.kernel.tick()
        return reader.memory_percent(), next(iter(reader.zones().values()))

    assert shown() == pytest.approx((40.0, 50.0), abs=0.1)
    assert set(BY_NAME) == {"overheat", "cpu_high", "memory_high", "disk_full", "screen_lost"}
    with pytest.raises(FaultRefused, match=r"0\.\.100"):
        faults.inject("cpu_high", value=101.0)
    faults.inject("overheat")
    faults.inject("memory_high", value=98.0)
    assert shown() == pytest.approx((98.0, 90.0), abs=0.1)
    faults.inject(CLEAR)
    assert shown() == pytest.approx((40.0, 50.0), abs=0.1)
    assert psutil.PROCFS_PATH == "/proc"


def test_busy_processors(computer: SimComputer, reader: ComputerReader) -> None:
    ComputerFaults(computer).inject("cpu_high")
    computer.kernel.tick()
    before = reader.cpu()
    assert before is not None

    def gone_on() -> float:
        computer.kernel.tick()
        now = reader.cpu()
        assert now is not None
        total_s = now.total_s - before.total_s
        return (now.busy_s - before.busy_s) / total_s if total_s > 1.0 else 0.0

    assert wait_for(gone_on, "a second of the counters") == pytest.approx(0.99, abs=0.02)


@pytest.mark.skipif(not user_namespaces(), reason="no user namespaces: nowhere to mount the disk that is full")
def test_a_disk_that_is_full_and_the_machines_own(computer: SimComputer, reader: ComputerReader) -> None:
    own = reader.disk_percent()
    faults = ComputerFaults(computer)
    faults.inject("disk_full")
    faults.inject("disk_full")
    assert reader.disk_percent() == 100.0
    faults.inject(CLEAR, "disk_full")
    assert reader.disk_percent() == pytest.approx(own, abs=5.0)


def test_without_namespaces_the_injection_is_refused(
    computer: SimComputer, reader: ComputerReader, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a machine whose kernel denies namespaces."""
    refusing = tmp_path / "bin" / "unshare"
    refusing.parent.mkdir()
    refusing.write_text("#!/bin/sh\nexit 1\n", encoding="ascii")
    refusing.chmod(0o755)
    monkeypatch.setenv("PATH", f"{refusing.parent}:/usr/bin:/bin")
    faults = ComputerFaults(computer)
    with pytest.raises(FaultRefused, match="namespaces"):
        faults.inject("disk_full")
    assert faults.active == ()
    assert 0.0 < reader.disk_percent() <= 100.0


def test_a_screen_can_be_lost_only_where_one_is_served(computer: SimComputer) -> None:
    faults = ComputerFaults(computer)
    with pytest.raises(FaultRefused, match="has no server"):
        faults.inject("screen_lost")
    assert not computer.screen.shown
    tell_touch_screen("http://127.0.0.1:1/")  # no server listens there
    faults.inject("screen_lost")
    assert computer.screen.shown, "it is lost only once it has been seen"
    computer.screen.on_heartbeat()
    assert computer.screen.shown
    computer.screen.on_heartbeat()
    assert not computer.screen.shown
    faults.inject(CLEAR)
    assert computer.screen.shown
