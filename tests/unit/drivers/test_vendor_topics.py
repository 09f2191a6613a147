"""Adapters of other vendors' cameras, inertial units and batteries: conversions, stamps, and what is rejected."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.core.config import ConfigError, load, validate
from robot_stack.drivers.battery import Flow, Health, Reading
from robot_stack.drivers.imu import Sample
from robot_stack.drivers.vendor.battery import BatteryAdapterParams, complaint, reading
from robot_stack.drivers.vendor.image import CameraAdapterParams, CameraTopicParams, Picture, grey
from robot_stack.drivers.vendor.imu import FROZEN, IMPLAUSIBLE, NOT_FINITE, ImuAdapter, ImuAdapterParams
from robot_stack.drivers.vendor.topic import (
    DOUBLED,
    JUMPS,
    LOST,
    OUT_OF_ORDER,
    MessageRefused,
    VendorTopic,
    VendorTopicParams,
)

DEVICE = {"window_s": 60.0, "drift_max_ppm": 200.0, "jump_s": 0.05, "confirm_s": 2.0}
TOPIC = {
    "topic": "/vendor/data", "rate_hz": 10.0, "reliability": "best_effort", "clock": "header", "latency_s": 0.0,
    "device": None, "future_s": 0.01, "oldest_s": 0.3, "silence_s": 0.5,
}  # fmt: skip
NOW_S = 1000.0


def topic(contract_hz: float = 10.0, **changes: object) -> VendorTopic:
    return VendorTopic(validate(VendorTopicParams, TOPIC | changes, "topic"), contract_hz)


# --- stamps ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("age_s", [-0.009, 0.0, 0.299])
def test_a_header_by_this_computers_clock_is_the_stamp(age_s: float) -> None:
    assert topic().stamp(NOW_S - age_s, NOW_S) == NOW_S - age_s


@pytest.mark.parametrize("age_s", [-0.02, 0.31, NOW_S])
def test_a_header_by_another_clock_is_refused(age_s: float) -> None:
    with pytest.raises(MessageRefused, match=r"for another clock set clock: device or arrival"):
        topic().stamp(NOW_S - age_s, NOW_S)


def test_arrivals_date_messages_without_stamps() -> None:
    made = topic(clock="arrival", latency_s=0.02)
    assert [made.stamp(0.0, NOW_S + 0.1 * i) for i in range(3)] == pytest.approx(
        [NOW_S + 0.1 * i - 0.02 for i in range(3)]
    )


def test_a_devices_clock_is_converted_and_its_jumps_counted() -> None:
    made = topic(clock="device", device=DEVICE, latency_s=0.01)
    delays_s = [0.0, 0.004, 0.001, 0.003]
    stamps = [made.stamp(5.0 + 0.1 * i, NOW_S + 0.1 * i + delay_s) for i, delay_s in enumerate(delays_s)]
    assert stamps == pytest.approx([NOW_S + 0.1 * i - 0.01 for i in range(4)])
    made.stamp(0.1, NOW_S + 0.5)
    assert made.counters[JUMPS] == 1


@pytest.mark.parametrize(("step_s", "name"), [(0.0, DOUBLED), (-0.05, OUT_OF_ORDER)])
def test_repeated_and_old_messages_are_counted_and_refused(step_s: float, name: str) -> None:
    made = topic()
    made.stamp(NOW_S, NOW_S)
    with pytest.raises(MessageRefused, match="expected a newer one"):
        made.stamp(NOW_S + step_s, NOW_S + 0.01)
    assert made.counters[name] == 1
    made.stamp(NOW_S + 0.3, NOW_S + 0.3)
    assert made.counters[LOST] == 2


def test_this_computers_clock_may_be_set_back() -> None:
    made = topic(contract_hz=5.0)
    made.stamp(NOW_S, NOW_S)
    assert made.stamp(NOW_S - 50.0, NOW_S - 50.0) == NOW_S - 50.0
    assert made.counters[JUMPS] == 1


@pytest.mark.parametrize(("driver_hz", "kept"), [(10.0, 100), (5.0, 50), (15.0, 100), (60.0, 100)])
def test_faster_drivers_are_thinned_to_the_topics_rate(driver_hz: float, kept: int) -> None:
    made = topic(rate_hz=driver_hz)
    jitter_s = 0.2 / driver_hz * np.random.default_rng(3).uniform(-1.0, 1.0, round(10.0 * driver_hz))
    stamps = [NOW_S + i / driver_hz + shift_s for i, shift_s in enumerate(jitter_s)]
    assert sum(made.stamp(stamp_s, stamp_s) is not None for stamp_s in stamps) == pytest.approx(kept, abs=2)


def test_problem_names_publisher_silence_and_refusal() -> None:
    made = topic(reliability="reliable")
    assert "has no publisher" in made.problem(0.0, 0)
    assert "set reliability: best_effort" in made.problem(0.0, 1)
    made.refused("too odd")
    assert made.problem(0.1, 1) == "/vendor/data refused: too odd"
    assert "has no publisher" in made.problem(0.1, 0)
    made.used(0.2)
    assert made.problem(0.7, 1) == ""
    assert "is silent" in made.problem(0.71, 1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("topic", "data"), ("clock", "device"), ("device", DEVICE),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_refused(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match="device" if name == "clock" and value == "device" else name):
        topic(**{name: value})


# --- camera ----------------------------------------------------------------------------------------------------------
HEIGHT, WIDTH = 4, 6
SHADES: NDArray[np.uint8] = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
GREY = cv2.cvtColor(SHADES, cv2.COLOR_BGR2GRAY)
ALPHA = np.full((HEIGHT, WIDTH, 1), 9, np.uint8)


def camera(**changes: object) -> CameraTopicParams:
    own = {"frame_id": "optical", "mono16_bits": 16, "exposure_middle_s": 0.0}
    return validate(CameraTopicParams, TOPIC | own | changes, "camera")


def picture(encoding: str, pixels: NDArray[np.uint8], padding: int = 0, **changes: object) -> Picture:
    rows = np.pad(pixels.reshape(HEIGHT, -1), ((0, 0), (0, padding)))
    made = Picture("optical", HEIGHT, WIDTH, encoding, False, rows.shape[1], rows.reshape(-1))
    return replace(made, **changes)


@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("mono8", GREY), ("8UC1", GREY), ("bgr8", SHADES), ("8UC3", SHADES), ("rgb8", SHADES[..., ::-1]),
        ("bgra8", np.dstack([SHADES, ALPHA])), ("rgba8", np.dstack([SHADES[..., ::-1], ALPHA])),
    ],
)  # fmt: skip
def test_encodings_become_the_same_grey(encoding: str, pixels: NDArray[np.uint8]) -> None:
    for padding in (0, 5):
        made = grey(picture(encoding, pixels, padding), camera(), HEIGHT, WIDTH)
        assert made.shape == (HEIGHT, WIDTH)
        assert (made == GREY).all()


@pytest.mark.parametrize(("order", "bits"), [("<u2", 16), (">u2", 16), ("<u2", 12)])
def test_mono16_of_either_order_keeps_its_highest_bits(order: str, bits: int) -> None:
    deep = (GREY.astype(np.uint16) << (bits - 8)).astype(order)
    made = picture("mono16", deep.view(np.uint8), 2, is_bigendian=order == ">u2")
    assert (grey(made, camera(mono16_bits=bits), HEIGHT, WIDTH) == GREY).all()
    beyond = picture("mono16", np.full((HEIGHT, WIDTH), 0x1FFF, "<u2").view(np.uint8))
    assert (grey(beyond, camera(mono16_bits=12), HEIGHT, WIDTH) == 255).all()


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"frame_id": "base_link"}, "frame_id is 'base_link', expected 'optical'"),
        ({"encoding": "bayer_rggb8"}, "encoding is 'bayer_rggb8', expected one of mono8, "),
        ({"width": 5}, "the image is 5x4, its calibration in config/cameras is for 6x4"),
        ({"height": 0}, "the image is 6x0"),
        ({"step": 17}, "step is 17, expected at least 6 pixels of 3 bytes"),
        ({"step": 19}, "has 72 bytes of data, expected 4 rows of 19"),
        ({"data": np.empty(0, np.uint8)}, "has 0 bytes of data, expected 4 rows of 18"),
    ],
)
def test_an_image_that_cannot_be_read_is_refused(changes: dict[str, object], what: str) -> None:
    with pytest.raises(MessageRefused, match=what):
        grey(replace(picture("bgr8", SHADES), **changes), camera(), HEIGHT, WIDTH)


def test_cameras_are_one_or_two_of_different_topics() -> None:
    one = camera().model_dump()
    assert validate(CameraAdapterParams, {"front": one, "rear": None}, "file").rear is None
    for front, rear, what in ((None, None, "name no camera"), (one, one, "front and rear are the same")):
        with pytest.raises(ConfigError, match=what):
            validate(CameraAdapterParams, {"front": front, "rear": rear}, "file")


# --- inertial unit ---------------------------------------------------------------------------------------------------
LEVEL, REST = (0.0, 0.0, 0.0, 1.0), (0.1, 0.0, 9.8, 0.01, 0.02, 0.3)
KNOWN = (0.0, 0.0, 0.0)


def unit(**changes: object) -> ImuAdapter:
    return ImuAdapter(load(ImuAdapterParams, "imu_adapter", changes))


def convert(
    made: ImuAdapter, orientation: tuple[float, ...] = LEVEL, measured: tuple[float, ...] = REST, stamp_s: float = NOW_S
) -> Sample:
    return made.convert("imu_link", orientation, measured, KNOWN, stamp_s)


def test_a_sample_comes_through_as_it_was() -> None:
    assert convert(unit()) == Sample(NOW_S, LEVEL, REST[:3], REST[3:])


def test_a_unit_is_turned_into_base_links_axes() -> None:
    """The unit lies on its side and the robot looks to the north: the sample is the level robot's."""
    mounted, heading = Rotation.from_euler("xyz", (90.0, 0.0, 30.0), degrees=True), Rotation.from_euler("z", 1.5)
    own = mounted.inv()
    measured = (*own.apply(REST[:3]), *own.apply(REST[3:]))
    sample = convert(unit(rpy_deg=[90.0, 0.0, 30.0]), tuple((heading * mounted).as_quat()), measured)
    assert sample.acceleration_mps2 == pytest.approx(REST[:3])
    assert sample.rotation_radps == pytest.approx(REST[3:])
    assert sample.orientation_xyzw == pytest.approx(heading.as_quat())


def test_a_value_that_is_not_finite_is_refused() -> None:
    made = unit()
    for index in range(6):
        with pytest.raises(MessageRefused, match="not finite"):
            convert(made, measured=(*REST[:index], math.inf if index else math.nan, *REST[index + 1 :]))
    with pytest.raises(MessageRefused, match="not finite"):
        convert(made, (math.nan, 0.0, 0.0, 1.0))
    assert made.counters[NOT_FINITE] == 7
    assert convert(made)


def test_a_frozen_unit_is_refused_until_it_changes() -> None:
    made = unit()
    convert(made)
    for i in range(1, 3):
        with pytest.raises(MessageRefused, match="frozen"):
            convert(made, stamp_s=NOW_S + 0.01 * i)
    assert made.counters[FROZEN] == 2
    assert convert(made, measured=(0.11, *REST[1:]), stamp_s=NOW_S + 0.03)


@pytest.mark.parametrize(
    ("orientation", "measured", "what"),
    [
        ((0.0, 0.0, 0.0, 0.0), REST, "no unit quaternion, its norm is 0.000"),
        ((0.0, 0.0, 0.0, 1.1), REST, "no unit quaternion"),
        (LEVEL, (0.0, 0.0, 9800.0, *REST[3:]), "the acceleration is 9800 m/s2, expected at most 100"),
        (LEVEL, (*REST[:3], 0.0, 0.0, 28.6), "the rotation is 28.6 rad/s, expected at most 10: are these degrees"),
        (LEVEL, (0.0, 0.0, 1.0, *REST[3:]), "the mean acceleration is 1 m/s2, expected about 9.8"),
        (LEVEL, (0.0, 0.0, -9.8, *REST[3:]), "expected upwards: see rpy_deg"),
        (LEVEL, (9.8, 0.0, 0.0, *REST[3:]), "expected upwards: see rpy_deg"),
        ((1.0, 0.0, 0.0, 0.0), REST, "differ on where up is, expected ENU or NWU"),
    ],
)
def test_implausible_samples_are_refused(
    orientation: tuple[float, ...], measured: tuple[float, ...], what: str
) -> None:
    made = unit()
    with pytest.raises(MessageRefused, match=what):
        convert(made, orientation, measured)
    assert made.counters[IMPLAUSIBLE] == 1


def test_a_knock_and_a_slope_are_no_wrong_axes() -> None:
    made, slope = unit(), Rotation.from_euler("y", 10.0, degrees=True)
    for i in range(300):
        up = slope.inv().apply((0.0, 0.0, 9.8)) + np.random.default_rng(i).normal(0.0, 0.05, 3)
        force = (5.0, 0.0, -20.0) if i == 150 else tuple(up)
        convert(made, tuple(slope.as_quat()), (*force, 0.0, 0.0, 1e-4 * i), NOW_S + 0.01 * i)
    assert made.counters[IMPLAUSIBLE] == 0


def test_a_sample_of_another_frame_or_without_a_part_is_refused() -> None:
    with pytest.raises(MessageRefused, match="frame_id is 'imu', expected 'imu_link'"):
        unit().convert("imu", LEVEL, REST, KNOWN, NOW_S)
    for missing in range(3):
        covariances = tuple(-1.0 if i == missing else 0.0 for i in range(3))
        with pytest.raises(MessageRefused, match="a covariance is -1"):
            unit().convert("imu_link", LEVEL, REST, covariances, NOW_S)


# --- battery ---------------------------------------------------------------------------------------------------------
STATE = {
    "present": True, "voltage_v": 48.0, "current": -5.0, "percentage": 0.57, "capacity_ah": 45.0, "temperature_c": 21.0,
    "reported": Flow.DISCHARGING, "health": Health.GOOD, "time_s": NOW_S,
}  # fmt: skip


def state(charge_in: str = "fraction", inverted: bool = False, **changes: object) -> Reading:
    params = load(BatteryAdapterParams, "battery_adapter", {"charge_in": charge_in, "inverted_current": inverted})
    return reading(params, **(STATE | changes))


def test_a_state_as_the_message_defines_it() -> None:
    made = state()
    assert made == Reading(NOW_S, 48.0, -5.0, 0.57, 45.0, 21.0, Flow.DISCHARGING, Health.GOOD)
    for edge in (0.0, 1.0):
        assert state(percentage=edge).charge == state("percent", percentage=100.0 * edge).charge == edge


def test_percent_inverted_current_and_unmeasured_values() -> None:
    made = state("percent", True, percentage=57.0, current=5.0, capacity_ah=math.nan, temperature_c=math.nan)
    assert (made.charge, made.current_a, made.capacity_ah) == (0.57, -5.0, 50.0)
    assert math.isnan(made.temperature_c)


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"percentage": math.nan}, "percentage is nan: .* not estimated from the voltage"),
        ({"percentage": math.inf}, "percentage is inf"),
        ({"percentage": 57.0}, "percentage is 57, expected 0 to 1: see charge_in"),
        ({"percentage": -0.1}, "expected 0 to 1"),
        ({"percentage": 101.0, "charge_in": "percent"}, "percentage is 101, expected 0 to 100"),
        ({"present": False}, "present is false"),
        ({"voltage_v": math.nan}, "the voltage is nan V, expected 30.0 to 60.0 V"),
        ({"voltage_v": 48000.0}, "the voltage is 48000.0 V"),
        ({"current": math.nan}, "current is nan, expected a measurement"),
        ({"current": 5000.0}, "the current is 5000.0 A"),
        ({"temperature_c": 294.0}, "the temperature is 294.0 degrees"),
        ({"temperature_c": math.inf}, "the temperature is inf degrees"),
        ({"current": 5.0}, "the status is discharging, but 5 A mean charging: see inverted_current"),
    ],
)
def test_a_state_that_cannot_be_used_is_refused(changes: dict[str, object], what: str) -> None:
    with pytest.raises(MessageRefused, match=what):
        state(**changes)


def test_alarms_are_reported_and_the_reading_kept() -> None:
    assert complaint(state()) == complaint(state(health=Health.UNKNOWN)) == ""
    assert complaint(state(health=Health.HOT)) == "the battery reports: too hot"


def test_the_files_of_the_adapters_are_valid() -> None:
    assert load(CameraAdapterParams, "camera_adapter").front is not None
    assert load(ImuAdapterParams, "imu_adapter").rate_hz == 100.0
    assert load(BatteryAdapterParams, "battery_adapter").charge_in == "fraction"
