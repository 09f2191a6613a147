"""robot-stack calibrate extrinsics, on a recording of a room, a LiDAR of few rings and the chair's markers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.errors import CommandError
from robot_stack.contract.frames import FRONT_CAMERA
from robot_stack.core.camera import camera_file, load_intrinsics, mounting, turned_by_deg
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.robot import load_robot
from robot_stack.drive.odometry import Odometry
from robot_stack.mapping.poses import Floats, planar, rotation_of
from sim.camera.model import TrueCamera
from sim.camera.motion import Motion
from sim.camera.params import load_camera_params
from sim.camera.render import Renderer
from sim.mapping.ride_writer import RideWriter
from tests.unit.mapping import site

ROBOT = load_robot()
DOCK = "chair_1"
BOARD = planar(5.0, 0.1, 0.05)
OFF_DEG, OFF_M = (0.9, -0.7, 1.2), (0.015, -0.010)
PLACES, STAND_S, MOVE_S = 30, 1.0, 0.5
NOISE_M = 0.005


def true_camera() -> TrueCamera:
    mount = mounting(ROBOT, FRONT_CAMERA)
    mount[:3, :3] = rotation_of(np.radians(OFF_DEG)) @ mount[:3, :3]
    mount[:2, 3] += OFF_M
    return TrueCamera(FRONT_CAMERA, load_intrinsics(camera_file(FRONT_CAMERA)), mount)


def place(number: int) -> Pose2:
    turn = math.tau * number / PLACES
    return Pose2(3.0 + 0.8 * math.sin(turn), 0.4 * math.sin(2.0 * turn), math.radians(14.0) * math.sin(7.0 * turn))


def sweep(pose: Pose2, random: np.random.Generator) -> np.ndarray:
    """Returns an (n,) SWEEP at standstill: 24 rings of 360 points in the room."""
    azimuth, elevation = np.meshgrid(np.arange(360) * math.tau / 360, np.radians(np.linspace(-24.0, 20.0, 24)))
    flat = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    lidar = planar(pose.x, pose.y, pose.yaw) @ np.array([*ROBOT.lidar_xyz_m, 1.0])
    turned = flat @ planar(0.0, 0.0, pose.yaw)[:3, :3].T
    ranges = site.cast(np.tile(lidar[:3], (len(flat), 1)), turned, site.WALLS + site.BOXES[1:])
    seen = np.isfinite(ranges)
    points = np.zeros(int(seen.sum()), SWEEP)
    points["x"], points["y"], points["z"] = (
        flat[seen] * (ranges[seen] + NOISE_M * random.standard_normal(int(seen.sum())))[:, None]
    ).T
    return points


def write(folder: Path, images: bool, stand_s: float) -> Path:
    random = np.random.default_rng(5)
    params = load_camera_params()
    renderer = Renderer(true_camera(), load_docks(), params, random) if images else None
    leg_s = stand_s + MOVE_S
    with RideWriter(folder) as bag:
        for tick in range(round(50 * leg_s * PLACES)):
            time_s = 1.0 + 0.02 * tick
            number, since_s = divmod(0.02 * tick, leg_s)
            pose = _between(place(int(number)), place(int(number) + 1), max(0.0, (since_s - stand_s) / MOVE_S))
            bag.odometry(time_s, Odometry(pose=pose, twist=ZERO_TWIST))
            if round(50 * since_s) == round(35 * stand_s):
                bag.sweep(time_s, sweep(pose, random))
                if renderer is not None:
                    here = planar(pose.x, pose.y, pose.yaw)
                    bag.image(time_s, FRONT_CAMERA, renderer.render(Motion.still(here, {DOCK: BOARD})))
    return folder


def _between(one: Pose2, other: Pose2, share: float) -> Pose2:
    return Pose2(*(a + share * (b - a) for a, b in zip(_tuple(one), _tuple(other), strict=True)))


def _tuple(pose: Pose2) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.yaw


@pytest.fixture(scope="module")
def ride(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("rides") / "board", images=True, stand_s=STAND_S)


def test_it_finds_the_mount_and_draws(ride: Path, tmp_path: Path) -> None:
    picture = tmp_path / "camera.png"
    result = CliRunner().invoke(app, ["calibrate", "extrinsics", str(ride), "--picture", str(picture)])
    assert result.exit_code == 0, result.output
    truth = true_camera().mounting
    assert _numbers("front_camera_rpy_deg", result.stdout) == pytest.approx(
        turned_by_deg(truth[:3, :3], FRONT_CAMERA), abs=0.15
    )
    assert _numbers("front_camera_xyz_m", result.stdout) == pytest.approx(truth[:3, 3], abs=0.006)
    assert f"{PLACES} places in front of the markers of {DOCK}; {PLACES} of {PLACES} images" in result.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")


def _numbers(key: str, text: str) -> list[float]:
    found = re.search(rf"{key}: \[(.+)\]", text)
    assert found is not None, text
    return [float(number) for number in found[1].split(",")]


@pytest.mark.parametrize(
    ("make", "arguments", "why"),
    [
        (
            lambda folder: folder,
            ["--frame", "top_camera"],
            "no camera 'top_camera'; there are front_camera, rear_camera",
        ),
        (lambda folder: folder, [], "is no recording|cannot be read"),
        (lambda folder: write(folder, images=False, stand_s=1.0), [], "no message on /sensors/camera/front/image"),
        (lambda folder: write(folder, images=True, stand_s=0.1), [], "no standstill with the markers in view"),
    ],
    ids=["camera", "recording", "images", "never stands"],
)
def test_extrinsics_calibration_rejects_unusable_ride(
    make: Callable[[Path], Path], arguments: list[str], why: str, tmp_path: Path
) -> None:
    folder = make(tmp_path / "ride")
    result = CliRunner().invoke(app, ["calibrate", "extrinsics", str(folder), *arguments])
    assert isinstance(result.exception, CommandError), result.output
    assert re.search(why, str(result.exception))


def test_images_without_markers_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "ride"
    random = np.random.default_rng(1)
    with RideWriter(folder) as bag:
        for tick in range(200):
            bag.odometry(1.0 + 0.02 * tick, Odometry(pose=place(0), twist=ZERO_TWIST))
            if tick % 10 == 9:
                bag.sweep(1.0 + 0.02 * tick, sweep(place(0), random))
                bag.image(1.0 + 0.02 * tick, FRONT_CAMERA, np.full((720, 1280), 90, np.uint8))
    result = CliRunner().invoke(app, ["calibrate", "extrinsics", str(folder)])
    assert "none of 20 images of front_camera shows the markers of a dock" in str(result.exception)


def test_poses_of_base_link_are_those_of_the_frames() -> None:
    """A camera looking ahead from its place in robot.yaml, and its angles about base_link's axes."""
    pose: Floats = mounting(ROBOT, FRONT_CAMERA)
    assert turned_by_deg(pose[:3, :3], FRONT_CAMERA) == pytest.approx((0.0, 0.0, 0.0))
    robot = ROBOT.model_copy(update={"front_camera_rpy_deg": (0.0, 0.0, 90.0)})
    assert mounting(robot, FRONT_CAMERA)[:3, 2] == pytest.approx([0.0, 1.0, 0.0])  # facing left
    robot = ROBOT.model_copy(update={"front_camera_rpy_deg": (0.0, 30.0, 0.0)})
    assert mounting(robot, FRONT_CAMERA)[2, 2] == pytest.approx(-0.5)  # a positive pitch faces down
    assert turned_by_deg(mounting(robot, FRONT_CAMERA)[:3, :3], FRONT_CAMERA) == pytest.approx((0.0, 30.0, 0.0))
