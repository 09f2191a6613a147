"""``robot-stack mission queue`` against the real mission manager, across a kill -9."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from tests.support.processes import Start


def test_orders_outlive_a_killed_mission_manager(start: Start, tmp_path: Path) -> None:
    def verb(*words: str, code: int = 0) -> list[str]:
        process = start("verb", command=[sys.executable, "-m", "robot_stack.cli", "mission", *words, "--timeout", "20"])
        assert process.wait() == code, process.output()
        return process.output().splitlines()

    parameters = ("-p", f"journal_file:={tmp_path / 'mission.db'}")
    manager = start("mission_manager", *parameters)
    assert verb("queue", "add", "short_hop", "--id", "a") == ["order 'a' waits at place 1"]
    assert verb("queue", "add", "short_hop", "--id", "a") == ["the order 'a' is known, it is QUEUED"]
    urgent = ("--id", "b", "--priority", "200", "--earliest", "2030-01-02T03:04")
    assert verb("queue", "add", "yard_tour", *urgent) == ["order 'b' waits at place 1"]
    assert verb("queue", "move", "b", "down") == ["order 'b' waits at place 2"]
    assert verb("queue", "add", "nowhere", code=1)[-1].startswith("error: there is no mission 'nowhere'")
    manager.signal(signal.SIGKILL)
    manager.wait()

    start("mission_manager", *parameters)
    assert verb("queue", "list") == [
        "queue held: the mission manager was restarted",
        "1. a: short_hop, priority 100, from cli",
        "2. b: yard_tour, priority 200, from cli, not before 2030-01-02 03:04:00",
    ]
    assert verb("queue", "remove", "a") == ["order 'a' is removed"]
    assert verb("queue", "hold") == ["queue held: a person holds it"]
    assert verb("change", "short_hop", code=1)[-1].endswith("while the mission is IDLE")
