"""A battery of Pylontech's CAN protocol, and an adapter that brings its bus onto a serial line (slcan)."""

from __future__ import annotations

import struct
from dataclasses import dataclass

Frame = tuple[int, bytes]


@dataclass
class Battery:
    """Its data; protections and alarms: the two bytes of each."""

    voltage_v: float = 50.0
    current_a: float = -12.3
    temperature_c: float = 21.5
    charge_percent: int = 76
    health_percent: int = 98
    protections: bytes = b"\x00\x00"
    alarms: bytes = b"\x00\x00"
    requests: int = 0xC0

    def frames(self) -> list[Frame]:
        """The frames of each second."""
        volts, amperes, degrees = (
            round(self.voltage_v * 100),
            round(self.current_a * 10),
            round(self.temperature_c * 10),
        )
        return [
            (0x359, self.protections + self.alarms + b"\x01PN"),
            (0x351, struct.pack("<HhhH", 532, 250, 500, 450)),
            (0x355, struct.pack("<HH", self.charge_percent, self.health_percent)),
            (0x356, struct.pack("<hhh", volts, amperes, degrees)),
            (0x35C, bytes([self.requests, 0])),
            (0x35E, b"PYLON   "),
        ]


class SlcanAdapter:
    """The text protocol of CAN adapters on a serial line (LAWICEL): O opens the bus, t is a frame of 11 bits."""

    def __init__(self) -> None:
        self.is_open = False
        self.sent: list[Frame] = []  # by the host onto the bus
        self._rest = b""

    def answer_to(self, data: bytes) -> bytes:
        """Its answer to the host's data."""
        *lines, self._rest = (self._rest + data).split(b"\r")
        return b"".join(map(self._obey, lines))

    def _obey(self, line: bytes) -> bytes:
        if line[:1] in (b"O", b"C"):
            self.is_open = line[:1] == b"O"
        elif line[:1] == b"t" and self.is_open:
            self.sent.append((int(line[1:4], 16), bytes.fromhex(line[5:].decode())))
            return b"z\r"
        return b"\r"

    def from_bus(self, frame: Frame) -> bytes:
        """Its line for a frame of the bus."""
        number, data = frame
        return f"t{number:03X}{len(data)}{data.hex().upper()}\r".encode() if self.is_open else b""
