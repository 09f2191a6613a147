"""Transmission faults of an Ouster's packets, and the sweeps built from the packets that arrive."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.config import load
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.drivers.ouster.metadata import parse
from robot_stack.drivers.ouster.params import OusterDriverParams
from robot_stack.drivers.ouster.sweeps import (
    CORRUPT,
    DOUBLED,
    EMPTY,
    INCOMPLETE,
    JUMPS,
    LOST,
    OTHERS,
    OUT_OF_ORDER,
    STARTS,
    SweepBuilder,
)
from robot_stack.drivers.sweep import Sweep
from tests.support.ouster_packets import LEGACY, LOW_RATE, PROFILES, SINGLE, Os

NOW_S = 1_795_000_000.0
FLIGHT_S = 0.002  # from a packet's last column to its arrival
TURN = 32  # packets per turn of 512 columns


def builder(device: Os, **changes: object) -> SweepBuilder:
    params = load(OusterDriverParams, "ouster_driver", {"latency_s": FLIGHT_S, **changes})
    return SweepBuilder(params, parse(device.metadata(), "here"), "here")


def run(built: SweepBuilder, packets: list[bytes | None], begin_s: float = NOW_S, step_s: float = 0.1 / TURN) -> list:
    """Returns the sweeps of packets that arrive in order. None stands for a lost packet."""
    found = [built.received(data, begin_s + i * step_s + FLIGHT_S) for i, data in enumerate(packets) if data]
    return [sweep for sweep in found if sweep is not None]


def counted(built: SweepBuilder) -> dict[str, int]:
    """Returns the counters that are not 0."""
    return {name: int(count) for name, count in built.counters.values().items() if count != "0"}


def whole(sweep: Sweep, columns: int = 512, beams: int = 32) -> bool:
    return len(sweep.points) == columns * beams


# --- sweeps -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", PROFILES)
def test_a_turn_is_a_sweep_of_the_contract(profile: str) -> None:
    device = Os(lambda frame, column, beam: (4000 + 8 * column, 100 + beam), profile)
    built = builder(device)
    sweeps = run(built, list(device.packets(3 * TURN)))
    assert len(sweeps) == 3
    assert counted(built) == {}
    assert (built.problem, built.model) == ("", f"OS-1-32 122201000998, 512x10, {profile}")
    for sweep in sweeps:
        points = sweep.points
        assert points.dtype == SWEEP
        assert whole(sweep)
        assert points["time"][-1] == 0.0
        assert (np.diff(points["time"]) >= 0.0).all()
        # The sweep starts behind the robot and turns to the left first.
        azimuth = np.degrees(np.arctan2(points["y"], points["x"]))
        columns = np.repeat(np.arange(512), 32)
        off = (azimuth - (180.0 - 360.0 * columns / 512) + 180.0) % 360.0 - 180.0
        assert np.abs(off).max() < 4.3, "the beams' own azimuths"
        assert abs(off.mean()) < 0.1
        assert np.allclose(np.linalg.norm(xyz_of(points), axis=1), 4.0 + 0.008 * columns, atol=0.02)
        elevation = np.degrees(np.arcsin(points["z"] / np.linalg.norm(xyz_of(points), axis=1)))
        assert np.allclose(elevation, -20.0 + 40.0 * points["ring"] / 31, atol=0.1), "ring 0 is the lowest"
        assert (points["intensity"] == 131 - points["ring"]).all()


def test_stamps_are_those_of_the_newest_column() -> None:
    device = Os(begin_ns=1_234_567_890, beams=4)
    packets = list(device.packets(12 * TURN))
    built = builder(device)
    generator = np.random.default_rng(3)
    sweeps = []
    for i, data in enumerate(packets):
        sent_s = NOW_S + 1e-9 * (device.time_ns(i // TURN, 16 * (i % TURN) + 15) - device.begin_ns)
        sweep = built.received(data, sent_s + FLIGHT_S + generator.exponential(0.001))
        sweeps += [sweep] if sweep is not None else []
    assert len(sweeps) == 12
    for number, sweep in list(enumerate(sweeps))[2:]:
        assert sweep.stamp_s == pytest.approx(NOW_S + 1e-9 * (device.time_ns(number, 511) - device.begin_ns), abs=1e-4)
        assert sweep.points["time"][0] == pytest.approx(-0.1 * 511 / 512, abs=1e-6)


def test_the_lidar_may_be_turned() -> None:
    device = Os(lambda frame, column, beam: (3000 + 8 * column, 1))
    packets = list(device.packets(TURN))
    (ours,), (theirs,) = run(builder(device, rpy_deg=[0.0, 0.0, 90.0]), packets), run(builder(device), packets)
    assert np.allclose(ours.points["x"], -theirs.points["y"], atol=1e-5)
    assert np.allclose(ours.points["y"], theirs.points["x"], atol=1e-5)


def test_sweep_excludes_ranges_beyond_limits() -> None:
    ranges = {0: 992, 1: 1000, 2: 20_000, 3: 20_008}
    device = Os(lambda frame, column, beam: (ranges.get(beam, 0), 1), LOW_RATE)
    (sweep,) = run(builder(device, min_range_m=1.0, max_range_m=20.0), list(device.packets(TURN)))
    assert set(sweep.points["ring"]) == {29, 30}


@pytest.mark.parametrize("window", [(1, 256), (370, 85), (100, 101)])
def test_a_window_is_a_sweep_of_its_columns(window: tuple[int, int]) -> None:
    device = Os(window=window)
    built = builder(device)
    measured = [column for column in range(512) if device.measured(column)]
    per_turn = len({column // 16 for column in measured})
    sweeps = []
    for data in device.packets(3 * per_turn):
        measured_s = 1e-9 * (int.from_bytes(data[32:40], "little") - device.begin_ns)
        sweeps.append(built.received(data, NOW_S + measured_s + FLIGHT_S))
    assert [len(sweep.points) for sweep in sweeps if sweep] == [32 * len(measured)] * 3
    assert counted(built) == {}


def test_packets_outside_the_window_are_not_waited_for_and_do_no_harm() -> None:
    """Older firmware still sends them, without measured columns."""
    device = Os(window=(16, 47))
    places = [16 * place for place in range(TURN)]
    packets: list[bytes | None] = [device.packet(number, first) for number in range(3) for first in places]
    built = builder(device)
    assert [len(sweep.points) for sweep in run(built, packets)] == [32 * 32] * 3
    assert counted(built) == {}
    nothing_of_it = [data for data in packets[3 : TURN + 1] if data]
    alone = builder(device)
    assert not run(alone, [*nothing_of_it, device.packet(2, 0)])
    assert counted(alone) == {INCOMPLETE: 2, LOST: 2}, "of the frame that began while it listened"
    assert alone.drift_ppm == 0.0


def test_sweep_without_returns_is_reported() -> None:
    device = Os(lambda frame, column, beam: (0, 0) if frame < 2 else (5000, 1))
    built = builder(device)
    assert not run(built, list(device.packets(2 * TURN)))
    assert built.counters[EMPTY] == 2
    assert built.problem == "the newest sweep has no returns"
    assert len(run(built, list(device.packets(TURN, 2 * TURN)), NOW_S + 0.2)) == 1
    assert built.problem == ""


# --- transmission -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", [LEGACY, SINGLE])
def test_a_driver_that_starts_in_the_middle_of_a_frame_waits_for_the_next(profile: str) -> None:
    device = Os(profile=profile)
    built = builder(device)
    sweeps = run(built, list(device.packets(2 * TURN + 10, 12)))
    assert [whole(sweep) for sweep in sweeps] == [True]
    assert counted(built) == {INCOMPLETE: 1}, "what came before it was there is not lost"


def test_lost_packets_leave_holes() -> None:
    device = Os()
    packets: list[bytes | None] = list(device.packets(5 * TURN))
    for gone in (TURN + 10, TURN + 11, 3 * TURN - 1, 3 * TURN):  # mid-turn; the last; the first
        packets[gone] = None
    built = builder(device)
    sweeps = run(built, packets)
    assert [len(sweep.points) // (32 * 16) for sweep in sweeps] == [32, 30, 31, 31, 32]
    assert counted(built) == {LOST: 4}
    stamps = [sweep.stamp_s - NOW_S for sweep in sweeps]
    ends = [0.1, 0.2, 0.3 - 0.1 / 32, 0.4, 0.5]  # the third lacks its last packet and ends one packet earlier
    assert np.allclose(np.diff(stamps), np.diff(ends), atol=1e-3)


@pytest.mark.parametrize(("gone", "whole_turns"), [((2 * TURN - 8, 2 * TURN), 4), ((TURN + 5, 4 * TURN), 6)])
def test_a_sweep_without_end_is_incomplete_whatever_else_is_lost(gone: tuple[int, int], whole_turns: int) -> None:
    device = Os()
    packets: list[bytes | None] = list(device.packets(whole_turns * TURN))
    packets[slice(*gone)] = [None] * (gone[1] - gone[0])
    built = builder(device)
    assert len(run(built, packets)) == 3
    assert counted(built) == {LOST: gone[1] - gone[0], INCOMPLETE: 1}


def test_doubled_packets_are_taken_once() -> None:
    device = Os()
    packets: list[bytes | None] = [data for data in device.packets(3 * TURN) for _ in range(2)]
    built = builder(device)
    sweeps = run(built, packets, step_s=0.05 / TURN)
    assert [whole(sweep) for sweep in sweeps] == [True] * 3
    assert counted(built) == {DOUBLED: 3 * TURN}


def test_packets_that_overtake_each_other_are_laid_where_they_belong() -> None:
    device = Os(lambda frame, column, beam: (3000 + 8 * column, 1))
    packets: list[bytes | None] = list(device.packets(3 * TURN))
    for i in (TURN + 5, TURN + 20):
        packets[i], packets[i + 1] = packets[i + 1], packets[i]
    built, undisturbed = builder(device), builder(device)
    ours, theirs = run(built, packets), run(undisturbed, list(device.packets(3 * TURN)))
    assert counted(built) == {OUT_OF_ORDER: 2}
    assert [sweep.points.tobytes() for sweep in ours] == [sweep.points.tobytes() for sweep in theirs]


def test_a_packet_that_comes_after_its_frame_is_not_used() -> None:
    device = Os(lambda frame, column, beam: (3000 + 100 * frame, 1))
    packets: list[bytes | None] = list(device.packets(3 * TURN))
    late = packets.pop(TURN - 3)
    packets.insert(TURN + 4, late)
    built = builder(device)
    sweeps = run(built, packets)
    assert [len(sweep.points) // (32 * 16) for sweep in sweeps] == [31, 32, 32]
    assert counted(built) == {LOST: 1, OUT_OF_ORDER: 1}
    for number, sweep in enumerate(sweeps):
        assert np.allclose(np.linalg.norm(xyz_of(sweep.points), axis=1), 3.0 + 0.1 * number, atol=0.02)


def test_corrupt_packets_are_counted_and_reported_and_sweeps_continue() -> None:
    device = Os()
    packets: list[bytes | None] = list(device.packets(2 * TURN))
    packets[5] = b"\x07" + packets[5][1:]
    packets[TURN + 9] = packets[TURN + 9][:700]
    built = builder(device)
    assert run(built, packets[:6]) == []
    assert built.problem == "the packet is of type 0x0007, expected 0x0001"
    sweeps = run(built, packets[6:], NOW_S + 6 * 0.1 / TURN) + run(
        built, list(device.packets(1, 2 * TURN)), NOW_S + 0.2
    )
    assert [len(sweep.points) // (32 * 16) for sweep in sweeps] == [31, 31]
    assert counted(built) == {CORRUPT: 2, LOST: 2}
    assert built.problem == ""


def test_packets_of_another_sensor_make_no_sweep_and_are_named() -> None:
    built, other = builder(Os()), Os(serial=992_101_000_280)
    assert not run(built, list(other.packets(2 * TURN)))
    assert counted(built) == {OTHERS: 2 * TURN}
    assert built.problem == "the sensor's serial number is 992101000280, expected 122201000998 by the metadata"
    assert built.model == ""


@pytest.mark.parametrize("profile", [LEGACY, SINGLE])
def test_frames_are_counted_on_over_65535(profile: str) -> None:
    device = Os(profile=profile, first_frame=65534)
    built = builder(device)
    sweeps = run(built, list(device.packets(4 * TURN)))
    assert [whole(sweep) for sweep in sweeps] == [True] * 4
    assert counted(built) == {}


@pytest.mark.parametrize("profile", [LEGACY, SINGLE])
def test_a_lidar_that_was_silent_goes_on_with_whole_sweeps(profile: str) -> None:
    device = Os(profile=profile)
    built = builder(device)
    assert len(run(built, list(device.packets(TURN + 10)))) == 1
    begin_s = NOW_S + 3.0 + 7 * 0.1 / TURN
    sweeps = run(built, list(device.packets(2 * TURN, 30 * TURN + 7)), begin_s)
    assert [whole(sweep) for sweep in sweeps] == [True]
    assert counted(built) == {INCOMPLETE: 1}, "nobody knows what was lost in a silence that long"
    assert sweeps[0].stamp_s == pytest.approx(NOW_S + 3.2, abs=0.005)


def test_restarted_sensor_is_detected_by_initialization_id() -> None:
    device = Os(begin_ns=900_000_000_000)
    built = builder(device)
    run(built, list(device.packets(TURN + 10)))
    again = Os(begin_ns=20_000_000_000, initialization=42, first_frame=3)
    sweeps = run(built, list(again.packets(2 * TURN + 5, 5)), NOW_S + 60.0)
    assert [whole(sweep) for sweep in sweeps] == [True]
    assert counted(built) == {STARTS: 1, INCOMPLETE: 1}
    assert NOW_S + 60.0 < sweeps[0].stamp_s < NOW_S + 60.3


def test_restarted_frame_numbers_with_continuous_time_yield_whole_sweeps() -> None:
    """A reconfigured legacy sensor on PTP time restarts its frame numbers."""
    device = Os(profile=LEGACY)
    built = builder(device)
    run(built, list(device.packets(TURN + 10)))
    again = Os(profile=LEGACY, first_frame=0, begin_ns=device.begin_ns + 1_000_000_000)
    sweeps = run(built, list(again.packets(2 * TURN)), NOW_S + 1.0)
    assert [whole(sweep) for sweep in sweeps] == [True] * 2
    assert counted(built) == {}


def test_sensor_clock_step_is_counted_as_jump() -> None:
    """PTP synchronises in the middle of a frame: its packets before and after are unrelated."""
    before, after = Os(), Os(begin_ns=1_795_000_000_000_000_000)
    built = builder(before)
    packets = [*before.packets(TURN + 10), *after.packets(2 * TURN - 10, TURN + 10)]
    sweeps = run(built, packets)
    assert [whole(sweep) for sweep in sweeps] == [True] * 2
    assert counted(built) == {JUMPS: 1, INCOMPLETE: 1}
    assert sweeps[-1].stamp_s == pytest.approx(NOW_S + 0.3, abs=0.005)


def test_packets_without_measured_column_are_not_used_for_time() -> None:
    """A sensor sends them while it warms up, with status 0 and arbitrary times."""
    device = Os()
    (data,) = device.packets(1)
    column = (len(data) - 64) // 16
    cold = [
        data[:32] + b"".join(bytes(8) + i.to_bytes(2, "little") + bytes(column - 10) for i in range(16)) + bytes(32)
    ]
    built = builder(device)
    assert not run(built, cold)
    assert len(run(built, list(device.packets(TURN, TURN)))) == 1
    assert counted(built) == {INCOMPLETE: 1, LOST: TURN - 1}


# --- random packets ---------------------------------------------------------------------------------------------------

SMALL = {profile: Os(lambda frame, column, beam: (3000, 1), profile, beams=4, columns=256) for profile in PROFILES}


@cache
def small(profile: str, count: int, skip: int = 0) -> list[bytes | None]:
    return list(SMALL[profile].packets(count, skip))


FLIPS = st.lists(st.tuples(st.integers(0, 1 << 16), st.binary(min_size=1, max_size=8)), max_size=6)


def finite(sweep: Sweep | None) -> None:
    if sweep is not None:
        assert np.isfinite(xyz_of(sweep.points)).all()
        assert np.isfinite(sweep.points["time"]).all()
        assert np.isfinite(sweep.stamp_s)
        assert sweep.points["time"].max() == 0.0
        assert np.linalg.norm(xyz_of(sweep.points), axis=1).max() < 101.0
        assert sweep.points["ring"].max() < 4


@settings(max_examples=50)
@given(st.sampled_from(PROFILES), st.lists(st.binary(max_size=2000), max_size=5))
def test_random_bytes_crash_nothing(profile: str, packets: list[bytes]) -> None:
    built = builder(SMALL[profile])
    for data in packets:
        finite(built.received(data, NOW_S))


@settings(max_examples=50)
@given(st.sampled_from(PROFILES), st.lists(st.tuples(st.integers(0, 47), FLIPS), max_size=60))
def test_packets_with_random_errors_crash_nothing_and_yield_finite_points(
    profile: str, sent: list[tuple[int, list[tuple[int, bytes]]]]
) -> None:
    """Packets arrive in any order, lost or duplicated. Three undisturbed turns afterwards yield sweeps again."""
    built, packets = builder(SMALL[profile]), small(profile, 3 * 16)
    for i, (which, flips) in enumerate(sent):
        data = bytearray(packets[which])
        for place, new in flips:
            at = place % len(data)
            data[at : at + len(new)] = new[: len(data) - at]
        finite(built.received(bytes(data), NOW_S + i * 0.1 / 16))
    later = run(built, small(profile, 5 * 16, 100 * 16), NOW_S + 100.0, step_s=0.1 / 16)
    for sweep in later:
        finite(sweep)
    assert len(later) >= 3
    assert len(later[-1].points) == 256 * 4
