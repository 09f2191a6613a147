"""robot-stack map build, show and check: on a small recorded ride, and on invalid recordings."""

from __future__ import annotations

import json
import shutil
import sqlite3

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.errors import CommandError
from robot_stack.cli.map_build import build_from_recordings, problems_of
from robot_stack.cli.map_recording import points_of, read_ride
from robot_stack.core.config import config_dir
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.core.robot import load_robot
from robot_stack.core.site_map import FREE, load_map
from robot_stack.drive.odometry import Odometry
from sim.mapping.ride_writer import RideWriter
from sim.plant.imu import ImuSample
from tests.unit.mapping import site

ORIGIN = (site.START.x, site.START.y, site.START.yaw)


def write_ride(folder, *, sweeps: bool = True, odometry: bool = True, until_s: float = site.DURATION_S) -> None:
    with RideWriter(folder) as bag:
        for time_s, points, pose in site.in_order(site.recorded()):
            if time_s > until_s:
                break
            if pose is None:
                if sweeps:
                    bag.sweep(time_s, points)
                continue
            if odometry:
                bag.odometry(time_s, Odometry(pose=pose, twist=ZERO_TWIST))
            rate = site.SPEED_MPS / site.RADIUS_M if time_s > site.STAND_S else 0.0
            bag.imu(ImuSample(time_s, (0.0, 0.0, 9.81), (0.0, 0.0, rate), (0.0, 0.0, 0.0, 1.0)))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rides") / "ride"
    write_ride(folder)
    return folder


@pytest.fixture(scope="module")
def own_config(tmp_path_factory):
    """The configuration with a map builder for few points."""
    folder = tmp_path_factory.mktemp("config") / "config"
    shutil.copytree(config_dir(), folder, ignore=shutil.ignore_patterns("maps"))
    (folder / "mapping.yaml").write_text(yaml.safe_dump(site.params().model_dump(mode="json")), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def folder(recording, own_config, tmp_path_factory):
    output = tmp_path_factory.mktemp("maps")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROBOT_STACK_CONFIG", str(own_config))
        build_from_recordings([recording], "room", output, ORIGIN, plot=True)
    return output / "room"


def test_a_recording_becomes_a_map(folder):
    loaded = load_map(str(folder))
    assert len(loaded.cells.count) > 50
    assert (loaded.grid.occupancy == FREE).sum() > 500
    assert loaded.about["begins_at"]["x_m"] == site.START.x
    assert loaded.about["drift"]["loops_closed"] >= 1
    assert loaded.about["drift"]["map_worst_loop_m"] < 0.03 < loaded.about["drift"]["wheel_odometry_worst_loop_m"]
    assert problems_of(loaded) == []
    assert (folder / "map.png").read_bytes().startswith(b"\x89PNG")


def test_show_and_check(folder, tmp_path):
    picture = tmp_path / "again.png"
    shown = CliRunner().invoke(app, ["map", "show", str(folder), "--picture", str(picture)])
    assert shown.exit_code == 0, shown.output
    assert "loops closed" in shown.output
    assert picture.is_file()
    checked = CliRunner().invoke(app, ["map", "check", str(folder)])
    assert checked.exit_code == 0
    assert "checksums agree" in checked.output


def test_show_lists_and_draws_zones(folder, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    ring = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]
    features = [
        {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        for properties in (
            {"name": "lawn", "type": "keepout"},
            {"name": "ward", "type": "speed", "speed_limit_mps": 0.4},
            {"name": "lane", "type": "one_way", "heading_deg": 90.0},
        )
    ]
    (copy / "zones.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    places = [{"type": "Point", "coordinates": [0.0, 0.0]}, {"type": "Point", "coordinates": [2.0, 1.0]}]
    lanes = [{"type": "Feature", "properties": {"id": i}, "geometry": place} for i, place in enumerate(places)]
    edge = {"id": 2, "startid": 0, "endid": 1}
    lanes.append({"type": "Feature", "properties": edge, "geometry": {"type": "MultiLineString"}})
    (copy / "graph.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": lanes}))
    plain, drawn = tmp_path / "plain.png", tmp_path / "drawn.png"
    assert CliRunner().invoke(app, ["map", "show", str(folder), "--picture", str(plain)]).exit_code == 0
    shown = CliRunner().invoke(app, ["map", "show", str(copy), "--picture", str(drawn)])
    assert f"zones: {copy / 'zones.geojson'}" in shown.output
    assert "zone lawn: keepout, 1.0 m2 of the map" in shown.output
    assert "zone ward: speed, 0.4 m/s, 1.0 m2 of the map" in shown.output
    assert "zone lane: one_way, 90 deg, 1.0 m2 of the map" in shown.output
    assert "route graph: 2 nodes, 1 edges" in shown.output
    assert plain.read_bytes() != drawn.read_bytes()


def read(path):
    return read_ride(path, site.params().sweeps, load_robot(), lambda *_: None)


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ({"sweeps": False}, "/sensors/lidar/points"),
        ({"odometry": False}, "/odom"),
        ({"until_s": 4.0}, "too short"),
    ],
)
def test_rides_that_make_no_map(tmp_path, what, words):
    write_ride(tmp_path / "ride", **what)
    with pytest.raises(CommandError, match=words):
        read(tmp_path / "ride")


def test_truncated_recording_is_read_up_to_damage(recording, tmp_path):
    data = (recording / "ride_0.mcap").read_bytes()
    file = tmp_path / "cut.mcap"
    file.write_bytes(data[: int(0.8 * len(data))])
    ride, warnings = read(file)
    assert len(ride.sweeps) >= site.params().sweeps.fewest
    assert "cut off or damaged" in warnings[0]
    file.write_bytes(data[:3000])
    with pytest.raises(CommandError, match="no message on"):
        read(file)


def test_what_is_no_recording(tmp_path):
    with pytest.raises(CommandError, match="cannot be read"):
        read(tmp_path / "nowhere.mcap")
    file = tmp_path / "text.mcap"
    file.write_text("no recording", encoding="utf-8")
    with pytest.raises(CommandError, match="no recording"):
        read(file)
    (tmp_path / "empty").mkdir()
    with pytest.raises(CommandError, match="no recording"):
        read(tmp_path / "empty")


def test_a_rosbag2_in_sqlite(recording, tmp_path):
    """A ride as ros2 bag records it by default."""
    from rosbags.highlevel import AnyReader
    from rosbags.rosbag2 import Writer

    target = tmp_path / "bag"
    with AnyReader([recording]) as source, Writer(target, version=9) as writer:
        made = {c.id: writer.add_connection(c.topic, c.msgtype, typestore=source.typestore) for c in source.connections}
        for connection, at_ns, data in source.messages():
            writer.write(made[connection.id], at_ns, data)
    assert list(target.glob("*.db3"))
    ride, warnings = read(target)
    assert not warnings
    assert len(ride.sweeps) == len(read(recording)[0].sweeps)
    database = next(target.glob("*.db3"))
    with sqlite3.connect(database) as connection:
        connection.execute("DROP TABLE messages")
    with pytest.raises(CommandError):
        read(target)


@pytest.mark.parametrize(
    ("name", "origin", "words"),
    [("../up", None, "name"), ("", None, "name"), ("room", (0.0, float("nan"), 0.0), "origin")],
)
def test_wrong_names_and_origins_are_refused(recording, name, origin, words, tmp_path):
    with pytest.raises(CommandError, match=words):
        build_from_recordings([recording], name, tmp_path, origin, plot=False)


def test_a_recording_given_twice_is_refused(recording, tmp_path):
    with pytest.raises(CommandError, match="given twice"):
        build_from_recordings([recording, recording], "room", tmp_path, None, plot=False)


class Cloud:
    """A minimal decoded PointCloud2."""

    def __init__(self, names=("x", "y", "z", "time"), size: int = 32) -> None:
        self.fields = [Field(name, 4 * number) for number, name in enumerate(names)]
        self.width, self.height, self.point_step, self.is_bigendian = 2, 1, 16, False
        self.data = np.arange(8, dtype="<f4").tobytes()[:size]


class Field:
    def __init__(self, name: str, offset: int) -> None:
        self.name, self.offset, self.datatype = name, offset, 7


def test_points_are_found_by_name():
    points = points_of(Cloud(("time", "z", "y", "x")))
    assert points["time"].tolist() == [0.0, 4.0]
    assert points["x"].tolist() == [3.0, 7.0]
    with pytest.raises(ValueError, match="field time is missing"):
        points_of(Cloud(("x", "y", "z", "t")))
    with pytest.raises(ValueError, match="31 bytes"):
        points_of(Cloud(size=31))


def test_the_demonstration_site_has_its_map():
    """Built from a recorded ride: large enough to navigate, small enough for the repository."""
    loaded = load_map("yard")
    assert problems_of(loaded) == []
    assert loaded.about["made_from"] == "the recording of a ride"
    assert loaded.about["ride"]["length_m"] > 150.0
    assert loaded.about["drift"]["map_worst_loop_m"] < 0.05
    assert (loaded.grid.occupancy == FREE).sum() * loaded.grid.resolution_m**2 > 600.0
    assert sum(file.stat().st_size for file in (config_dir() / "maps" / "yard").iterdir()) < 3e6
