"""The supervisor's ROS side, in a thread of its own, from the moment ROS is imported."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robot_stack.supervisor.node import SupervisorNode

_JOIN_S = 2.0


class NodeThread:
    """``node`` is None until it is ready. ``error``: why there is none; None while there is."""

    def __init__(self) -> None:
        self.node: SupervisorNode | None = None
        self.error: str | None = None
        self._end: Callable[[], None] = lambda: None
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="node", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self.node = None
        self._ended = True
        self._end()
        self._thread.join(_JOIN_S)

    def _made(self, node: SupervisorNode, end: Callable[[], None]) -> None:
        self.node, self._end = node, end

    def _run(self) -> None:
        try:
            # Imported here, while the forkserver imports the same: neither waits for the other.
            from robot_stack.supervisor.node import run

            run(self._made, lambda: self._ended)
        except Exception as error:
            traceback.print_exc()
            self.node = None
            self.error = f"the supervisor has no node in the graph: {error}"
