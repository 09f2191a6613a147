"""The simulated Ouster: its packets against a second writer of the manual's bytes, and against the driver's decoder."""

from __future__ import annotations

import numpy as np

from robot_stack.core.config import config_dir, load
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.core.robot import load_robot
from robot_stack.drivers.nodes.ouster_metadata import check
from robot_stack.drivers.ouster.metadata import parse
from robot_stack.drivers.ouster.params import OusterDriverParams
from robot_stack.drivers.ouster.sweeps import SweepBuilder
from robot_stack.supervisor.profile import load_plan
from sim.devices.ouster import COLUMNS_PER_PACKET, OusterSensor
from sim.lidar.params import Beams, load_lidar_params
from tests.support.ouster_packets import Os

BEAMS = Beams(rings=32, columns=512, lowest_deg=-20.0, highest_deg=20.0, start_azimuth_deg=180.0, period_s=0.1)
HALF = BEAMS.columns // 2
COLUMN_S = BEAMS.period_s / BEAMS.columns
# What is left out of the comparison: reserved bytes, the footer, near infrared, signal, and times.
_HEADER, _PIXEL, _COLUMN_HEADER = 12, 12, 12


def scene(first: int, last: int, seed: int) -> Points:
    """Returns in three of four beams of columns first to last - 1, as the simulated LiDAR gives them."""
    random = np.random.default_rng(seed)
    column, ring = (grid.ravel() for grid in np.mgrid[first:last, 0 : BEAMS.rings])
    seen = random.random(len(column)) < 0.75
    column, ring = column[seen], ring[seen]
    azimuth = np.pi - 2.0 * np.pi * column / BEAMS.columns
    elevation = np.radians(np.linspace(BEAMS.lowest_deg, BEAMS.highest_deg, BEAMS.rings))[ring]
    range_m = 1e-3 * random.integers(1000, 40_000, len(column))  # what the packets can hold
    points = np.zeros(len(column), SWEEP)
    points["x"] = range_m * np.cos(elevation) * np.cos(azimuth)
    points["y"] = range_m * np.cos(elevation) * np.sin(azimuth)
    points["z"] = range_m * np.sin(elevation)
    points["intensity"], points["ring"] = random.integers(0, 256, len(column)), ring
    points["time"] = (column - last + 1) * COLUMN_S
    return points


def test_packets_are_those_of_the_manual() -> None:
    points = scene(0, HALF, 1)
    mm = np.zeros((BEAMS.columns, BEAMS.rings), int)
    reflectivity = np.zeros_like(mm)
    place = HALF - 1 + np.rint(points["time"] / COLUMN_S).astype(int), BEAMS.rings - 1 - points["ring"]
    xyz = np.stack([points[axis].astype(float) for axis in "xyz"])
    mm[place], reflectivity[place] = np.rint(1e3 * np.linalg.norm(xyz, axis=0)), points["intensity"]
    other = Os(seen=lambda _, column, beam: (int(mm[column, beam]), int(reflectivity[column, beam])), first_frame=7)
    ours = list(OusterSensor(BEAMS).packets(points, 7, (0, HALF), 0.05 - COLUMN_S))
    theirs = [other.packet(0, first) for first in range(0, HALF, COLUMNS_PER_PACKET)]
    assert len(ours) == len(theirs) == HALF // COLUMNS_PER_PACKET
    for own, given in zip(ours, theirs, strict=True):
        assert len(own) == len(given)
        assert own[:_HEADER] == given[:_HEADER]
        mine, his = (np.frombuffer(data[32:-32], np.uint8).reshape(COLUMNS_PER_PACKET, -1) for data in (own, given))
        assert (mine[:, 8:_COLUMN_HEADER] == his[:, 8:_COLUMN_HEADER]).all()
        pixels, others = (part[:, _COLUMN_HEADER:].reshape(-1, _PIXEL) for part in (mine, his))
        assert (pixels[:, [0, 1, 4]] == others[:, [0, 1, 4]]).all()
        assert (pixels[:, 2] & 0x07 == others[:, 2] & 0x07).all()  # 19 bits of range


def test_the_driver_reads_back_what_the_sensor_saw() -> None:
    sensor = OusterSensor(BEAMS)
    params = load(OusterDriverParams, "ouster_driver", {"latency_s": 0.0})
    builder = SweepBuilder(params, parse(sensor.metadata(), "here"), "here")
    halves = [scene(0, HALF, 2), scene(HALF, BEAMS.columns, 3)]
    end_s, sweep = 5.0, None
    for number, half in enumerate(halves):
        for packet in sensor.packets(half, 3, (number * HALF, (number + 1) * HALF), end_s + number * 0.05):
            sweep = builder.received(packet, 1000.0 + end_s + number * 0.05) or sweep
    assert sweep is not None
    assert sweep.stamp_s == 1000.0 + end_s + 0.05
    assert len(sweep.points) == sum(map(len, halves))
    halves[0]["time"] -= 0.05
    seen = np.concatenate([np.asarray(half) for half in halves])
    order = np.lexsort((seen["ring"], np.rint(seen["time"] / COLUMN_S)))
    found = np.lexsort((sweep.points["ring"], np.rint(sweep.points["time"] / COLUMN_S)))
    for field, tolerance in (("x", 1e-3), ("y", 1e-3), ("z", 1e-3), ("intensity", 0.0), ("ring", 0.0), ("time", 1e-6)):
        difference = np.abs(sweep.points[field][found].astype(float) - seen[field][order])
        assert difference.max() <= tolerance, field


def test_the_shipped_metadata_are_those_of_the_simulated_sensor() -> None:
    plan = load_plan("robot_simulated")
    columns, name = plan.parameters["lidar_driver"]["columns"], plan.parameters["ouster_driver"]["metadata_file"]
    text = (config_dir() / name).read_text(encoding="utf-8")
    assert text == OusterSensor(load_lidar_params("lidar").with_columns(columns).beams).metadata()
    check(parse(text, name), name, load_robot().range_sensors["lidar"])
