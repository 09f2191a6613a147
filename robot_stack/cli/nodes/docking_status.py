"""Subscribes to /docking/status for ``robot-stack docking status``."""

from __future__ import annotations

import time
from collections.abc import Callable

from custom_msgs.msg import DockingStatus
from robot_stack.cli.errors import NoAnswer
from robot_stack.cli.nodes.operator import Operator
from robot_stack.contract import topics
from robot_stack.docking.tools.status_line import describe, silent

_SILENT = "SILENT"


def watch_docking(show: Callable[[str, str], None], timeout_s: float, follow: bool) -> None:
    """Calls ``show(state, line)`` with each status until interrupted, or once. Raises NoAnswer without a status."""
    received: list[DockingStatus] = []
    with Operator() as operator:
        operator.subscribe(topics.DOCKING_STATUS, received.append)
        if not operator.wait(lambda: received, timeout_s):
            raise NoAnswer("no /docking/status: is the stack running?")
        received_s = time.monotonic()
        while True:
            if received:
                message = received[-1]
                received.clear()
                received_s = time.monotonic()
                show(
                    message.state,
                    describe(
                        message.state,
                        message.position_error,
                        message.orientation_error,
                        message.visible_markers_count,
                        message.convergence_progress,
                    ),
                )
            else:
                show(_SILENT, silent(time.monotonic() - received_s))
            if not follow:
                return
            operator.wait(lambda: received, topics.DOCKING_STATUS.stale_s)
