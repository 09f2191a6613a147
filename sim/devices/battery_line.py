"""The simulated battery as a Pylontech battery, whose CAN bus ends in an adapter on a serial line."""

from __future__ import annotations

from pathlib import Path

from sim.devices.pylontech import Battery, SlcanAdapter
from sim.devices.serial_line import SerialLine
from sim.plant.battery import BatteryReading


class BatteryLine:
    """link: path of the terminal."""

    def __init__(self, link: Path) -> None:
        self._line, self._adapter = SerialLine(link), SlcanAdapter()
        self._line.plug()

    def send(self, reading: BatteryReading) -> None:
        """The frames of one second."""
        self._line.send(self._adapter.answer_to(self._line.received()))
        self._adapter.sent.clear()
        battery = Battery(
            voltage_v=reading.voltage_v,
            current_a=reading.current_a,
            temperature_c=reading.temperature_c,
            charge_percent=round(100.0 * reading.charge),
            health_percent=100,
        )
        for frame in battery.frames():
            self._line.send(self._adapter.from_bus(frame))
