"""The frames of Pylontech's low-voltage CAN protocol, 500 kbit/s, once a second each; little endian."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

LIMITS: Final = 0x351
CHARGE: Final = 0x355
MEASURED: Final = 0x356
PROTECTION: Final = 0x359
REQUESTS: Final = 0x35C
MANUFACTURER: Final = 0x35E
KEEP_ALIVE: Final = 0x305  # sent by the battery's user: some batteries stop sending without it
_SIZES: Final = {LIMITS: 6, CHARGE: 4, MEASURED: 6, PROTECTION: 4, REQUESTS: 1, MANUFACTURER: 1}
_FULL_PERCENT = 100

# (byte, bit) of PROTECTION. The first two bytes are protections, by which the battery switches itself off; the two
# after them alarms of the same places.
_PLACES: Final = {
    (0, 1): "over voltage",
    (0, 2): "under voltage",
    (0, 3): "over temperature",
    (0, 4): "under temperature",
    (0, 7): "discharge over current",
    (1, 0): "charge over current",
    (1, 3): "system error",
}


class FrameRefused(Exception):
    """An invalid frame. The message is one line: what was found and what was expected."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Present limits of the battery: V and A, both currents positive."""

    charge_voltage_v: float
    charge_current_a: float
    discharge_current_a: float


@dataclass(frozen=True, slots=True)
class Charge:
    """[0, 1] state of charge, and state of health relative to a new battery."""

    charge: float
    health: float


@dataclass(frozen=True, slots=True)
class Measured:
    """At the terminals: V, A (positive: charging), degrees Celsius."""

    voltage_v: float
    current_a: float
    temperature_c: float


@dataclass(frozen=True, slots=True)
class Protection:
    """protections: reasons why the battery has switched itself off; alarms: warnings before that."""

    protections: tuple[str, ...]
    alarms: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Requests:
    """Permissions and requests of the battery."""

    may_charge: bool
    may_discharge: bool
    must_charge: bool


@dataclass(frozen=True, slots=True)
class Manufacturer:
    name: str


Frame = Limits | Charge | Measured | Protection | Requests | Manufacturer


def decode(number: int, data: bytes) -> Frame | None:
    """A frame by its 11-bit identifier; None for other frames on the bus. Raises FrameRefused."""
    size = _SIZES.get(number)
    if size is None:
        return None
    if len(data) < size:
        raise FrameRefused(f"frame 0x{number:03X} has {len(data)} bytes, expected at least {size}")
    if number == LIMITS:
        voltage, charge, discharge = struct.unpack_from("<Hhh", data)
        return Limits(voltage / 10.0, abs(charge) / 10.0, abs(discharge) / 10.0)
    if number == CHARGE:
        return _charge(*struct.unpack_from("<HH", data))
    if number == MEASURED:
        voltage, current, temperature = struct.unpack_from("<hhh", data)
        return Measured(voltage / 100.0, current / 10.0, temperature / 10.0)
    if number == PROTECTION:
        return Protection(_set(data[0:2]), _set(data[2:4]))
    if number == REQUESTS:
        flags = data[0]
        return Requests(bool(flags & 0x80), bool(flags & 0x40), bool(flags & 0x30))
    return Manufacturer("".join(chr(byte) for byte in data if 0x20 < byte < 0x7F))


def _charge(charge: int, health: int) -> Charge:
    if charge > _FULL_PERCENT or health > _FULL_PERCENT:
        raise FrameRefused(f"charge is {charge} %, health {health} %, expected at most 100 %")
    return Charge(charge / 100.0, health / 100.0)


def _set(flags: bytes) -> tuple[str, ...]:
    return tuple(name for (byte, bit), name in _PLACES.items() if flags[byte] & (1 << bit))
