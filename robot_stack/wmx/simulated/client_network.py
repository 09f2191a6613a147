"""The network of the simulated engine, as its clients see it."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING

from robot_stack.wmx.api.errors import EcErrorCode, ErrorCode, error_text
from robot_stack.wmx.api.status import EcMasterInfo
from robot_stack.wmx.simulated.network import from_wire

if TYPE_CHECKING:
    from robot_stack.wmx.simulated.client import WMX3Api


class Ecat:
    """One master, one slave per axis."""

    def __init__(self, api: WMX3Api) -> None:
        self._api = api

    def ScanNetwork(self, masterId: int = 0) -> int:
        return self._api.command("ScanNetwork", operator.index(masterId))

    def GetMasterInfo(self) -> tuple[int, EcMasterInfo]:
        code, values = self._api.call("GetMasterInfo")
        return code, EcMasterInfo() if code else from_wire(values[0])

    def RegisterRead(self, slaveId: int, regAddr: int, length: int) -> tuple[int, list[int]]:
        code, values = self._api.call(
            "RegisterRead", operator.index(slaveId), operator.index(regAddr), operator.index(length)
        )
        return code, [] if code else values[0]

    def ResetTransmitStatisticsInfo(self) -> int:
        return self._api.command("ResetTransmitStatisticsInfo")

    def StartHotconnect(self) -> int:
        return self._api.command("StartHotconnect")

    @staticmethod
    def ErrorToString(code: int) -> str:
        return error_text(code, EcErrorCode, ErrorCode)
