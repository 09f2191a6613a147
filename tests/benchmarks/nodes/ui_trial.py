"""Hostile requests against the real process of the touch screen, alone in the ROS domain of the environment.

    python -m tests.benchmarks.nodes.ui_trial REQUESTS SEED

prints figures as JSON. The server requires a token, which the attacker's pages have and its other requests lack.
"""

from __future__ import annotations

import http.client
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from robot_stack.contract import topics
from robot_stack.core.runtime import touch_screen_url
from robot_stack.ros import transport
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.tool_node import ToolNode
from robot_stack.ui.pin import hash_pin
from tests.benchmarks.support.framework import BenchError, percentile
from tests.benchmarks.support.ui_hostile import Outcome, Target, attack

_ROWS = (topics.UI_COMMAND, topics.TELEOP_CMD_VEL, topics.INITIAL_POSE, topics.GOAL_POSE, topics.EMERGENCY_STOP)
_TOKEN, _PIN = "a-token-that-is-known-to-the-pages-alone", "135792468013"
_READY_S = 60.0
# Log texts of asyncio, uvicorn and threading for an uncaught exception.
_UNCAUGHT = (
    "Exception in ASGI application",
    "exception was never retrieved",
    "Exception in callback",
    "Exception in thread",
)


class Trial:
    """log: output of the server's process. changes: messages on the topics that move, place or stop the robot."""

    def __init__(self, log: Path) -> None:
        transport.apply()
        self._log = log
        self._tool = ToolNode("ui_trial")
        self.changes = 0
        for row in _ROWS:
            self._tool.node.create_subscription(
                interface_class(row.type), row.name, self._on_message, qos_profile(row.qos)
            )
        self._tool.spin_beside("ui_trial")
        settings = {"server.port": 0, "server.token": _TOKEN, "access.pin_hash": hash_pin(_PIN), "pages.map": ""}
        arguments = [word for name, value in settings.items() for word in ("-p", f"{name}:={_yaml(value)}")]
        command = [sys.executable, "-m", "robot_stack.ros.main", "touch_ui", "--ros-args", *arguments]
        with open(log, "wb") as output:
            self._process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)

    def close(self) -> None:
        self._process.terminate()
        self._process.wait()
        self._tool.close()

    def target(self) -> Target:
        """The server's address and cookie. Raises BenchError without a server or without its publishers."""
        self._wait(lambda: touch_screen_url() is not None, "the touch screen's address")
        self._wait(lambda: all(self._tool.node.count_publishers(row.name) for row in _ROWS), "its publishers")
        return Target(urlsplit(touch_screen_url() or "").netloc, f"touch_ui={_TOKEN}")

    def serves(self, target: Target) -> bool:
        """True if the process runs and still serves a valid page."""
        if self._process.poll() is not None:
            return False
        connection = http.client.HTTPConnection(target.place, timeout=20)
        try:
            connection.request("GET", "/", headers={"Cookie": target.cookie})
            return connection.getresponse().status == 200
        except OSError:
            return False
        finally:
            connection.close()

    def uncaught(self) -> int:
        text = self._log.read_text(encoding="utf-8", errors="replace")
        return sum(text.count(words) for words in _UNCAUGHT)

    def _on_message(self, _: Any) -> None:
        self.changes += 1

    def _wait(self, condition: Callable[[], bool], what: str) -> None:
        end_s = time.monotonic() + _READY_S
        while not condition():
            if self._process.poll() is not None or time.monotonic() > end_s:
                raise BenchError(f"no {what}: {self._log.read_text(errors='replace')[-500:]}")
            time.sleep(0.05)


def _yaml(value: object) -> str:
    return json.dumps(value)


def figures(trial: Trial, target: Target, outcome: Outcome) -> dict[str, float]:
    crashed = not trial.serves(target)
    return {
        "hostile_requests": outcome.tried,
        "state_changes_by_them": trial.changes,
        "hostile_accepted": len(outcome.accepted),
        "hostile_server_errors": len(outcome.errors),
        "hostile_unanswered": len(outcome.unanswered),
        "hostile_crashes": trial.uncaught() + crashed,
        "hostile_answer_ms_p95": percentile(outcome.answers_ms, 0.95),
    }


def main() -> None:
    count, seed = int(sys.argv[1]), int(sys.argv[2])
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "touch_ui.log"
        trial = Trial(log)
        try:
            target = trial.target()
            outcome = attack(target, count, seed)
            result = figures(trial, target, outcome)
        except BenchError as error:
            raise SystemExit(f"error: {error}") from error
        finally:
            trial.close()
        for line in (*outcome.accepted[:5], *outcome.errors[:5], *outcome.unanswered[:5]):
            print(line, file=sys.stderr)
        if result["hostile_crashes"]:
            print(log.read_text(errors="replace")[-3000:], file=sys.stderr)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
