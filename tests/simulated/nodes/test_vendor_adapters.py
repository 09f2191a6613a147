"""The adapters of another vendor's cameras, inertial unit and battery with a fake driver."""

from __future__ import annotations

import itertools
from array import array
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import BatteryState, Image, Imu

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.middleware.conversions import time_from_s, time_to_s
from tests.simulated.bench import Bench

HEIGHT, WIDTH = 720, 1280


class Driver:
    """An adapter and the vendor's driver. changes: fields of the messages that follow. age_s: of their stamps."""

    def __init__(self, bench: Bench, name: str, row: Topic, parameters: dict[str, Any]) -> None:
        self.bench, self.row, self.name = bench, row, name
        self.age_s = 0.005
        self.changes: dict[str, Any] = {}
        self.stamps_s: list[float] = []
        self._diagnoses = bench.listen(topics.DIAGNOSTICS)
        bench.start(name, parameters)

    def stamped(self, message: Any, frame_id: str) -> Any:
        message.header.stamp = time_from_s(self.bench.stamp_s() - self.age_s)
        message.header.frame_id = frame_id
        self.stamps_s.append(time_to_s(message.header.stamp))
        for field, value in self.changes.items():
            setattr(message, field, value)
        return message

    def wait_report(self, text: str) -> dict[str, str]:
        """Waits for a new report with ``text``, and returns its values."""
        first = len(self._diagnoses.items)

        def reported() -> Any:
            return next(
                (
                    message.status[0]
                    for message in self._diagnoses.messages[first:]
                    if message.status[0].name == self.name and text in message.status[0].message
                ),
                None,
            )

        status = self.bench.wait(reported, f"{self.name}: {text}", 5.0)
        return {item.key: item.value for item in status.values}


def test_images_are_converted_thinned_and_stamped(bench: Bench) -> None:
    images, infos = bench.listen(topics.FRONT_IMAGE), bench.listen(topics.FRONT_CAMERA_INFO)
    row = topics.VENDOR_FRONT_IMAGE
    parameters = {"front.topic": row.name, "rear.topic": topics.VENDOR_REAR_IMAGE.name, "front.exposure_middle_s": 0.01}
    driver = Driver(bench, "camera_adapter", row, parameters)
    colours = array("B", np.full((HEIGHT, WIDTH, 3), (10, 20, 30), np.uint8).tobytes())

    def image() -> Image:
        made = Image(height=HEIGHT, width=WIDTH, encoding="bgr8", step=3 * WIDTH, data=colours)
        return driver.stamped(made, "front_camera_optical")

    driver.wait_report(f"{row.name} has no publisher")
    bench.repeat(row, image, 30.0)
    images.wait_next()
    begun_s = bench.now_s
    bench.run(2.0)
    seen = images.since(begun_s)
    assert len(seen) == pytest.approx(20, abs=1)
    newest, info = seen[-1], infos.last
    assert (newest.header.frame_id, newest.encoding, newest.step) == ("front_camera", "mono8", WIDTH)
    assert (np.frombuffer(newest.data, np.uint8) == round(0.114 * 10 + 0.587 * 20 + 0.299 * 30)).all()
    assert (info.header, info.width, info.height) == (newest.header, WIDTH, HEIGHT)
    exposed_s = time_to_s(newest.header.stamp) - 0.01
    assert min(abs(exposed_s - stamp_s) for stamp_s in driver.stamps_s) < 1e-6
    driver.changes = {"encoding": "yuv422"}
    values = driver.wait_report("encoding is 'yuv422', expected one of mono8")
    assert int(values["front messages refused"]) > 0
    begun_s = bench.now_s + 0.2
    bench.run(1.0)
    assert images.since(begun_s) == []
    driver.changes = {}
    bench.silence(row)
    driver.wait_report(f"{topics.VENDOR_REAR_IMAGE.name} has no publisher")


def test_samples_of_an_inertial_unit_and_its_faults(bench: Bench) -> None:
    samples, row = bench.listen(topics.IMU), topics.VENDOR_IMU
    driver = Driver(bench, "imu_adapter", row, {"topic": row.name})
    numbers, frozen = itertools.count(), []

    def imu() -> Imu:
        made = Imu()
        made.linear_acceleration.z = 9.8
        made.angular_velocity.z = 1e-3 * (frozen[0] if frozen else next(numbers))
        return driver.stamped(made, "imu_link")

    bench.repeat(row, imu, 100.0)
    samples.wait_next(30)
    driver.wait_report("samples arrive")
    assert samples.period_s() == pytest.approx(0.01, abs=1e-3)
    newest = samples.last
    assert (newest.header.frame_id, newest.orientation_covariance[0]) == ("imu", pytest.approx(0.004**2))
    frozen.append(next(numbers))
    driver.wait_report("the unit is frozen")
    frozen.clear()
    driver.wait_report("samples arrive")
    driver.age_s = 0.5
    driver.wait_report("for another clock set clock: device or arrival")
    driver.age_s = 0.005
    values = driver.wait_report("samples arrive")
    assert int(values["samples frozen"]) > 0
    bench.silence(row)
    driver.wait_report("is silent")
    begun_s = bench.now_s
    bench.run(1.0)
    assert samples.since(begun_s) == []


def test_a_battery_in_percent_and_one_without_a_charge(bench: Bench) -> None:
    states, row = bench.listen(topics.BATTERY_STATE), topics.VENDOR_BATTERY_STATE
    driver = Driver(bench, "battery_adapter", row, {"topic": row.name, "charge_in": "percent", "rate_hz": 5.0})

    def state() -> BatteryState:
        made = BatteryState(
            voltage=48.0, current=-5.0, percentage=57.0, capacity=45.0, temperature=20.0, present=True,
            power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
            power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_GOOD,
        )  # fmt: skip
        return driver.stamped(made, "")

    bench.repeat(row, state, 5.0)
    states.wait_next(5)
    driver.wait_report("readings arrive")
    assert states.period_s(3) == pytest.approx(1.0, abs=0.01)
    assert states.last.percentage == pytest.approx(0.57)
    assert states.last.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    driver.changes = {"percentage": float("nan")}
    driver.wait_report("it is not estimated from the voltage")
    driver.changes = {"power_supply_health": BatteryState.POWER_SUPPLY_HEALTH_OVERHEAT}
    driver.wait_report("the battery reports: too hot")
