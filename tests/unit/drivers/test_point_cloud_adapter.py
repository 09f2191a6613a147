"""Clouds of other vendors' drivers: every layout and stamp, and rejections that name what was found."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_stack.core.config import ConfigError, load
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.drivers.point_cloud.adapter import DOUBLED, LOST, OUT_OF_ORDER, REFUSED, PointCloudAdapter
from robot_stack.drivers.point_cloud.cloud import Cloud, CloudRefused, Field
from robot_stack.drivers.point_cloud.params import PointCloudAdapterParams
from robot_stack.drivers.point_cloud.rings import RingOrder
from robot_stack.drivers.point_cloud.stamps import StampAt
from tests.unit.drivers.vendor_clouds import (
    F32,
    HESAI,
    LIVOX,
    LIVOX_OFFSET,
    NEBULA,
    OUSTER,
    ROBOSENSE,
    SPAN_S,
    START_S,
    VELODYNE,
    VENDORS,
    Vendor,
    cloud_of,
    scene,
    with_points,
)

SEEN = scene()
END_S = START_S + SPAN_S
ARRIVAL_S = END_S + 0.002
KITTI = Path("/work/shared/data/lidar/scan_000000.bin")


def params(**changes: object) -> PointCloudAdapterParams:
    return load(PointCloudAdapterParams, "point_cloud_adapter", {"frame_id": "vendor_frame", **changes})


def adapter(rings: int = 16, **changes: object) -> PointCloudAdapter:
    return PointCloudAdapter(params(**changes), 0.1, rings)


def assert_is_the_scene(points: np.ndarray) -> None:
    assert points.dtype == SWEEP
    assert len(points) == len(SEEN.xyz)
    assert (np.diff(points["time"]) >= 0.0).all(), "in the order of time"
    assert points["time"][-1] == 0.0
    assert points["time"][0] == pytest.approx(-SPAN_S, abs=1e-6)
    ours = np.lexsort((points["ring"], points["time"]))
    assert np.allclose(xyz_of(points)[ours], SEEN.xyz, atol=1e-6)
    assert (points["ring"][ours] == SEEN.ring).all()
    assert np.allclose(points["time"][ours], SEEN.seconds - SPAN_S, atol=1e-6)
    assert (points["intensity"] == 100.0).all()


@pytest.mark.parametrize("vendor", VENDORS, ids=lambda vendor: f"{vendor.name}-{vendor.time}")
def test_every_layout_becomes_the_same_sweep(vendor: Vendor) -> None:
    converter = adapter()
    sweep = converter.convert(cloud_of(vendor, SEEN, padding=7), ARRIVAL_S)
    assert_is_the_scene(sweep.points)
    assert sweep.stamp_s == pytest.approx(END_S, abs=1e-6)
    assert sweep.layout == vendor.name.replace("robosense", "hesai")  # hesai and robosense share a layout
    assert sweep.stamp_at is StampAt.FIRST
    assert converter.ring_order is (RingOrder.HIGHEST_FIRST if vendor.top_down else RingOrder.LOWEST_FIRST)
    assert adapter(layout=vendor.name).convert(cloud_of(vendor, SEEN), ARRIVAL_S).layout == vendor.name
    other = VELODYNE if vendor is not VELODYNE else OUSTER
    with pytest.raises(CloudRefused, match=rf"are x float32, .*{vendor.time} .*, expected those of {other.name}: "):
        adapter(layout=other.name).convert(cloud_of(vendor, SEEN), ARRIVAL_S)


def test_bytes_of_one_point_of_each_vendor() -> None:
    """The memory layout of the vendors' structures; the second point ends the sweep."""
    xyz = (1.0, -2.0, 0.5)
    first_ns, last_ns = int(START_S * 1e9), int(END_S * 1e9)
    cases = [
        (OUSTER, *(struct.pack("<3f4xfIHHH2xI12x", *xyz, 3000.0, t, 77, 5, 9, 2291) for t in (0, 99_900_000)), 77.0),
        (VELODYNE, *(struct.pack("<3ffHf", *xyz, 33.0, 5, t) for t in (0.0, SPAN_S)), 33.0),
        (HESAI, *(struct.pack("<3ffHd", *xyz, 44.0, 5, t) for t in (START_S, END_S)), 44.0),
        (ROBOSENSE, *(struct.pack("<3f4xfHxxd", *xyz, 55.0, 5, t) for t in (START_S, END_S)), 55.0),
        (LIVOX, *(struct.pack("<3ffBBd", *xyz, 66.0, 16, 5, t) for t in (first_ns, last_ns)), 66.0),
        (NEBULA, *(struct.pack("<3fBBHfffI", *xyz, 88, 1, 5, 0.1, 0.2, 2.3, t) for t in (0, 99_900_000)), 88.0),
    ]
    for vendor, first, last, intensity in cases:
        assert len(first) == vendor.point_step, vendor.name
        fields = tuple(Field(name, offset, kind, 1) for name, offset, kind in vendor.fields)
        data = np.frombuffer(first + last, np.uint8)
        cloud = Cloud("vendor_frame", START_S, 1, 2, fields, False, vendor.point_step, 2 * vendor.point_step, data)
        points = adapter().convert(cloud, ARRIVAL_S).points
        assert points["time"].tolist() == pytest.approx([-SPAN_S, 0.0], abs=1e-6)
        assert [list(item)[:5] for item in points.tolist()] == [[*xyz, intensity, 5]] * 2, vendor.name


# --- empty points ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "value"), [("y", np.nan), ("y", np.inf), ("timestamp", np.nan)])
def test_points_that_are_not_finite_are_left_out(name: str, value: float) -> None:
    cloud = with_points(cloud_of(ROBOSENSE, SEEN), ROBOSENSE, name, 7, value)
    sweep = adapter().convert(cloud, ARRIVAL_S)
    assert (len(sweep.points), sweep.empty) == (len(SEEN.xyz) - 1, 1)
    assert np.isfinite(xyz_of(sweep.points)).all()
    timeless = cloud_of(VELODYNE, replace(SEEN, seconds=np.full_like(SEEN.seconds, np.nan)))
    with pytest.raises(CloudRefused, match="field time has no finite time"):
        adapter().convert(timeless, ARRIVAL_S)


def test_points_at_origin_are_removed_but_count_for_sweep_start() -> None:
    """Ouster's empty points are zeros. Those of the first column, which points at the sky, start the sweep."""
    sky = SEEN.xyz.copy()
    sky[:400] = 0.0
    sweep = adapter().convert(cloud_of(OUSTER, replace(SEEN, xyz=sky)), ARRIVAL_S)
    assert sweep.empty == 400
    assert sweep.stamp_s == pytest.approx(END_S, abs=1e-6)
    assert sweep.points["time"][0] == pytest.approx(SEEN.seconds[400] - SPAN_S, abs=1e-6)
    covered = adapter().convert(cloud_of(OUSTER, replace(SEEN, xyz=np.zeros_like(SEEN.xyz))), ARRIVAL_S)
    assert len(covered.points) == 0
    assert covered.stamp_s == pytest.approx(END_S, abs=1e-6)


def test_intensities_are_clipped_to_contract_range() -> None:
    cloud = with_points(cloud_of(VELODYNE, SEEN), VELODYNE, "intensity", 0, 3000.0)
    cloud = with_points(cloud, VELODYNE, "intensity", 1, np.nan)
    assert adapter().convert(cloud, ARRIVAL_S).points["intensity"][:3].tolist() == [255.0, 0.0, 100.0]


# --- stamps ----------------------------------------------------------------------------------------------------------

ABSOLUTE = pytest.mark.parametrize("vendor", [HESAI, LIVOX], ids=lambda vendor: vendor.name)
OFFSET = pytest.mark.parametrize("vendor", [OUSTER, LIVOX_OFFSET, NEBULA], ids=lambda vendor: vendor.name)


@ABSOLUTE
@pytest.mark.parametrize(("after_s", "at"), [(0.0, "first"), (SPAN_S, "last"), (0.05, "trigger")])
def test_stamp_position_is_detected_from_absolute_times(vendor: Vendor, after_s: float, at: str) -> None:
    for configured in ("auto", at):
        converter = adapter(stamp_at=configured)
        sweep = converter.convert(cloud_of(vendor, SEEN, stamp_s=START_S + after_s), ARRIVAL_S)
        assert sweep.stamp_at.value == at
        assert sweep.stamp_s == pytest.approx(END_S, abs=1e-6)
        assert_is_the_scene(sweep.points)


@ABSOLUTE
def test_a_stamp_elsewhere_than_configured_is_refused(vendor: Vendor) -> None:
    with pytest.raises(CloudRefused, match=r"stamp is at the first point .* expected at the last"):
        adapter(stamp_at="last").convert(cloud_of(vendor, SEEN), ARRIVAL_S)
    with pytest.raises(CloudRefused, match=r"stamp is at the trigger point .* expected at the first"):
        adapter(stamp_at="first").convert(cloud_of(vendor, SEEN, stamp_s=START_S + 0.05), ARRIVAL_S)


@ABSOLUTE
def test_points_of_another_clock_require_configured_stamp_position(vendor: Vendor) -> None:
    host_s = START_S + 5000.0
    cloud = cloud_of(vendor, SEEN, stamp_s=host_s)
    with pytest.raises(
        CloudRefused, match=r"4999\.900 s after the newest point, expected one clock, or stamp_at first"
    ):
        adapter().convert(cloud, host_s)
    assert adapter(stamp_at="last").convert(cloud, host_s + 0.01).stamp_s == pytest.approx(host_s)
    assert adapter(stamp_at="first").convert(cloud, host_s + 0.11).stamp_s == pytest.approx(host_s + SPAN_S, abs=1e-6)
    with pytest.raises(CloudRefused, match=r"5000\.000 s before the first point"):
        adapter(stamp_at="trigger").convert(cloud_of(vendor, SEEN, stamp_s=START_S - 5000.0), START_S)


@OFFSET
def test_stamp_at_last_point_is_detected_from_arrival_time(vendor: Vendor) -> None:
    converter = adapter()
    sweep = converter.convert(cloud_of(vendor, SEEN, stamp_s=END_S), ARRIVAL_S)
    assert sweep.stamp_at is StampAt.LAST
    assert sweep.stamp_s == pytest.approx(END_S)
    # Once detected, the stamp stays at the last point, however late a later cloud arrives.
    later = cloud_of(vendor, SEEN, stamp_s=END_S + 0.1)
    assert converter.convert(later, END_S + 0.1 + 0.15).stamp_s == pytest.approx(END_S + 0.1)
    with pytest.raises(CloudRefused, match=r"stamp is at the last point .* expected at the first"):
        adapter(stamp_at="first").convert(cloud_of(vendor, SEEN, stamp_s=END_S), ARRIVAL_S)
    late = adapter(stamp_at="last").convert(cloud_of(vendor, SEEN, stamp_s=END_S), END_S + 0.15)
    assert late.stamp_s == pytest.approx(END_S)


@pytest.mark.parametrize(("zero_s", "at"), [(0.0, "first"), (SPAN_S - 0.001, "last"), (0.04, "trigger")])
def test_stamp_position_is_detected_from_signed_offsets(zero_s: float, at: str) -> None:
    """Velodyne's driver stamps the last packet, so the offsets of that packet's points are positive."""
    for configured in ("auto", at):
        cloud = cloud_of(VELODYNE, SEEN, stamp_s=START_S + zero_s, zero_s=zero_s)
        sweep = adapter(stamp_at=configured).convert(cloud, ARRIVAL_S)
        assert sweep.stamp_at.value == at
        assert sweep.stamp_s == pytest.approx(END_S, abs=1e-6)


def test_offsets_far_from_the_stamp_are_refused() -> None:
    with pytest.raises(CloudRefused, match=r"first point comes 0\.500 s after the stamp"):
        adapter().convert(cloud_of(VELODYNE, SEEN, zero_s=-0.5), ARRIVAL_S)


def test_a_stamp_by_another_clock_is_refused() -> None:
    with pytest.raises(CloudRefused, match=r"newest point is 5\.002 s old, expected at most 0\.3 s"):
        adapter().convert(cloud_of(OUSTER, SEEN, stamp_s=START_S - 5.0), ARRIVAL_S)
    with pytest.raises(CloudRefused, match=r"newest point lies 4\.998 s in the future"):
        adapter().convert(cloud_of(OUSTER, SEEN, stamp_s=START_S + 5.1), ARRIVAL_S)


@pytest.mark.parametrize(
    ("factor", "what"), [(1e-3, "span 9.99e-05 s"), (1e3, "span 99.9 s"), (0.0, "span 0 s")]
)  # fmt: skip
def test_a_time_of_another_unit_is_refused(factor: float, what: str) -> None:
    cloud = cloud_of(VELODYNE, replace(SEEN, seconds=SEEN.seconds * factor))
    with pytest.raises(CloudRefused, match=rf"the points' times {what}, expected about 0\.1 s"):
        adapter().convert(cloud, ARRIVAL_S)


def test_an_absolute_time_of_another_unit_is_refused() -> None:
    seconds_of_livox = cloud_of(replace(LIVOX, unit_s=1.0), SEEN)
    with pytest.raises(CloudRefused, match="field timestamp is 1795000000, which are no nanoseconds as of livox"):
        adapter().convert(seconds_of_livox, ARRIVAL_S)
    nanoseconds_of_hesai = cloud_of(replace(HESAI, unit_s=1e-9), SEEN)
    with pytest.raises(CloudRefused, match="which are no seconds as of hesai"):
        adapter().convert(nanoseconds_of_hesai, ARRIVAL_S)


# --- the sweep before ------------------------------------------------------------------------------------------------


def test_lost_doubled_and_swapped_sweeps_are_counted() -> None:
    converter = adapter()

    def take(number: int) -> None:
        start_s = START_S + 0.1 * number
        converter.convert(cloud_of(HESAI, SEEN, start_s=start_s), start_s + SPAN_S + 0.002)

    take(0)
    take(1)
    with pytest.raises(CloudRefused, match=r"was received before, expected a newer one"):
        take(1)
    take(5)
    late = cloud_of(HESAI, SEEN, start_s=START_S + 0.4)
    with pytest.raises(CloudRefused, match=r"the sweep is 0\.100 s older than the one before"):
        converter.convert(late, START_S + 0.6)
    assert {name: converter.counters[name] for name in (LOST, DOUBLED, OUT_OF_ORDER, REFUSED)} == {
        LOST: 3, DOUBLED: 1, OUT_OF_ORDER: 1, REFUSED: 0,
    }  # fmt: skip
    with pytest.raises(CloudRefused):
        converter.convert(replace(cloud_of(HESAI, SEEN), is_bigendian=True), ARRIVAL_S)
    assert converter.counters.values()[REFUSED] == "1"


def test_cloud_with_clock_set_back_is_accepted() -> None:
    converter = adapter()
    converter.convert(cloud_of(OUSTER, SEEN), ARRIVAL_S)
    earlier = cloud_of(OUSTER, SEEN, stamp_s=START_S - 100.0)
    assert converter.convert(earlier, ARRIVAL_S - 100.0).stamp_s == pytest.approx(END_S - 100.0, abs=1e-6)


# --- refusals --------------------------------------------------------------------------------------------------------


def changed(**changes: object) -> Cloud:
    return replace(cloud_of(VELODYNE, SEEN), **changes)


@pytest.mark.parametrize(
    ("cloud", "what"),
    [
        (changed(is_bigendian=True), "the cloud is big endian, expected little endian"),
        (changed(frame_id="base_link"), "frame_id is 'base_link', expected 'vendor_frame'"),
        (changed(width=0), "the cloud has no points: width 0, height 1"),
        (changed(height=0), "the cloud has no points"),
        (changed(row_step=21), "row_step is 21, expected at least 3200 points of 22 bytes"),
        (changed(point_step=0, row_step=0), "expected at least 3200 points of 0 bytes"),
        (changed(height=2), "has 70400 bytes of data, expected 2 rows of 70400 bytes"),
        (changed(data=np.zeros(100, np.uint8)), "has 100 bytes of data, expected 1 rows of 70400"),
        (changed(fields=()), "the fields are none, expected those of ouster: x, y, z, reflectivity or intensity, ring"),
        (changed(fields=changed().fields[:5]), "ring uint16, expected those of .*velodyne: .*time float32"),
        (
            changed(fields=(*changed().fields[:5], Field("time", 18, 3, 1))),
            "time int16, expected those of .*velodyne: .*time float32",
        ),
        (changed(fields=(*changed().fields[1:], Field("x", 0, 3, 1))), "x int16, expected those of"),
        (changed(fields=(*changed().fields[:5], Field("time", 19, F32, 1))), "ends at byte 23 of a point of 22"),
        (changed(fields=(*changed().fields[:5], Field("time", 18, F32, 2))), "time float32 with count 2, expected one"),
        (changed(fields=(*changed().fields[:5], Field("time", 18, 9, 1))), "time of unknown type 9"),
        (
            changed(fields=tuple(replace(f, datatype=9) if f.name == "intensity" else f for f in changed().fields)),
            "intensity of unknown type 9",
        ),
    ],
)  # fmt: skip
def test_a_cloud_that_cannot_be_read_is_refused_by_name(cloud: Cloud, what: str) -> None:
    with pytest.raises(CloudRefused, match=what):
        adapter().convert(cloud, ARRIVAL_S)
    assert len(adapter().convert(changed(row_step=0), ARRIVAL_S).points) == len(SEEN.xyz), "a single row needs none"


def test_a_sensor_of_more_rings_than_the_robots_is_refused() -> None:
    with pytest.raises(CloudRefused, match="a point is of ring 15, expected at most 7"):
        adapter(rings=8).convert(cloud_of(VELODYNE, SEEN), ARRIVAL_S)


# --- rings and mounting ----------------------------------------------------------------------------------------------


def test_lines_that_wander_keep_their_numbers() -> None:
    mixed = replace(SEEN, ring=np.random.default_rng(1).integers(0, 16, len(SEEN.ring)))
    converter = adapter()
    points = converter.convert(cloud_of(LIVOX, mixed), ARRIVAL_S).points
    assert converter.ring_order is RingOrder.NONE
    assert (points["ring"] == mixed.ring).all()


def test_ring_order_is_unknown_until_sweep_with_several_rings() -> None:
    few = replace(SEEN, xyz=np.where((SEEN.ring == 3)[:, None], SEEN.xyz, 0.0).astype(np.float32))
    converter = adapter()
    converter.convert(cloud_of(OUSTER, few), ARRIVAL_S)
    assert converter.ring_order is None
    converter.convert(cloud_of(OUSTER, SEEN, stamp_s=START_S + 0.1), ARRIVAL_S + 0.1)
    assert converter.ring_order is RingOrder.HIGHEST_FIRST


def test_the_vendors_frame_is_turned_into_the_sensors() -> None:
    """Ouster's os_lidar frame points backwards."""
    points = adapter(rpy_deg=[0.0, 0.0, 180.0]).convert(cloud_of(VELODYNE, SEEN), ARRIVAL_S).points
    assert np.allclose(xyz_of(points), SEEN.xyz * [-1.0, -1.0, 1.0], atol=1e-5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("layout", "sick"), ("topic", "points"), ("rpy_deg", [0.0, 0.0, 181.0]), ("future_s", 0.2),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_refused(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=name):
        params(**{name: value})


@pytest.mark.parametrize("name", ["point_cloud_adapter", "overhead_lidar_adapter"])
def test_the_files_of_both_adapters_are_valid(name: str) -> None:
    assert load(PointCloudAdapterParams, name).silence_s > 0.0


# --- a real sweep ----------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not KITTI.is_file(), reason="no recorded sweep beside the project")
@pytest.mark.parametrize("vendor", [VELODYNE, LIVOX], ids=lambda vendor: vendor.name)
def test_a_real_sweep_comes_through_as_it_was(vendor: Vendor) -> None:
    """124,000 points of a real LiDAR of 64 rings, assigned by elevation, in a vendor's layout."""
    raw = np.fromfile(KITTI, "<f4").reshape(-1, 4)
    elevation = np.arcsin(raw[:, 2] / np.linalg.norm(raw[:, :3], axis=1))
    ring = np.clip((elevation - np.radians(-25.0)) / np.radians(30.0) * 64, 0, 63).astype(int)
    seconds = SPAN_S * (np.arctan2(raw[:, 1], raw[:, 0]).astype(float) % (2.0 * np.pi)) / (2.0 * np.pi)
    seen = replace(SEEN, xyz=raw[:, :3], ring=ring, seconds=seconds, rings=64)
    sweep = adapter(rings=64).convert(cloud_of(vendor, seen), ARRIVAL_S)
    assert len(sweep.points) == len(raw)
    order = np.argsort(seconds, kind="stable")
    assert np.allclose(sweep.points["time"], seconds[order] - seconds.max(), atol=1e-6)
    # The points are exactly those of the recording; points with equal times may be in either order.
    ours, theirs = (np.sort(item.view("<f4,<f4,<f4").reshape(-1)) for item in (
        np.ascontiguousarray(xyz_of(sweep.points)), np.ascontiguousarray(raw[order, :3]))
    )  # fmt: skip
    assert (ours == theirs).all()
    assert (np.bincount(sweep.points["ring"], minlength=64) == np.bincount(ring, minlength=64)).all()
