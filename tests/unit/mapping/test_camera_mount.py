"""A camera's mount from the robot's motion in front of a board, on synthetic views with LiDAR and camera noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.contract.frames import FRONT_CAMERA
from robot_stack.core.camera import mounting
from robot_stack.core.config import load
from robot_stack.core.robot import load_robot
from robot_stack.mapping.camera_mount import CameraMountFound, camera_mount_of
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.poses import Floats, inverse, planar, pose_of, rotation_of, vector_of
from robot_stack.mapping.ride import RideError

SETTINGS = load(MappingParams, "mapping").camera_mount
NOMINAL = mounting(load_robot(), FRONT_CAMERA)
OFF_DEG, OFF_M = (1.5, -1.0, 2.0), (0.02, -0.015)


def camera() -> Floats:
    pose = NOMINAL.copy()
    pose[:3, :3] = rotation_of(np.radians(OFF_DEG)) @ NOMINAL[:3, :3]
    pose[:2, 3] += OFF_M
    return pose


def way(views: int, ahead_m: float, aside_m: float, turn_deg: float) -> Floats:
    """Returns (views, 4, 4) poses: to and fro, to both sides, turning both ways."""
    t = np.linspace(0.0, 2.0 * math.pi, views)
    return np.array(
        [
            planar(ahead_m * math.sin(2.0 * s), aside_m * math.sin(3.0 * s), math.radians(turn_deg) * math.sin(5.0 * s))
            for s in t
        ]
    )


def views(base: Floats, seed: int, place_m: float = 0.003, angle_deg: float = 0.03) -> tuple[Floats, Floats]:
    """Returns base with the noise of a LiDAR, and the board in the camera, 1.8 m ahead and facing the robot."""
    random = np.random.default_rng(seed)
    board = pose_of(np.array([1.8, 0.1, 0.5]), rotation_of(np.array([0.0, 0.0, 0.1])))
    seen = inverse(base @ camera()) @ board
    noise = pose_of(
        place_m * random.standard_normal((len(base), 3)),
        rotation_of(math.radians(angle_deg) * random.standard_normal((len(base), 3))),
    )
    return base @ noise, seen


def errors(found: CameraMountFound) -> tuple[Floats, Floats]:
    """Returns the errors (angles about base_link's axes, rad; position in x and y, m)."""
    turn = vector_of(found.pose[:3, :3] @ camera()[:3, :3].T)
    return turn, found.pose[:2, 3] - camera()[:2, 3]


def test_camera_mount_errors_agree_with_reported_deviations() -> None:
    scaled = []
    for seed in range(12):
        found = camera_mount_of(*views(way(60, 0.8, 0.5, 14.0), seed), NOMINAL, SETTINGS)
        turn, shift = errors(found)
        assert np.abs(turn).max() < math.radians(0.15)
        assert np.abs(shift).max() < 0.010
        assert found.pose[2, 3] == NOMINAL[2, 3]
        scaled += [*(turn / found.angle_deviation_rad), *(shift / found.place_deviation_m)]
    # The reported deviations must match the errors: the root mean square of these 60 ratios is 1.
    assert math.sqrt(np.mean(np.square(scaled))) == pytest.approx(1.0, abs=0.3)


def test_views_that_are_wrong_move_it_little() -> None:
    base, seen = views(way(60, 0.8, 0.5, 14.0), 1)
    base[::12, 0, 3] += 0.2  # one wrong match in twelve sweeps
    turn, shift = errors(camera_mount_of(base, seen, NOMINAL, SETTINGS))
    assert np.abs(turn).max() < math.radians(0.3)
    assert np.abs(shift).max() < 0.01


@pytest.mark.parametrize(
    ("base", "noise_m", "why"),
    [
        (way(10, 0.35, 0.3, 14.0), 0.003, "only 10 views of the board, at least 25"),
        (way(60, 0.35, 0.3, 3.0), 0.003, r"turned by only 6 deg .* 15 deg are needed"),
        (way(60, 0.02, 0.0, 14.0), 0.02, r"the deviation of the angles is \d+\.\d+ deg, at most 0\.1 deg"),
    ],
    ids=["few", "no turn", "no way"],
)
def test_camera_mount_from_insufficient_views_is_rejected(base: Floats, noise_m: float, why: str) -> None:
    with pytest.raises(RideError, match=why):
        camera_mount_of(*views(base, 0, place_m=noise_m), NOMINAL, SETTINGS)


def test_camera_mount_with_excessive_position_deviation_is_rejected() -> None:
    settings = SETTINGS.model_copy(update={"deviation_deg": 5.0})
    with pytest.raises(RideError, match=r"the deviation of the position is \d+\.\d mm, at most 5 mm"):
        camera_mount_of(*views(way(60, 0.5, 0.5, 8.0), 0, place_m=0.02), NOMINAL, settings)
