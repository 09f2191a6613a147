"""The marker detector on rendered images: poses, ambiguity, damaged markers and invalid input."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.docking.vision.detector import MarkerDetector, MarkerObservation
from robot_stack.docking.vision.params import ArucoDetectorParams
from tests.unit.docking.vision.images import (
    CAMERA,
    CLEAN,
    USUAL,
    Array,
    Image,
    background,
    draw,
    facing,
    finish,
    picture,
    project,
)

DOCKS = load_docks()
DOCK = DOCKS.docks["chair_1"]
PARAMS = load(ArucoDetectorParams, "aruco_detector").detector
FRAME = "front_camera"
MIDDLE = np.array([0.0, 0.0, 0.45, 1.0])


@pytest.fixture
def detector() -> MarkerDetector:
    return MarkerDetector(DOCKS, PARAMS)


def board_of(seen: MarkerObservation) -> Array:
    return seen.pose @ np.linalg.inv(DOCK.markers[seen.marker_id].pose())


def errors(seen: MarkerObservation, board: Array) -> tuple[float, float]:
    """Returns the position error (mm) of the board's centre and the yaw error (deg)."""
    pose = board_of(seen)
    turn = board[:3, :3].T @ pose[:3, :3]
    yaw_deg = math.degrees(math.atan2(turn[1, 0], turn[0, 0]))
    return 1e3 * float(np.linalg.norm((pose - board) @ MIDDLE)), abs(yaw_deg)


def ids(seen: tuple[MarkerObservation, ...]) -> list[int]:
    return [item.marker_id for item in seen]


def test_sharp_images_give_the_pose_to_a_fiftieth_of_a_millimetre(detector: MarkerDetector) -> None:
    board = facing(1.0, yaw_rad=0.3, pitch_rad=-0.1, x_m=0.1, y_m=-0.05)
    seen = detector.detect(picture(DOCK, board), CAMERA, FRAME)
    assert ids(seen) == [0, 1, 2, 3]
    for item in seen:
        error_mm, yaw_deg = errors(item, board)
        assert error_mm < 0.02
        assert yaw_deg < 0.005
        # All observations contain the same board pose, each with its own marker's pose.
        np.testing.assert_allclose(board_of(item), board_of(seen[0]), atol=1e-12)
        corners = np.array([[-0.075, 0.075, 0.0], [0.075, 0.075, 0.0], [0.075, -0.075, 0.0], [-0.075, -0.075, 0.0]])
        expected = project(corners, board @ DOCK.markers[item.marker_id].pose())
        np.testing.assert_allclose(item.corners_px, expected, atol=0.03)
        assert not item.ambiguous
        assert item.quality == pytest.approx(1.0 / (1.0 + (item.position_sigma_m / 0.01) ** 2))


@pytest.mark.parametrize(("distance_m", "worst_mm", "worst_deg"), [(0.6, 0.06, 0.02), (3.0, 1.2, 0.2)])
def test_pose_error_with_noise_and_blur_is_within_limit_and_reported_sigma(
    detector: MarkerDetector, distance_m: float, worst_mm: float, worst_deg: float
) -> None:
    random = np.random.default_rng(7)
    ratios = []
    for seed in range(3):
        tilt = random.uniform(-0.43, 0.43)
        board = facing(distance_m, tilt, 0.3 * tilt, *(0.04 * distance_m * random.uniform(-1.0, 1.0, 2)))
        seen = detector.detect(picture(DOCK, board, USUAL, seed), CAMERA, FRAME)
        assert seen
        error_mm, yaw_deg = errors(seen[0], board)
        assert error_mm < worst_mm
        assert yaw_deg < worst_deg
        ratios.append(error_mm / (1e3 * seen[0].position_sigma_m))
    assert 0.05 < np.median(ratios) < 2.5


def test_a_covered_marker_leaves_the_pose_to_the_others(detector: MarkerDetector) -> None:
    board = facing(1.0, yaw_rad=-0.2)
    for _ in range(2):  # full search, then tracking
        seen = detector.detect(picture(DOCK, board, USUAL, without=(2,)), CAMERA, FRAME)
        assert ids(seen) == [0, 1, 3]
        assert errors(seen[0], board)[0] < 0.1


def test_a_marker_at_the_wrong_place_is_left_out(detector: MarkerDetector) -> None:
    board = facing(1.0, yaw_rad=0.2)
    image = background()
    for marker, place in DOCK.markers.items():
        pose = board @ place.pose()
        if marker == 1:
            pose[:3, 3] += pose[:3, :3] @ np.array([0.004, 0.0, 0.0])  # displaced by 4 mm
        draw(image, marker, pose)
    seen = detector.detect(finish(image, USUAL, np.random.default_rng(0)), CAMERA, FRAME)
    assert ids(seen) == [0, 2, 3]
    assert errors(seen[0], board)[0] < 0.1


def test_single_small_frontal_marker_is_flagged_ambiguous(detector: MarkerDetector) -> None:
    board = facing(4.5, yaw_rad=0.03, pitch_rad=0.02)
    seen = detector.detect(picture(DOCK, board, USUAL, 3, without=(1, 2, 3)), CAMERA, FRAME)
    assert ids(seen) == [0]
    assert seen[0].ambiguous
    assert seen[0].quality <= 0.2
    whole = detector.detect(picture(DOCK, board, USUAL, 3), CAMERA, FRAME)
    assert not whole[0].ambiguous


def test_a_marker_of_no_dock_has_its_own_pose(detector: MarkerDetector) -> None:
    pose = facing(0.8, yaw_rad=0.3) @ DOCK.markers[0].pose()
    image = background()
    draw(image, 17, pose)
    (seen,) = detector.detect(finish(image, USUAL, np.random.default_rng(0)), CAMERA, FRAME)
    assert seen.marker_id == 17
    np.testing.assert_allclose(seen.pose[:3, 3], pose[:3, 3], atol=2e-3)
    np.testing.assert_allclose(seen.pose[:3, :3], pose[:3, :3], atol=2e-2)


def test_the_rolling_shutter_of_a_moving_camera_is_undone_from_the_second_image_on(detector: MarkerDetector) -> None:
    # Every 15 rows of these images have their own pose, at 0.3 m/s and 0.2 rad/s.
    row_time_s = PARAMS.shutter.row_time_s
    uncorrected = MarkerDetector(DOCKS, PARAMS)

    def board_at(time_s: float) -> Array:
        return facing(1.0 - 0.3 * time_s, 0.3 + 0.2 * time_s, 0.05, 0.1, 0.1)

    def rolled(stamp_s: float) -> Image:
        image = background()
        for top in range(0, CAMERA.height, 15):
            board = board_at(stamp_s + (top + 7.0 - 0.5 * (CAMERA.height - 1)) * row_time_s)
            for marker, place in DOCK.markers.items():
                draw(image, marker, board @ place.pose(), rows=(top, top + 15))
        return finish(image, CLEAN, np.random.default_rng(0))

    images = [(stamp_s, rolled(stamp_s)) for stamp_s in (0.0, 0.1)]
    for stamp_s, image in images:
        seen = detector.detect(image, CAMERA, FRAME, stamp_s)
        plain = uncorrected.detect(image, CAMERA, FRAME)
    assert errors(plain[0], board_at(0.1))[0] > 0.3
    assert errors(seen[0], board_at(0.1))[0] < 0.1


def test_nothing_is_seen_in_an_empty_image_and_later_images_are_searched_again(detector: MarkerDetector) -> None:
    board = facing(1.0)
    empty, full = finish(background(), USUAL, np.random.default_rng(0)), picture(DOCK, board, USUAL)
    for image, count in ((full, 4), (empty, 0), (empty, 0), (full, 4)):
        assert len(detector.detect(image, CAMERA, FRAME)) == count
    far = picture(DOCK, facing(3.0, x_m=-1.0), USUAL)  # far from the last position
    assert len(detector.detect(far, CAMERA, FRAME)) == 4


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (np.zeros((720, 1280), np.float32), "image: must be an array of uint8, is float32"),
        (np.zeros((720, 1280, 3), np.uint8), "image: shape is (720, 1280, 3)"),
        (np.zeros((480, 640), np.uint8), "image: shape is (480, 640), intrinsics say (height, width) = (720, 1280)"),
    ],
)
def test_wrong_images_are_refused_by_name(detector: MarkerDetector, image: Array, text: str) -> None:
    with pytest.raises(ValueError, match=r"image: ") as caught:
        detector.detect(image, CAMERA, FRAME)  # type: ignore[arg-type]
    assert text in str(caught.value)


def test_wrong_intrinsics_and_stamps_are_refused_by_name(detector: MarkerDetector) -> None:
    image = np.zeros((720, 1280), np.uint8)
    for wrong, text in (
        (replace(CAMERA, fx=math.nan), "intrinsics: must be finite"),
        (replace(CAMERA, fy=-900.0), "focal lengths must be positive"),
    ):
        with pytest.raises(ValueError, match=text):
            detector.detect(image, wrong, FRAME)
    with pytest.raises(ValueError, match="stamp_s: must be finite"):
        detector.detect(image, CAMERA, FRAME, math.inf)


@settings(max_examples=5, deadline=None)
@given(
    st.floats(0.5, 3.5), st.floats(-1.2, 1.2), st.floats(-0.6, 0.6), st.floats(-0.5, 0.5), st.floats(-0.3, 0.3),
    st.integers(0, 2**31),
)  # fmt: skip
def test_whatever_is_reported_is_finite_and_near_the_truth(
    distance_m: float, yaw_rad: float, pitch_rad: float, aside: float, up: float, seed: int
) -> None:
    board = facing(distance_m, yaw_rad, pitch_rad, aside * distance_m, up * distance_m)
    detector = MarkerDetector(DOCKS, PARAMS)
    for item in detector.detect(picture(DOCK, board, USUAL, seed), CAMERA, FRAME):
        assert np.isfinite(item.pose).all()
        assert np.isfinite(item.corners_px).all()
        assert 0.0 <= item.quality <= 1.0
        assert math.isfinite(item.position_sigma_m)
        assert math.isfinite(item.yaw_sigma_rad)
        np.testing.assert_allclose(item.pose[:3, :3] @ item.pose[:3, :3].T, np.eye(3), atol=1e-9)
        if item.quality > 0.9:
            assert errors(item, board)[0] < 30.0
