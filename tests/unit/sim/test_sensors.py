"""Inertial unit and battery."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.plant.battery import BatteryModel
from sim.plant.imu import ImuModel, ImuSample

from .bench import DRIVES, PARAMS

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
STILL = np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0])


def unit(seed: int = 1) -> ImuModel:
    return ImuModel(PARAMS.imu, 10, 0.001, np.random.default_rng(seed))


def feed(imu: ImuModel, steps: int, readings: np.ndarray = STILL, start: int = 0) -> list[tuple[float, ImuSample]]:
    got = []
    for step in range(start + 1, start + steps + 1):
        now = step * 0.001
        imu.measure(now, readings, LEVEL)
        sample = imu.sample(now)
        if sample is not None:
            got.append((now, sample))
    return got


def test_a_sample_every_10_ms_and_2_ms_late() -> None:
    got = feed(unit(), 105)
    assert [sample.time_s for _, sample in got] == pytest.approx([0.01 * k for k in range(1, 11)])
    assert [now - sample.time_s for now, sample in got] == pytest.approx([PARAMS.imu.latency_s] * 10)
    assert got == feed(unit(), 105)
    assert got != feed(unit(2), 105)


def test_a_sample_is_the_mean_of_its_period() -> None:
    """Half a period at 2 m/s2, half at 4: 3 m/s2, within noise and bias."""
    imu = unit()
    fast, slow = STILL.copy(), STILL.copy()
    slow[0], fast[0] = 2.0, 4.0
    for step in range(1, 11):
        imu.measure(step * 0.001, slow if step <= 5 else fast, LEVEL)
    sample = imu.sample(0.012)
    assert sample is not None
    assert sample.acceleration_mps2[0] == pytest.approx(3.0, abs=0.15)


def test_noise_has_the_configured_size_and_grows_by_the_factor() -> None:
    quiet = np.array([sample.rotation_radps for _, sample in feed(unit(), 5000)])
    loud_unit = unit()
    loud_unit.noise_factor = 10.0
    loud = np.array([sample.rotation_radps for _, sample in feed(loud_unit, 5000)])
    assert np.std(quiet) == pytest.approx(PARAMS.imu.gyroscope_noise_radps, rel=0.15)
    assert np.std(loud) == pytest.approx(10 * PARAMS.imu.gyroscope_noise_radps, rel=0.15)


def test_a_silent_unit_sends_nothing_and_a_frozen_one_repeats_itself() -> None:
    imu = unit()
    before = feed(imu, 20)[-1][1]
    imu.frozen = True
    frozen = [sample for _, sample in feed(imu, 50, start=20)]
    assert len(frozen) == 5
    assert {sample.rotation_radps for sample in frozen} == {before.rotation_radps}
    assert [sample.time_s for sample in frozen] == pytest.approx([0.02, 0.03, 0.04, 0.05, 0.06])
    imu.frozen = False
    assert feed(imu, 50, start=70)[-1][1].rotation_radps != before.rotation_radps
    imu.silent = True
    assert feed(imu, 50, start=120) == []


def test_heading_starts_at_zero_and_follows_turns() -> None:
    imu = unit()

    def heading(yaw: float, now: float) -> float:
        imu.measure(now, STILL, np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]))
        return yaw

    for step in range(1, 11):
        heading(2.0, step * 0.001)
    first = imu.sample(0.012)
    for step in range(11, 21):
        heading(2.5, step * 0.001)
    second = imu.sample(0.022)
    assert first is not None
    assert second is not None
    assert 2.0 * first.orientation_xyzw[2] == pytest.approx(0.0, abs=0.001)
    assert 2.0 * math.asin(second.orientation_xyzw[2]) == pytest.approx(0.5, abs=0.001)


def test_attitude_error_wanders_within_its_size() -> None:
    tilts = []
    for seed in range(40):
        sample = feed(unit(seed), 12)[0][1]
        x, y, z, w = sample.orientation_xyzw
        assert x * x + y * y + z * z + w * w == pytest.approx(1.0)
        tilts += [2.0 * x, 2.0 * y]
    assert np.std(tilts) == pytest.approx(PARAMS.imu.attitude_error_rad, rel=0.3)


def battery() -> BatteryModel:
    return BatteryModel(PARAMS.battery, np.random.default_rng(1))


def test_voltage_by_hand() -> None:
    """Charge 0.9: 13 x 4.05 V = 52.65 V open-circuit. 60 W idle: 1.141 A, 0.068 V internal drop."""
    pack = battery()
    assert pack.open_circuit_v() == pytest.approx(52.65)
    pack.draw(np.zeros(8), np.zeros(8), 0.0)
    reading = pack.read()
    assert reading.current_a == pytest.approx(-1.141, abs=0.002)
    assert reading.voltage_v == pytest.approx(52.58, abs=5 * PARAMS.battery.voltage_noise_v)
    assert reading.charge_ah == pytest.approx(27.0)
    for _ in range(3600):
        pack.draw(np.zeros(8), np.zeros(8), 1.0)
    # 60 W at about 52 V are 1.15 A: 3.8 % of 30 Ah in an hour.
    assert 0.9 - pack.charge == pytest.approx(60.0 / 52.5 / 30.0, rel=0.02)


def test_motors_draw_and_brakes_give_back() -> None:
    """10 Nm at 10 rad/s: 100 W mechanical, 125 W electrical, 50 W copper losses at 0.5 W/Nm2; braking: -80 + 50."""
    pack = battery()
    torque, speed = np.zeros(8), np.zeros(8)
    torque[DRIVES[0]], speed[DRIVES[0]] = 10.0, 10.0
    assert pack.power_w(torque, speed) == pytest.approx(60.0 + 125.0 + 50.0)
    assert pack.power_w(-torque, speed) == pytest.approx(60.0 - 80.0 + 50.0)


def test_an_empty_pack_stays_empty_and_a_short_circuit_stays_finite() -> None:
    pack = battery()
    for _ in range(10):
        pack.draw(np.full(8, 1e4), np.full(8, 1e3), 3600.0)
    assert pack.charge == 0.0
    assert math.isfinite(pack.read().voltage_v)


def test_charger_charges_pack_and_reports_charging():
    pack = battery()
    pack.charge = 0.5
    still = np.zeros(8)
    pack.draw(still, still, 1.0)
    assert not pack.read().charging
    pack.charger_w = 500.0
    pack.draw(still, still, 3600.0)
    reading = pack.read()
    assert reading.charging
    assert reading.current_a > 0.0
    # 500 W minus the computer's power, at about 50 V, for an hour.
    power_w = 500.0 - PARAMS.battery.idle_power_w
    assert pack.charge - 0.5 == pytest.approx(power_w / 49.0 / PARAMS.battery.capacity_ah, rel=0.1)
    pack.charger_w = PARAMS.battery.idle_power_w / 2.0
    pack.draw(still, still, 1.0)
    assert not pack.read().charging, "a charger that does not even feed the computer"
