"""The Modbus battery driver and a device on a real socket, and on a real pseudo terminal."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from sensor_msgs.msg import BatteryState

from robot_stack.contract import topics
from sim.devices.serial_line import SerialLine
from tests.support.devices.modbus import Registers, TcpDevice
from tests.support.peer import Peer, says
from tests.support.processes import Start
from tests.support.waiting import wait_for
from tests.unit.drivers.test_modbus_battery import ALARMS, VENDOR

NAME, UNIT = "modbus_battery_driver", 225
# A pseudo terminal does not support parity.
SERIAL = ("-p", "modbus.transport:=rtu", "-p", "modbus.serial_port:=battery", "-p", "modbus.parity:=none")
QUICK = ("-p", "modbus.poll_s:=0.1", "-p", "modbus.reopen_s:=0.2")


def over_tcp(port: int) -> tuple[str, ...]:
    return (*QUICK, "-p", "modbus.host:=127.0.0.1", "-p", f"modbus.port:={port}")


@pytest.fixture
def device() -> Iterator[TcpDevice]:
    made = TcpDevice(Registers(UNIT, VENDOR | ALARMS))
    yield made
    made.close()


def test_readings_alarms_a_pulled_cable_and_registers_it_lacks(start: Start, peer: Peer, device: TcpDevice) -> None:
    states, diagnostics = peer.listen(topics.BATTERY_STATE), peer.listen(topics.DIAGNOSTICS)
    start(NAME, *over_tcp(device.port))
    wait_for(lambda: len(states.items) >= 3, "readings")
    state = states.last
    assert (state.voltage, state.current, state.percentage) == pytest.approx((52.0, 11.0, 0.85))
    assert (state.temperature, state.capacity, state.charge) == pytest.approx((34.5, 49.5, 0.85 * 49.5))
    assert state.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING
    assert state.power_supply_health == BatteryState.POWER_SUPPLY_HEALTH_GOOD
    assert says(diagnostics, NAME, "readings arrive")["device"] == f"battery on 127.0.0.1:{device.port} is open"

    device.registers.values[274] = 2
    states.wait(lambda m: m.power_supply_health == BatteryState.POWER_SUPPLY_HEALTH_OVERHEAT, "a hot battery")
    says(diagnostics, NAME, "the battery reports faults: too hot")
    # The cable is pulled: nothing old is repeated. Then a device that lacks registers.
    device.close()
    says(diagnostics, NAME, "no valid response for 3 s")
    count = len(states.items)
    says(diagnostics, NAME, "no valid response")
    assert len(states.items) == count
    bare = TcpDevice(Registers(UNIT, {259: 5000, 261: 0, 266: 500}), device.port)
    try:
        states.wait(lambda message: message.percentage == pytest.approx(0.5), "a reading")
        assert math.isnan(states.last.temperature)
        assert states.last.power_supply_health == BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN
        assert says(diagnostics, NAME, "readings arrive")["registers it lacks"].startswith("262, ")
    finally:
        bare.close()


class SerialDevice:
    """The same on a serial line, with bytes that arrive in pieces."""

    def __init__(self, link: Path, registers: Registers) -> None:
        self.line, self.registers, self.noise = SerialLine(link), registers, b""
        self._ended, self._heard = threading.Event(), b""
        self.line.plug()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.wait(0.002):
            self._heard += self.line.received()
            while len(self._heard) >= 8:
                request, self._heard = self._heard[:8], self._heard[8:]
                answer = self.noise + self.registers.over_serial(request)
                self.noise = b""
                self.line.send(answer[:3])
                self.line.send(answer[3:])

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.line.pull()


def test_a_serial_line_with_noise(start: Start, peer: Peer, ros_domain: int) -> None:
    folder = Path(os.environ["ROBOT_STACK_RUNTIME_DIR"])
    folder.mkdir(parents=True, exist_ok=True)
    device = SerialDevice(folder / "battery", Registers(UNIT, VENDOR | ALARMS))
    try:
        states = peer.listen(topics.BATTERY_STATE)
        start(NAME, *QUICK, *SERIAL)
        wait_for(lambda: len(states.items) >= 3, "readings")
        assert states.last.voltage == pytest.approx(52.0)
        device.noise = b"\xff\x00\x13"
        wait_for(lambda: not device.noise, "noise on the line")
        device.registers.values[266] = 840
        states.wait(lambda message: message.percentage == pytest.approx(0.84), "a reading")
        assert all(29.0 < message.voltage < 61.0 for message in states.messages)
    finally:
        device.close()
