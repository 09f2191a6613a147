"""robot-stack calibrate camera, on pictures of a ChArUco board that a known camera took."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.charuco import CalibrationError, calibrate, load_charuco
from robot_stack.cli.errors import CommandError
from robot_stack.core.camera import camera_file, load_intrinsics, mounting
from robot_stack.core.robot import load_robot
from sim.camera.model import draw_camera, load_camera_params, undistort

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
    """The board in fifteen places, near and far, tilted both ways, by inverse mapping through the true camera."""
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
    assert error is not None
    assert float(error[1]) < 0.2
    sigma = re.search(r"fx +[0-9.]+ +\+- ([0-9.]+)", result.output)
    assert sigma is not None
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
    assert box is not None
    width_mm, height_mm = (float(value) * 25.4 / 72.0 for value in box.groups())
    assert (width_mm, height_mm) == pytest.approx((360.0 + 24.0, 240.0 + 24.0), abs=0.5)
