"""robot-stack calibrate: a camera on rendered pictures of a ChArUco board, a LiDAR and wheels on generated rides."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.charuco import CalibrationError, calibrate, load_charuco
from robot_stack.cli.errors import CommandError
from robot_stack.core.camera import camera_file, load_intrinsics, mounting
from robot_stack.core.config import config_dir
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.core.robot import load_robot
from robot_stack.drive.odometry import Encoders, Odometry
from sim.camera.model import draw_camera, load_camera_params, undistort
from sim.mapping.ride_writer import RideWriter
from tests.unit.drive.test_odometry import RADIUS_ERRORS, ZERO_ERRORS
from tests.unit.mapping import site
from tests.unit.mapping.test_mount import turned

PARAMS = load_charuco()
FRAME = "front_camera"
CAMERA = draw_camera(
    FRAME,
    load_intrinsics(camera_file(FRAME)),
    mounting(load_robot(), FRAME),
    load_camera_params(),
    np.random.default_rng(4),
).intrinsics
_FINER = 2  # samples along each side of a pixel


@pytest.fixture(scope="module")
def pictures() -> dict[str, np.ndarray]:
    """Renders the board at fifteen poses, near and far, tilted both ways, by inverse mapping of the camera."""
    step = 1.0 / _FINER
    x, y = (np.arange(0, size, step) + 0.5 * step - 0.5 for size in (CAMERA.width, CAMERA.height))
    rays = undistort(CAMERA, np.stack(np.meshgrid(x, y), axis=-1))
    random = np.random.default_rng(1)
    found = {}
    for index in range(15):
        tilt = 0.6 * np.array([np.cos(2.4 * index), np.sin(2.4 * index)])
        turn = Rotation.from_euler("xyz", [*tilt, random.uniform(-0.3, 0.3)]).as_matrix()
        middle = np.array([0.5 * PARAMS.columns, 0.5 * PARAMS.rows, 0.0]) * PARAMS.square_m
        spot = np.array([(-0.35, 0.0, 0.35)[index % 3], (-0.18, 0.18, 0.0)[index // 3 % 3], 1.0])
        place = spot * (0.36, 0.42, 0.5, 0.6)[index % 4] - turn @ middle
        found[f"{index:02d}.png"] = _picture(rays, turn, place, random)
    return found


def _picture(rays: np.ndarray, turn: np.ndarray, place: np.ndarray, random: np.random.Generator) -> np.ndarray:
    # Inverse of (column x, column y, place): normalized rays to the board's plane.
    plane = np.linalg.inv(np.c_[turn[:, :2], place])
    spots = rays @ plane[:, :2].T + plane[:, 2]
    texels = PARAMS.image().shape[1] / (PARAMS.columns * PARAMS.square_m)
    where = (spots[..., :2] / spots[..., 2:] * texels - 0.5).astype(np.float32)
    board = cv2.copyMakeBorder(PARAMS.image(), 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    fine = cv2.remap(board, where[..., 0] + 40, where[..., 1] + 40, cv2.INTER_LINEAR, borderValue=120)
    grey = cv2.resize(fine, (CAMERA.width, CAMERA.height), interpolation=cv2.INTER_AREA).astype(float)
    noisy = cv2.GaussianBlur(20.0 + 0.75 * grey, (0, 0), 0.6) + 1.5 * random.standard_normal(grey.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def folder(pictures: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pictures")
    for name, picture in pictures.items():
        cv2.imwrite(str(path / name), picture)
    return path


def test_it_finds_the_true_camera_and_writes_it(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "camera.yaml"
    result = CliRunner().invoke(app, ["calibrate", "camera", str(folder), "--output", str(target)])
    assert result.exit_code == 0, result.output
    found = load_intrinsics(target)
    assert found.fx == pytest.approx(CAMERA.fx, rel=1e-3)
    assert found.fy == pytest.approx(CAMERA.fy, rel=1e-3)
    assert found.cx == pytest.approx(CAMERA.cx, abs=1.0)
    assert found.cy == pytest.approx(CAMERA.cy, abs=1.0)
    assert found.distortion[:2] == pytest.approx(CAMERA.distortion[:2], abs=0.01)
    error = re.search(r"reprojection error ([0-9.]+) px", result.output)
    assert float(error[1]) < 0.2
    sigma = re.search(r"fx +[0-9.]+ +\+- ([0-9.]+)", result.output)
    assert 0.0 < float(sigma[1]) < 1.0
    assert "15 of 15 pictures used" in result.output


def test_too_few_pictures_no_board_and_other_sizes_are_refused(pictures: dict[str, np.ndarray]) -> None:
    few = dict(list(pictures.items())[:3])
    with pytest.raises(CalibrationError, match=r"only 3 of 3 pictures show the 9 x 6 .*; 8 are needed"):
        calibrate(few, PARAMS)
    with pytest.raises(CalibrationError, match="no picture of 1 shows the 9 x 6 board"):
        calibrate({"empty": np.full((720, 1280), 128, np.uint8)}, PARAMS)
    with pytest.raises(CalibrationError, match=r"small is 640x360, 00\.png is 1280x720"):
        calibrate({"00.png": pictures["00.png"], "small": pictures["00.png"][::2, ::2]}, PARAMS)
    with pytest.raises(CalibrationError, match="no pictures"):
        calibrate({}, PARAMS)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "name a folder of pictures"),
        (["/nowhere"], "/nowhere is no folder"),
        (["{tmp}"], "has no pictures"),
        (["{tmp}", "--frame", "top_camera"], "no camera 'top_camera'; there are front_camera, rear_camera"),
    ],
)
def test_wrong_use_is_one_clear_line(tmp_path: Path, arguments: list[str], message: str) -> None:
    filled = [argument.format(tmp=tmp_path) for argument in arguments]
    result = CliRunner().invoke(app, ["calibrate", "camera", *filled])
    assert isinstance(result.exception, CommandError)
    assert message in str(result.exception)


def test_a_picture_of_another_size_than_the_cameras_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((480, 640), np.uint8))
    result = CliRunner().invoke(app, ["calibrate", "camera", str(tmp_path)])
    assert "a.png is 640x480; front_camera takes pictures of 1280x720" in str(result.exception)


def test_the_board_is_printed_to_scale(tmp_path: Path) -> None:
    path = tmp_path / "board.pdf"
    result = CliRunner().invoke(app, ["calibrate", "camera", "--board-pdf", str(path)])
    assert result.exit_code == 0, result.output
    box = re.search(rb"/MediaBox \[ ?0 0 ([0-9.]+) ([0-9.]+) ?\]", path.read_bytes())
    width_mm, height_mm = (float(value) * 25.4 / 72.0 for value in box.groups())
    assert (width_mm, height_mm) == pytest.approx((360.0 + 24.0, 240.0 + 24.0), abs=0.5)


@pytest.fixture(scope="module")
def tilted_ride(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a LiDAR that is mounted with roll 1.2, pitch -0.8 and yaw 1.5 deg."""
    folder = tmp_path_factory.mktemp("rides") / "tilted"
    with RideWriter(folder) as bag:
        for time_s, points, pose in site.in_order(site.recorded()):
            if pose is None:
                bag.sweep(time_s, turned(points, (1.2, -0.8, 1.5)))
            else:
                bag.odometry(time_s, Odometry(pose=pose, twist=ZERO_TWIST))
    return folder


@pytest.fixture
def coarse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Configures the mapping for a LiDAR with few points."""
    folder = tmp_path / "config"
    shutil.copytree(config_dir(), folder, ignore=shutil.ignore_patterns("maps"))
    (folder / "mapping.yaml").write_text(yaml.safe_dump(site.params().model_dump(mode="json")), encoding="utf-8")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(folder))


def test_a_lidars_mount_is_found_and_drawn(tilted_ride: Path, coarse: None, tmp_path: Path) -> None:
    picture = tmp_path / "mount.png"
    result = CliRunner().invoke(app, ["calibrate", "lidar", str(tilted_ride), "--picture", str(picture)])
    assert result.exit_code == 0, result.output
    found = re.search(r"rpy_deg: \[(.+), (.+), (.+)\]", result.stdout)
    assert [float(angle) for angle in found.groups()] == pytest.approx([1.2, -0.8, 1.5], abs=0.3)
    assert "xyz_m: [0.2, 0, 0.7" in result.stdout
    assert "no message on /sensors/imu" in result.stderr
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_lidar_mount_with_excessive_deviation_is_rejected(tilted_ride: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["calibrate", "lidar", str(tilted_ride)])
    assert isinstance(result.exception, CommandError)
    assert re.search(r"the deviation of the heading is 0\.\d\d deg, allowed are 0\.1", str(result.exception))
    result = CliRunner().invoke(app, ["calibrate", "lidar", str(tilted_ride), "--rpy-deg", "0", "0", "400"])
    assert "rpy-deg must be three angles" in str(result.exception)
    result = CliRunner().invoke(app, ["calibrate", "lidar", str(tmp_path / "nothing")])
    assert isinstance(result.exception, CommandError)


def wheels_ride(folder: Path, ways: Callable[[float], tuple[float, float]]) -> Path:
    """Records 40 s of joint states with wheel and zero errors. ways: returns (m/s, rad) of all modules at a time."""
    radius_m, way_m = load_robot().wheel_radius_m, np.zeros(4)
    with RideWriter(folder) as bag:
        for tick in range(2000):
            speed, heading = ways(0.02 * tick)
            drive = way_m / (radius_m * (1.0 + np.array(RADIUS_ERRORS)))
            steer = heading + np.array(ZERO_ERRORS)
            bag.joint_states(Encoders(1.0 + 0.02 * tick, tuple(drive.tolist()), tuple(steer.tolist())))
            way_m += 0.02 * speed
    return folder


def test_wheels_that_differ_are_named_and_drawn(tmp_path: Path) -> None:
    ride = wheels_ride(tmp_path / "ride", lambda s: (0.8, 0.6 * np.sin(0.3 * s)))
    picture = tmp_path / "wheels.png"
    result = CliRunner().invoke(app, ["calibrate", "wheels", str(ride), "--picture", str(picture)])
    assert result.exit_code == 0, result.output
    rows = re.findall(r"^(\w\w) +([+-][\d.]+) % .*? ([+-][\d.]+) deg", result.stdout, re.MULTILINE)
    assert [name for name, _, _ in rows] == ["fl", "fr", "rl", "rr"]
    assert [float(value) for _, value, _ in rows] == pytest.approx(100.0 * np.array(RADIUS_ERRORS), abs=0.01)
    assert [float(value) for _, _, value in rows] == pytest.approx(np.degrees(ZERO_ERRORS), abs=0.01)
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("speed_mps", "why"), [(0.0, "there is no motion"), (0.03, "does not determine the wheel radii")]
)
def test_wheel_calibration_rejects_ride_without_enough_motion(tmp_path: Path, speed_mps: float, why: str) -> None:
    ride = wheels_ride(tmp_path / "ride", lambda s: (speed_mps, 0.0))
    result = CliRunner().invoke(app, ["calibrate", "wheels", str(ride)])
    assert isinstance(result.exception, CommandError)
    assert why in str(result.exception)
