"""The battery driver behind an adapter on a real pseudo terminal: readings, complaints, a pulled cable."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from sensor_msgs.msg import BatteryState

from robot_stack.contract import topics
from sim.devices.pylontech import Battery, SlcanAdapter
from sim.devices.serial_line import SerialLine
from tests.support.peer import Peer, says
from tests.support.processes import Start
from tests.support.waiting import wait_for

PERIOD_S = 0.2  # five times the real rate, to shorten the test
NAME = "pylontech_driver"
SLCAN = ("-p", "can.interface:=slcan", "-p", "can.channel:=can")


class Bus:
    """A battery and its adapter on a cable that can be pulled."""

    def __init__(self, link: Path) -> None:
        self.line, self.adapter, self.battery = SerialLine(link), SlcanAdapter(), Battery()
        self.extra = b""
        self._turn, self._ended = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def plug(self) -> None:
        with self._turn:
            self.line.plug()

    def pull(self) -> None:
        with self._turn:
            self.line.pull()
            self.adapter.is_open = False

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            with self._turn:
                self.line.send(self.adapter.answer_to(self.line.received()))
                for frame in self.battery.frames():
                    self.line.send(self.adapter.from_bus(frame))
                if self.adapter.is_open:
                    self.line.send(self.extra)
                    self.extra = b""

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.pull()


@pytest.fixture
def bus(ros_domain: int) -> Iterator[Bus]:
    folder = Path(os.environ["ROBOT_STACK_RUNTIME_DIR"])
    folder.mkdir(parents=True, exist_ok=True)
    bus = Bus(folder / "can")
    yield bus
    bus.close()


def test_readings_complaints_and_a_pulled_cable(start: Start, peer: Peer, bus: Bus) -> None:
    states, diagnostics = peer.listen(topics.BATTERY_STATE), peer.listen(topics.DIAGNOSTICS)
    start(NAME, *SLCAN)
    bus.plug()
    wait_for(lambda: len(states.items) >= 3, "readings")
    state = states.last
    assert (state.voltage, state.current, state.percentage) == pytest.approx((50.0, -12.3, 0.76))
    assert (state.charge, state.capacity, state.temperature) == pytest.approx((0.76 * 49.0, 49.0, 21.5))
    assert state.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    assert state.power_supply_health == BatteryState.POWER_SUPPLY_HEALTH_GOOD
    assert says(diagnostics, NAME, "readings arrive")["manufacturer"] == "PYLON"
    wait_for(lambda: (0x305, bytes(8)) in bus.adapter.sent, "a keep-alive frame")
    # Warnings of the battery are reported, and readings continue.
    bus.battery = Battery(current_a=8.0, protections=b"\x08\x00")
    states.wait(
        lambda message: (
            message.power_supply_health == BatteryState.POWER_SUPPLY_HEALTH_OVERHEAT
            and message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING
        ),
        "a hot battery",
    )
    says(diagnostics, NAME, "the battery reports active protections: over temperature")
    # Garbage on the line costs a frame at most.
    bus.battery = Battery()
    bus.extra = b"tZZZ\r\xff\xfe\r"
    wait_for(lambda: int(says(diagnostics, NAME, "readings arrive")["frames corrupt"]) > 0, "a corrupt frame")
    # The cable is pulled, and plugged in again; old values are not repeated.
    bus.pull()
    says(diagnostics, NAME, "no frame 0x356 (voltage, current) and 0x355 (charge)")
    count = len(states.items)
    says(diagnostics, NAME, "no frame 0x356")
    assert len(states.items) == count
    bus.battery = Battery(charge_percent=74)
    bus.plug()
    states.wait(lambda message: message.percentage == pytest.approx(0.74), "a reading")


def test_missing_can_bus_is_reported(start: Start, peer: Peer) -> None:
    diagnostics = peer.listen(topics.DIAGNOSTICS)
    start(NAME, "-p", "can.channel:=can99")
    assert "can99" in says(diagnostics, NAME, "can99")["device"]
