"""The base of nodes that only offer services of the motion engine: a device, found again whenever it was lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_stack.contract.model import Service
from robot_stack.ros.node import StackNode
from robot_stack.wmx import MotionEngine, connect
from robot_stack.wmx.api import ErrorCode, error_text
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.general.answers import Answer, failure
from robot_stack.wmx.link import EngineLink
from robot_stack.wmx.services.parameters import ServiceNodeParams

_POLL_HZ = 10.0


class ServiceNode(StackNode):
    """Moves nothing: its device has no axes to stop and needs no watchdog."""

    def __init__(self, name: str) -> None:
        super().__init__(name, ServiceNodeParams)
        client = load_client_config()
        self._link = EngineLink(
            lambda: connect(name, client, timeout_s=0.0), retry_s=self.params.retry_s, feed_period_s=1.0, watchdog_s=0.0
        )
        self.every(_POLL_HZ, self._poll)

    def offer(self, row: Service, failed: str, serve: Callable[[MotionEngine, Any, Any], None]) -> None:
        """``serve(engine, request, response)`` answers a contract row's service while there is an engine."""

        def callback(request: Any, response: Any) -> Any:
            self._link.poll(self.steady_s())
            if self._link.engine is None:
                fill(response, failure(failed, ErrorCode.DeviceIsNull, lambda code: error_text(code, ErrorCode)))
            else:
                serve(self._link.engine, request, response)
            return response

        self.serve(row, callback)

    def _poll(self) -> None:
        """A device of an engine that was stopped or restarted is worthless."""
        self._link.poll(self.steady_s())
        connected = self._link.read() is not None
        self.set_health(connected, "ready" if connected else self._link.problem)

    def safe_output(self) -> None:
        self._link.close()


def fill(response: Any, answer: Answer) -> None:
    response.success, response.message = answer.success, answer.message
