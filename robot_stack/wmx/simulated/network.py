"""The simulated EtherCAT network: one master, one slave per axis, its counters, the registers of a slave.

Nothing travels anywhere: there is no transmission delay, and a packet is lost where the bus gives no answer. A register
that says nothing about a slave reads 0.
"""

from __future__ import annotations

import struct
from typing import Any, Final

from robot_stack.wmx.api.enums import EcHotconnectState, EcStateMachine
from robot_stack.wmx.api.errors import EcErrorCode, ErrorCode
from robot_stack.wmx.api.status import EcMasterInfo, EcMasterStatisticsInfo, EcSlaveInfo
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.simulated.state import Condition

REGISTERS: Final = 0x1000
FIRST_ADDRESS: Final = 1001
"""Station address of slave 0."""

_COMMAND_BYTES, _FEEDBACK_BYTES = 22, 24
"""Process data of one drive: what DriveCommands and DriveFeedback carry for one axis."""
_TYPE, _STATION_ADDRESS, _ALIAS, _AL_STATUS = 0x0000, 0x0010, 0x0012, 0x0130
_WATCHDOG_DIVIDER, _WATCHDOG_TIME = 0x0400, 0x0420
_DIVIDER, _WATCHDOG_STEPS = 0x09C2, 0x03E8
"""100 us steps, and 1000 of them: a drive lets go 100 ms after the last process data."""


class Network:
    """The master's knowledge. Counters count from the start of communication, or since they were reset."""

    def __init__(self, config: EngineConfig, condition: Condition) -> None:
        self._config = config
        self._condition = condition
        self._lost_before = self._overruns_before = 0
        self.timeouts = 0
        """How often the bus was given up."""

    def reset(self) -> None:
        """As in a new engine."""
        self._lost_before = self._overruns_before = self.timeouts = 0

    def scan(self, master: int) -> int:
        """ScanNetwork; refused while the bus runs, which it would disturb."""
        if master != 0:
            return ErrorCode.ArgumentOutOfRange
        return EcErrorCode.ScanNetworkFailed if self._condition.communicating else ErrorCode.PyNone

    def start_hotconnect(self) -> int:
        """StartHotconnect: there never is anything new on this network, and without communication nothing to join."""
        return ErrorCode.PyNone if self._condition.communicating else EcErrorCode.HotconnectFailed

    def reset_statistics(self) -> int:
        """ResetTransmitStatisticsInfo."""
        self._lost_before, self._overruns_before = self._condition.lost_cycles, self._condition.overruns
        self.timeouts = 0
        return ErrorCode.PyNone

    def info(self) -> EcMasterInfo:
        """GetMasterInfo."""
        condition, config = self._condition, self._config
        state = EcStateMachine.Op if condition.communicating else EcStateMachine.Init
        self._lost_before = min(self._lost_before, condition.lost_cycles)  # communication began anew
        statistics = EcMasterStatisticsInfo(
            commPeriod=round(1e9 * condition.cycle_time_s),
            cycleCounter=condition.cycles,
            packetLoss=condition.lost_cycles - self._lost_before,
            packetTimeout=self.timeouts,
            overCycle=condition.overruns - self._overruns_before,
            totalAxesNum=config.n_axes,
            totalRxPdoSize=_COMMAND_BYTES * config.n_axes,
            totalTxPdoSize=_FEEDBACK_BYTES * config.n_axes,
            totalInputSize=config.n_input_bytes,
            totalOutputSize=config.n_output_bytes,
            ringNum=1,
            hcState=EcHotconnectState.Idle,
        )
        slaves = [self._slave(axis, state) for axis in range(config.n_axes)]
        return EcMasterInfo(0, state, 0, config.n_axes, slaves, statistics)

    def _slave(self, axis: int, state: EcStateMachine) -> EcSlaveInfo:
        identity = self._config.axis_kind(axis).drive
        return EcSlaveInfo(
            id=axis,
            position=axis,
            address=FIRST_ADDRESS + axis,
            vendorId=identity.vendor_id if identity else 0,
            productCode=identity.product_code if identity else 0,
            revisionNo=identity.revision_no if identity else 0,
            serialNo=axis + 1,
            alias=axis + 1,
            numOfAxes=1,
            state=state,
        )

    def read_registers(self, slave: int, address: int, length: int) -> tuple[int, list[int]]:
        """RegisterRead: (code, bytes)."""
        in_range = 0 <= slave < self._config.n_axes and address >= 0 and 0 < length <= REGISTERS - address
        if not in_range:
            return ErrorCode.ArgumentOutOfRange, []
        memory = bytearray(REGISTERS)
        info = self._slave(slave, EcStateMachine.Op if self._condition.communicating else EcStateMachine.Init)
        memory[_TYPE] = 0x11
        for register, value in (
            (_STATION_ADDRESS, info.address),
            (_ALIAS, info.alias),
            (_AL_STATUS, info.state),
            (_WATCHDOG_DIVIDER, _DIVIDER),
            (_WATCHDOG_TIME, _WATCHDOG_STEPS),
        ):
            struct.pack_into("<H", memory, register, value)
        return ErrorCode.PyNone, list(memory[address : address + length])


def from_wire(data: dict[str, Any]) -> EcMasterInfo:
    """The record from plain names and values."""
    slaves = [EcSlaveInfo(**{**slave, "state": EcStateMachine(slave["state"])}) for slave in data.pop("slaves")]
    statistics = EcMasterStatisticsInfo(**data.pop("statisticsInfo"))
    return EcMasterInfo(**{**data, "state": EcStateMachine(data["state"])}, slaves=slaves, statisticsInfo=statistics)
