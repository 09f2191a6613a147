"""The simulated EtherCAT network: one master."""

from __future__ import annotations

from robot_stack.wmx.api.errors import EcErrorCode, ErrorCode
from robot_stack.wmx.engine_server.state import Condition


class Network:
    """The master's knowledge."""

    def __init__(self, condition: Condition) -> None:
        self._condition = condition

    def scan(self, master: int) -> int:
        """ScanNetwork; refused while the bus runs, which it would disturb."""
        if master != 0:
            return ErrorCode.ArgumentOutOfRange
        return EcErrorCode.ScanNetworkFailed if self._condition.communicating else ErrorCode.PyNone
