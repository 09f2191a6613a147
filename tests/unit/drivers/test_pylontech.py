"""The battery byte by byte: frames, the state they combine to, and rejected values."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.config import load
from robot_stack.drivers.battery import Flow, Health
from robot_stack.drivers.pylontech.frames import (
    Charge,
    FrameRefused,
    Limits,
    Manufacturer,
    Measured,
    Protection,
    Requests,
    decode,
)
from robot_stack.drivers.pylontech.pack import OTHERS, REFUSED, TAKEN, Pack
from robot_stack.drivers.pylontech.params import PylontechDriverParams
from sim.devices.pylontech import Battery


def params(**changes: object) -> PylontechDriverParams:
    return load(PylontechDriverParams, "pylontech_driver", changes)


def pack_of(*batteries: Battery, now_s: float = 0.0) -> Pack:
    pack = Pack(params().pack)
    for battery in batteries:
        for number, data in battery.frames():
            pack.received(number, data, now_s)
    return pack


# --- frames -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "data", "frame"),
    [
        # Frames recorded from US5000 batteries.
        (0x351, "1402 C012 C012 C201", Limits(53.2, 480.0, 480.0)),
        (0x355, "5800 5E00", Charge(0.88, 0.94)),
        (0x355, "5400 6000 0000", Charge(0.84, 0.96)),
        (0x356, "7A13 F2FE 6B01", Measured(49.86, -27.0, 36.3)),
        (0x359, "0000 0000 0650 4E", Protection((), ())),
        (0x35C, "C000", Requests(True, True, False)),
        (0x35E, "5059 4C4F 4E20 2020", Manufacturer("PYLON")),
        # Other models send the discharge limit as a negative current, and charge requests.
        (0x351, "4402 6400 9CFF 3F02", Limits(58.0, 10.0, 10.0)),
        (0x35C, "60", Requests(False, True, True)),
        (0x35C, "90", Requests(True, False, True)),
        (0x305, "0000", None),
        (0x000, "", None),
    ],
)
def test_frames_are_read(number: int, data: str, frame: object) -> None:
    assert decode(number, bytes.fromhex(data)) == frame


@pytest.mark.parametrize(
    ("byte", "bit", "name"),
    [
        (0, 1, "over voltage"), (0, 2, "under voltage"), (0, 3, "over temperature"), (0, 4, "under temperature"),
        (0, 7, "discharge over current"), (1, 0, "charge over current"), (1, 3, "system error"),
    ],
)  # fmt: skip
def test_every_protection_and_its_alarm(byte: int, bit: int, name: str) -> None:
    flags = bytearray(2)
    flags[byte] = 1 << bit
    assert decode(0x359, bytes(flags) + b"\0\0\x01PN") == Protection((name,), ())
    assert decode(0x359, b"\0\0" + bytes(flags)) == Protection((), (name,))


@pytest.mark.parametrize(
    ("number", "data", "what"),
    [
        (0x351, "0000 0000 00", "frame 0x351 has 5 bytes, expected at least 6"),
        (0x355, "640064", "frame 0x355 has 3 bytes, expected at least 4"),
        (0x356, "", "frame 0x356 has 0 bytes, expected at least 6"),
        (0x359, "000000", "frame 0x359 has 3 bytes"),
        (0x35C, "", "frame 0x35C has 0 bytes"),
        (0x35E, "", "frame 0x35E has 0 bytes"),
        (0x355, "6500 6400", "charge is 101 %, health 100 %, expected at most 100 %"),
        (0x355, "6400 FFFF", "health 65535 %"),
    ],
)
def test_frames_that_cannot_be_are_refused_by_name(number: int, data: str, what: str) -> None:
    with pytest.raises(FrameRefused, match=what):
        decode(number, bytes.fromhex(data))


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_any_frame_is_survived(number: int, data: bytes) -> None:
    pack = Pack(params().pack)
    pack.received(number, data, 0.0)
    assert pack.reading(0.0) is None
    assert pack.problem(0.0)
    pack.values(0.0)


# --- together ---------------------------------------------------------------------------------------------------------


def test_a_battery_is_read() -> None:
    pack = pack_of(Battery(), now_s=10.0)
    reading = pack.reading(10.5)
    assert reading is not None
    assert (reading.time_s, reading.voltage_v, reading.current_a) == (10.0, 50.0, -12.3)
    assert (reading.charge, reading.capacity_ah, reading.temperature_c) == (0.76, pytest.approx(49.0), 21.5)
    assert (reading.flow, reading.health) == (Flow.DISCHARGING, Health.GOOD)
    assert pack.problem(10.5) == ""
    values = pack.values(10.5)
    assert (values["manufacturer"], values["protections"], values["alarms"]) == ("PYLON", "none", "none")
    assert (values["may be charged"], values["may be discharged"]) == ("with 25 A", "with 50 A")
    assert (values["asks to be charged"], values[TAKEN], values[REFUSED]) == ("no", "6", "0")


@pytest.mark.parametrize(
    ("current_a", "percent", "flow"),
    [
        (5.0, 50, Flow.CHARGING), (0.2, 50, Flow.IDLE), (0.2, 100, Flow.FULL), (5.0, 100, Flow.CHARGING),
        (-0.2, 99, Flow.IDLE), (-0.3, 100, Flow.DISCHARGING),
    ],
)  # fmt: skip
def test_where_the_current_flows(current_a: float, percent: int, flow: Flow) -> None:
    reading = pack_of(Battery(current_a=current_a, charge_percent=percent)).reading(0.0)
    assert reading is not None
    assert reading.flow is flow


@pytest.mark.parametrize("place", ["protections", "alarms"])
@pytest.mark.parametrize(
    ("flags", "health"),
    [
        (b"\x02\x00", Health.OVER_VOLTAGE), (b"\x04\x00", Health.EMPTY), (b"\x08\x00", Health.HOT),
        (b"\x10\x00", Health.COLD), (b"\x80\x00", Health.FAILURE), (b"\x00\x01", Health.FAILURE),
        (b"\x08\x08", Health.FAILURE), (b"\x12\x00", Health.OVER_VOLTAGE), (b"\x61\xf6", Health.GOOD),
    ],
)  # fmt: skip
def test_health_is_the_worst_complaint(place: str, flags: bytes, health: Health) -> None:
    pack = pack_of(Battery(**{place: flags}))
    reading = pack.reading(0.0)
    assert reading is not None
    assert reading.health is health
    assert bool(pack.problem(0.0)) == (place == "protections" and health is not Health.GOOD)


def test_battery_protections_and_requests_are_reported() -> None:
    assert pack_of(Battery(protections=b"\x88\x00")).problem(0.0) == (
        "the battery reports active protections: over temperature, discharge over current"
    )
    assert pack_of(Battery(requests=0x80)).problem(0.0) == "the battery does not allow discharging"
    assert pack_of(Battery(requests=0xB0)).values(0.0)["may be discharged"] == "no"
    assert pack_of(Battery(requests=0x60)).values(0.0)["may be charged"] == "no"
    assert pack_of(Battery(requests=0xE0)).values(0.0)["asks to be charged"] == "yes"


# --- old and nonsense -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("silent", "name"), [(0x355, "0x355"), (0x356, "0x356")])
def test_one_stale_frame_invalidates_reading(silent: int, name: str) -> None:
    pack = pack_of(Battery(), now_s=0.0)
    for number, data in Battery().frames():
        if number != silent:
            pack.received(number, data, 3.0)
    assert pack.reading(3.0) is not None
    assert pack.reading(3.1) is None
    assert pack.problem(3.1).startswith(f"no frame {name} ")


def test_battery_without_protection_frame_has_unknown_health() -> None:
    """Newer models send 0x35A instead of 0x359."""
    pack = Pack(params().pack)
    for number, data in Battery().frames():
        if number in (0x355, 0x356):
            pack.received(number, data, 0.0)
    reading = pack.reading(0.0)
    assert reading is not None
    assert reading.health is Health.UNKNOWN
    assert pack.problem(0.0) == ""
    assert pack.received(0x123, bytes(8), 0.0) is None
    assert pack.counters[OTHERS] == 1
    values = pack.values(0.0)
    assert {values[key] for key in ("manufacturer", "protections", "alarms", "may be charged")} == {"not received"}


@pytest.mark.parametrize(
    ("battery", "what"),
    [
        (Battery(voltage_v=0.0), r"the voltage is 0\.0 V, expected 30\.0 to 60\.0 V"),
        (Battery(voltage_v=327.0), r"the voltage is 327\.0 V"),
        (Battery(current_a=-3000.0), r"the current is -3000\.0 A, expected at most 300\.0 A"),
        (Battery(temperature_c=-273.0), r"the temperature is -273\.0 degrees, expected -40\.0 to 100\.0"),
        (Battery(temperature_c=150.0), r"the temperature is 150\.0"),
    ],
)
def test_implausible_frame_is_rejected_and_previous_reading_expires(battery: Battery, what: str) -> None:
    pack = pack_of(Battery(), battery)
    assert pack.counters[REFUSED] == 1
    assert re.search(what, pack.refusal)
    reading = pack.reading(0.0)
    assert reading is not None
    assert reading.voltage_v == 50.0
    for number, data in Battery().frames()[2:3]:
        pack.received(number, data, 4.0)
    assert pack.reading(4.0) is None
    assert f"0x356 (voltage, current) for 3 s, the last was refused: {pack.refusal}" in pack.problem(4.0)
