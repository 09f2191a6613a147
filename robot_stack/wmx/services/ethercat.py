"""The EtherCAT network: state of a master and its slaves, registers, statistics, slaves connected while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.api.port import Ecat
from robot_stack.wmx.general.answers import Answer, failure

_REGISTERS = 0x1000

# Fields of the answer -> where the engine's record holds them.
MASTER = {
    "master_state": "state",
    "master_mode": "mode",
    "comm_period": "statisticsInfo.commPeriod",
    "total_axes": "statisticsInfo.totalAxesNum",
    "total_input_size": "statisticsInfo.totalInputSize",
    "total_output_size": "statisticsInfo.totalOutputSize",
    "ring_num": "statisticsInfo.ringNum",
    "total_rxpdo_size": "statisticsInfo.totalRxPdoSize",
    "total_txpdo_size": "statisticsInfo.totalTxPdoSize",
    "tx_delay": "statisticsInfo.txDelay",
    "min_tx_delay": "statisticsInfo.minTxDelay",
    "max_tx_delay": "statisticsInfo.maxTxDelay",
    "packet_loss": "statisticsInfo.packetLoss",
    "packet_timeout": "statisticsInfo.packetTimeout",
    "over_cycle": "statisticsInfo.overCycle",
    "num_of_slaves": "numOfSlaves",
}
SLAVES = {
    "slave_ids": "id",
    "slave_states": "state",
    "slave_al_codes": "alStatusCode",
    "slave_positions": "position",
    "slave_addresses": "address",
    "slave_vendor_ids": "vendorId",
    "slave_product_codes": "productCode",
    "slave_revision_nos": "revisionNo",
    "slave_serial_nos": "serialNo",
    "slave_aliases": "alias",
    "slave_input_addrs": "inputAddr",
    "slave_input_sizes": "inputSize",
    "slave_output_addrs": "outputAddr",
    "slave_output_sizes": "outputSize",
    "slave_num_of_axes": "numOfAxes",
}
SLAVE_FLAGS = {
    "slave_offline": "offline",
    "slave_inaccessible": "inaccessible",
    "slave_new": "newSlave",
    "slave_reverse": "reverseSlave",
}


@dataclass(frozen=True, slots=True)
class NetworkState:
    """master: fields of the answer -> values. slaves: fields of the answer -> one value per slave."""

    answer: Answer
    master: dict[str, int] = field(default_factory=dict)
    slaves: dict[str, list[int] | list[bool]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RegistersRead:
    """data: empty without success."""

    answer: Answer
    data: bytes = b""


def network_state(ecat: Ecat, master_id: int) -> NetworkState:
    """A master and its slaves."""
    what = f"Failed to get network state of master {master_id}"
    if master_id != 0:
        return NetworkState(_unknown_master(what, master_id))
    code, info = ecat.GetMasterInfo()
    if code:
        return NetworkState(failure(what, code, ecat.ErrorToString))
    master = {name: _number(info, path) for name, path in MASTER.items()}
    found = info.slaves[: info.numOfSlaves]
    slaves: dict[str, list[int] | list[bool]] = {
        name: [_number(slave, path) for slave in found] for name, path in SLAVES.items()
    }
    slaves |= {name: [bool(_number(slave, path)) for slave in found] for name, path in SLAVE_FLAGS.items()}
    return NetworkState(Answer(True, f"Master {master_id} with {len(found)} slaves"), master, slaves)


def read_registers(ecat: Ecat, master_id: int, slave_id: int, address: int, length: int) -> RegistersRead:
    """Registers of a slave."""
    what = f"Failed to read {length} register bytes of slave {slave_id} from {address:#05x}"
    if master_id != 0:
        return RegistersRead(_unknown_master(what, master_id))
    bad = _bad_registers(slave_id, address, length)
    if bad:
        return RegistersRead(Answer(False, f"{what}: {bad}"))
    code, values = ecat.RegisterRead(slave_id, address, length)
    if not code and len(values) != length:
        code = ErrorCode.ArgumentOutOfRange
    if code:
        return RegistersRead(failure(what, code, ecat.ErrorToString))
    return RegistersRead(
        Answer(True, f"Read {length} register bytes of slave {slave_id} from {address:#05x}"), bytes(values)
    )


def reset_statistics(ecat: Ecat, master_id: int) -> Answer:
    """Starts the counters of a master anew."""
    return _request(ecat, master_id, ecat.ResetTransmitStatisticsInfo, "reset statistics", "Statistics reset")


def start_hotconnect(ecat: Ecat, master_id: int) -> Answer:
    """Takes in slaves that were connected while the network communicates."""
    return _request(ecat, master_id, ecat.StartHotconnect, "start hot connect", "Hot connect started")


def _request(ecat: Ecat, master_id: int, request: Callable[[], int], doing: str, done: str) -> Answer:
    what = f"Failed to {doing} of master {master_id}"
    if master_id != 0:
        return _unknown_master(what, master_id)
    code = request()
    return failure(what, code, ecat.ErrorToString) if code else Answer(True, f"{done} of master {master_id}")


def _unknown_master(what: str, master_id: int) -> Answer:
    return Answer(False, f"{what}: master_id must be 0, is {master_id}")


def _bad_registers(slave_id: int, address: int, length: int) -> str:
    if slave_id < 0:
        return f"slave_id must not be negative, is {slave_id}"
    if not 0 <= address < _REGISTERS:
        return f"reg_address must be in 0..{_REGISTERS - 1:#x}, is {address:#x}"
    if not 0 < length <= _REGISTERS:
        return f"length must be in 1..{_REGISTERS}, is {length}"
    if address + length > _REGISTERS:
        return f"reg_address and length together must be at most {_REGISTERS:#x}, are {address + length:#x}"
    return ""


def _number(record: object, path: str) -> int:
    for name in path.split("."):
        record = getattr(record, name)
    assert isinstance(record, int)
    return int(record)
