"""The simulated network: slaves, counters, registers."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.core.config import load
from robot_stack.wmx.api import EcErrorCode, EcStateMachine, ErrorCode
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.simulated.network import Network
from robot_stack.wmx.simulated.state import Condition
from tests.unit.wmx.harness import axis_kind, engine_config
from tests.unit.wmx.machine import Machine, machine


@pytest.fixture(scope="module")
def shared() -> Machine:
    return machine()


@pytest.fixture
def bench(shared: Machine) -> Machine:
    shared.restart()
    return shared


def counters(bench: Machine) -> tuple[int, int, int]:
    statistics = bench.engine.network.info().statisticsInfo
    return statistics.packetLoss, statistics.packetTimeout, statistics.overCycle


class TestCounters:
    def test_lost_packets_are_counted_and_forgotten(self, bench: Machine) -> None:
        assert counters(bench) == (0, 0, 0)
        bench.drives.lose_cycles = 3
        bench.run(10)
        bench.engine.condition.overruns += 2
        assert counters(bench) == (3, 0, 2)
        assert bench.engine.network.reset_statistics() == 0
        assert counters(bench) == (0, 0, 0)
        bench.drives.lose_cycles = 1
        bench.run(5)
        assert counters(bench) == (1, 0, 0)
        assert bench.engine.condition.lost_cycles == 4, "the status counts on"

    def test_a_bus_given_up_is_a_time_out(self, bench: Machine) -> None:
        bench.engine.network.reset_statistics()
        bench.drives.connected = False
        bench.run(30)
        loss, timeouts, _ = counters(bench)
        assert timeouts == 1
        assert loss == bench.engine.config.timing.bus_lost_cycles + 1
        info = bench.engine.network.info()
        assert {slave.state for slave in info.slaves} == {info.state} == {EcStateMachine.Init}

    def test_communication_counts_anew_after_a_reset(self, bench: Machine) -> None:
        bench.drives.lose_cycles = 5
        bench.run(10)
        bench.engine.network.reset_statistics()
        bench.engine.stop_communication()
        bench.engine.start_communication()
        bench.run(30)
        assert counters(bench)[0] == 0
        bench.drives.lose_cycles = 2
        bench.run(5)
        assert counters(bench)[0] == 2

    def test_sizes(self, bench: Machine) -> None:
        statistics = bench.engine.network.info().statisticsInfo
        assert statistics.totalInputSize == bench.engine.config.n_input_bytes
        assert statistics.totalOutputSize == bench.engine.config.n_output_bytes
        assert statistics.totalRxPdoSize % statistics.totalAxesNum == 0


class TestSlaves:
    def config(self, **drive: Any) -> EngineConfig:
        kinds = {"a": axis_kind(drive=drive or None), "b": axis_kind()}
        return engine_config(kinds=kinds, axes=[{"name": name, "kind": name} for name in kinds])

    def test_identity(self) -> None:
        config = self.config(vendor_id=0x66F, product_code=0x60380005, revision_no=7)
        first, second = Network(config, Condition(0.001)).info().slaves
        assert (first.vendorId, first.productCode, first.revisionNo) == (0x66F, 0x60380005, 7)
        assert (second.vendorId, second.productCode, second.revisionNo) == (0, 0, 0)
        assert (first.alias, second.alias) == (1, 2)
        assert (first.address, second.address) == (1001, 1002)

    def test_the_arms_drives(self) -> None:
        info = Network(load(EngineConfig, "wmx_engine_manipulator"), Condition(0.001)).info()
        assert {(slave.vendorId, slave.productCode) for slave in info.slaves} == {(0x66F, 0x60380005)}

    def test_registers(self) -> None:
        network = Network(self.config(), Condition(0.001))
        assert network.read_registers(1, 0x0010, 4) == (ErrorCode.PyNone, [0xEA, 0x03, 2, 0])
        assert network.read_registers(0, 0x0130, 1) == (ErrorCode.PyNone, [EcStateMachine.Init])
        assert network.read_registers(0, 0x0400, 2) == (ErrorCode.PyNone, [0xC2, 0x09])
        assert network.read_registers(0, 0x0420, 2) == (ErrorCode.PyNone, [0xE8, 0x03])
        assert network.read_registers(2, 0x0000, 1) == (ErrorCode.ArgumentOutOfRange, [])

    def test_scan_and_hot_connect(self, bench: Machine) -> None:
        network = bench.engine.network
        assert network.scan(0) == EcErrorCode.ScanNetworkFailed
        assert network.start_hotconnect() == 0
        bench.engine.stop_communication()
        assert network.scan(0) == 0
        assert network.scan(1) == ErrorCode.ArgumentOutOfRange
        assert network.start_hotconnect() == EcErrorCode.HotconnectFailed
