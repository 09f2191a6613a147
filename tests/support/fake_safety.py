"""A minimal safety monitor for tests of nodes that call it."""

from __future__ import annotations

from typing import Any

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import services, topics


class FakeSafety:
    """Reports the last requested state; attributes control the answers. peer: a ROS peer or a scheduler peer."""

    def __init__(self, peer: Any) -> None:
        self.obeys = True
        self.refusals: list[str] = []
        self.active = False
        self.requests: list[bool] = []
        peer.listen(topics.EMERGENCY_STOP, self._on_request)
        peer.repeat(topics.SAFETY_STATUS, self._status, 10.0)
        self.cleared: list[str] = []
        self.uncleared = ""
        peer.serve(services.SAFETY_RESET, self._on_reset)
        peer.serve(services.CLEAR_EMERGENCY_STOP, self._on_clear)

    def _on_request(self, message: Any) -> None:
        self.requests.append(message.data)
        if message.data and self.obeys:
            self.active = True

    def _status(self) -> SafetyStatus:
        state = "EMERGENCY_STOP" if self.active else "NORMAL"
        return SafetyStatus(safety_state=state)

    def _on_clear(self, request: Any, response: Any) -> Any:
        self.cleared.append(request.source)
        response.success = not self.uncleared
        response.message = self.uncleared or f"cleared: {request.source}"
        return response

    def _on_reset(self, _: Any, response: Any) -> Any:
        if self.refusals:
            response.message = self.refusals.pop(0)
            return response
        self.active = False
        response.success, response.message = True, "released: ESTOP_PRESSED"
        return response
