"""The system monitor's process: the computer's files, its own process, two nodes of a name. When: tests/simulated."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from robot_stack.bench.written_computer import WrittenComputer
from robot_stack.contract import topics
from tests.support.peer import Peer
from tests.support.processes import NodeProcess


@pytest.fixture
def computer(tmp_path: Path) -> Iterator[WrittenComputer]:
    """Its time goes on by itself."""
    written, ended = WrittenComputer(tmp_path / "computer"), threading.Event()

    def live() -> None:
        while not ended.wait(0.02):
            written.tick()

    thread = threading.Thread(target=live)
    thread.start()
    yield written
    ended.set()
    thread.join()


def test_the_kernels_files_its_own_process_and_the_graph_are_read(
    start: Callable[..., NodeProcess], peer: Peer, computer: WrittenComputer
) -> None:
    status, tree = peer.listen(topics.ROBOT_STATUS), peer.listen(topics.DIAGNOSTICS_AGG)
    temperature = peer.listen(topics.COMPUTER_TEMPERATURE)
    names = {"proc_folder": computer.proc, "thermal_folder": computer.thermal}
    given = [f"{name}:={value}" for name, value in (*names.items(), ("graph_period_s", 0.5), ("pss_period_s", 0.5))]
    process = start("system_monitor", *(word for item in given for word in ("-p", item)))

    def wait_entry(name: str, condition: Callable[[dict[str, str]], bool]) -> None:
        def fits(entry: DiagnosticStatus) -> bool:
            return entry.name == f"/Robot/System/system_monitor: {name}" and condition(
                {item.key: item.value for item in entry.values}
            )

        tree.wait(lambda message: any(map(fits, message.status)), f"an entry {name} that fits")

    status.wait(lambda m: m.memory_usage_percent == pytest.approx(40.0, abs=0.5), "the memory")
    status.wait(lambda m: 0.0 < m.disk_usage_percent <= 100.0, "the disk")
    zone = temperature.wait(lambda m: m.temperature == pytest.approx(50.0), "the temperature")
    assert zone.header.frame_id == "thermal_zone0 x86_pkg_temp"
    wait_entry("computer", lambda values: "50.0 C" in values["temperature"] and values["pressure io"] == "1.5 %")
    wait_entry("processes", lambda values: "pss" in values.get("system_monitor", ""))
    drivers = [Peer("xsens_driver"), Peer("xsens_driver")]
    wait_entry("graph", lambda values: values.get("xsens_driver") == "two nodes of this name")
    for driver in drivers:
        driver.close()
    process.stop()
    assert process.process.returncode == 0
