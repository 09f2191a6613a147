"""A battery over Modbus: registers as in the vendor's own register test, blocks, and impossible values."""

from __future__ import annotations

import itertools
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.config import ConfigError, config_dir, load, read_yaml, validate
from robot_stack.drivers.battery import Flow, Health
from robot_stack.drivers.modbus.battery import REFUSED, TAKEN, Block, ModbusBattery, blocks
from robot_stack.drivers.modbus.params import ModbusBatteryDriverParams
from tests.support.devices.modbus import Registers, crc

# From the tests of Victron's dbus_modbustcp: a battery of 52 V, +11 A, 34.5 degrees, 85 %, 99 % health, and its
# register values. That test raises every alarm to 1.
VENDOR = {259: 5200, 261: 110, 262: 345, 266: 850, 304: 990}
ALARMS = dict.fromkeys((268, 269, 273, 274, 278, 279, 320, 321, 323, 324, 325), 0)


def params() -> ModbusBatteryDriverParams:
    return load(ModbusBatteryDriverParams, "modbus_battery_driver")


def battery() -> ModbusBattery:
    made = params()
    return ModbusBattery(made.registers, made.alarms, made.pack)


def test_registers_of_the_vendor_s_own_test() -> None:
    reading = battery().received(VENDOR | ALARMS, 7.0)
    assert reading is not None
    assert (reading.time_s, reading.voltage_v, reading.current_a, reading.charge) == (7.0, 52.0, 11.0, 0.85)
    assert (reading.temperature_c, reading.capacity_ah) == (34.5, pytest.approx(0.99 * 50.0))
    assert (reading.flow, reading.health) == (Flow.CHARGING, Health.GOOD)


def test_a_current_below_zero_discharges() -> None:
    reading = battery().received(VENDOR | ALARMS | {261: 0x10000 - 123, 262: 0x10000 - 55}, 0.0)
    assert reading is not None
    assert (reading.current_a, reading.temperature_c, reading.flow) == (-12.3, -5.5, Flow.DISCHARGING)


@pytest.mark.parametrize(
    ("address", "health", "says"),
    [
        (323, Health.FAILURE, "failure"),
        (274, Health.HOT, "too hot"),
        (269, Health.OVER_VOLTAGE, "over voltage"),
        (268, Health.EMPTY, "under voltage"),
        (325, Health.COLD, "too cold"),
    ],
)
def test_alarms(address: int, health: Health, says: str) -> None:
    made = battery()
    reading = made.received(VENDOR | ALARMS | {address: 2}, 0.0)
    assert reading is not None
    assert reading.health is health
    assert made.problem(0.0) == f"the battery reports faults: {says}"
    assert made.values(0.0)["alarms"] == says.replace(" ", "_")


def test_missing_registers_are_reported_as_unknown() -> None:
    made = battery()
    reading = made.received({259: 5200, 261: 0, 266: 1000}, 0.0)
    assert reading is not None
    assert math.isnan(reading.temperature_c)
    assert (reading.capacity_ah, reading.flow, reading.health) == (50.0, Flow.FULL, Health.UNKNOWN)
    assert made.values(0.0)["registers it lacks"].startswith("262, 268, 269")


@pytest.mark.parametrize(
    ("raw", "says"),
    [
        ({}, "the device refuses register 259 and 261 and 266"),
        ({259: 5200, 261: 0}, "the device refuses register 266"),
        (VENDOR | {259: 0xFFFF}, "the voltage is 655.35 V, expected 30.0 to 60.0 V"),
        (VENDOR | {261: 0x7FFF}, "the current is 3276.7 A, expected at most 300.0 A"),
        (VENDOR | {262: 0x7FFF}, "the temperature is 3276.7 degrees"),
        (VENDOR | {266: 0xFFFF}, "the charge is 6553.5 %, expected 0 to 100 %"),
        (VENDOR | {304: 0}, "the state of health is 0 %"),
    ],
)
def test_implausible_reading_is_rejected_and_previous_reading_expires(raw: dict[int, int], says: str) -> None:
    made = battery()
    assert made.received(VENDOR | ALARMS, 0.0) is not None
    assert made.received(raw, 1.0) is None
    assert says in made.refusal
    assert made.reading(2.9) is not None
    assert made.reading(-1.0) is None, "the time ran back"
    assert made.reading(3.1) is None
    assert made.problem(3.1) == f"no valid response for 3 s, the last was refused: {made.refusal}"
    assert (made.counters[TAKEN], made.counters[REFUSED]) == (1, 1)


@given(st.dictionaries(st.integers(255, 330), st.integers(0, 0xFFFF)))
def test_whatever_is_answered_a_reading_can_be_true(raw: dict[int, int]) -> None:
    reading = battery().received(VENDOR | raw, 0.0)
    if reading is not None:
        assert 30.0 <= reading.voltage_v <= 60.0
        assert abs(reading.current_a) <= 300.0
        assert 0.0 <= reading.charge <= 1.0
        assert 0.0 < reading.capacity_ah <= 50.0


@given(st.sets(st.integers(0, 65535), max_size=40))
def test_blocks_hold_each_register_once_and_no_other(addresses: set[int]) -> None:
    found = blocks(addresses)
    assert [address for first, count in found for address in range(first, first + count)] == sorted(addresses)
    assert all(before.first + before.size < after.first for before, after in itertools.pairwise(found))
    assert battery().blocks()[:3] == (Block(259, 1), Block(261, 2), Block(266, 1))


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("registers.voltage.per_unit", 0.0, "per_unit must not be 0"),
        ("registers.charge", None, "registers.charge: "),
        ("modbus.unit", 256, "modbus.unit: "),
        ("modbus.transport", "ascii", "modbus.transport: "),
    ],
)
def test_wrong_parameters_are_named(key: str, value: object, says: str) -> None:
    data = read_yaml(config_dir() / "modbus_battery_driver.yaml")
    *folders, name = key.split(".")
    place = data
    for folder in folders:
        place = place[folder]
    place[name] = value
    with pytest.raises(ConfigError, match=re.escape(says)):
        validate(ModbusBatteryDriverParams, data, "here")


# --- the device that tests ask, against published frames -------------------------------------------------------------


def test_frames_of_the_modicon_guide() -> None:
    """Requests registers 108 to 110 from device 17."""
    device = Registers(0x11, {0x6B: 0xAE41, 0x6C: 0x5652, 0x6D: 0x4340})
    assert device.over_serial(bytes.fromhex("1103006B00037687")) == bytes.fromhex("110306AE4156524340 49AD")
    assert device.over_serial(bytes.fromhex("1103006B00037688")) == b"", "a broken sum"
    assert device.over_serial(bytes.fromhex("1203006B000376B4")) == b"", "another device's"
    assert device.over_tcp(bytes.fromhex("0001 0000 0006 11 03 006B 0003")) == bytes.fromhex(
        "0001 0000 0009 11 03 06 AE41 5652 4340"
    )
    assert device.answer(bytes.fromhex("03 006A 0003")) == bytes([0x83, 0x02])
    assert crc(bytes.fromhex("0A8102")) == bytes.fromhex("B053")
