"""Edges of markers with subpixel accuracy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.docking.vision.edges import COUNT, NX, NY, camera_vector, distort_points, fit_sides, undistort_points
from tests.unit.docking.vision.images import (
    CAMERA,
    CLEAN,
    SIZE_M,
    USUAL,
    Array,
    Image,
    Look,
    background,
    draw,
    finish,
    project,
)

VECTOR = camera_vector(CAMERA)
WIDTHS = np.array([8.0, 4.0, 4.0])
LIMITS = np.array([12.0, 0.35, 0.35, 0.1, 0.02])
H = 0.5 * SIZE_M
CORNERS = np.array([[-H, H, 0.0], [H, H, 0.0], [H, -H, 0.0], [-H, -H, 0.0]])


def at(x_m: float, y_m: float, z_m: float, turn_rad: float = 0.0) -> Array:
    """Returns the (4, 4) pose of a marker that faces the camera, rotated in the image plane."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = x_m, y_m, z_m
    return pose


def image_of(pose: Array, look: Look = CLEAN) -> Image:
    image = background()
    draw(image, 3, pose)
    return finish(image, look, np.random.default_rng(1))


def fitted(image: Image, pose: Array, start_error_px: float = 1.5) -> tuple[Array, Array]:
    """Returns the (4, 2) px corners fitted from displaced ones, and the sides."""
    pixels = project(CORNERS, pose)
    start = pixels + start_error_px * np.array([[1.0, 0.4], [-0.7, 0.9], [0.5, -1.0], [-1.0, -0.6]])
    corners = undistort_points(VECTOR, start).reshape(1, 4, 2)
    sides = fit_sides(image, VECTOR, corners, WIDTHS, LIMITS)
    return distort_points(VECTOR, corners[0]), sides[0]


def test_distortion_agrees_with_opencv_and_its_inverse_undoes_it() -> None:
    points = np.random.default_rng(0).uniform([-0.68, -0.38], [0.68, 0.38], (200, 2))
    pixels = distort_points(VECTOR, points)
    np.testing.assert_allclose(pixels, project(np.c_[points, np.ones(200)], np.eye(4)), atol=1e-9)
    np.testing.assert_allclose(undistort_points(VECTOR, pixels), points, atol=1e-11)


@pytest.mark.parametrize("pose", [at(0.0, 0.0, 0.6), at(0.28, -0.15, 0.7, 0.2), at(-0.5, 0.3, 1.0, 0.7)])
def test_corners_of_a_sharp_image_are_exact_to_a_fiftieth_of_a_pixel(pose: Array) -> None:
    corners, sides = fitted(image_of(pose), pose)
    np.testing.assert_allclose(corners, project(CORNERS, pose), atol=0.02)
    assert (sides[:, COUNT] > 40).all()
    if pose[0, 3] == 0.0:  # upright: the normals point out of the marker
        np.testing.assert_allclose(sides[:, [NX, NY]], [[0, -1], [1, 0], [0, 1], [-1, 0]], atol=2e-3)
    blurred, _ = fitted(image_of(pose, Look(blur_px=1.0, noise=4.0)), pose)
    assert np.sqrt(np.mean((blurred - project(CORNERS, pose)) ** 2)) < 0.03


def test_frontal_edges_show_no_bias_with_their_place_between_pixels() -> None:
    errors = []
    for k in range(8):
        # The steps are no multiple of the sixteenth of a pixel used for rendering.
        pose = at(0.618 * k / 900.0, 0.236 * k / 900.0, 1.0 + 0.0007 * k)
        corners, _ = fitted(image_of(pose, Look(blur_px=0.5)), pose)
        errors.append(corners - project(CORNERS, pose))
    assert np.abs(np.mean(errors, axis=0)).max() < 0.02
    assert np.abs(errors).max() < 0.06


def test_lens_distortion_bends_no_side() -> None:
    # At the image's rim a straight fit in pixels would be wrong by the sagitta of the curved side, here 0.3 px.
    pose = at(-0.42, 0.2, 0.7, 0.4)
    pixels = project(np.linspace(CORNERS[0], CORNERS[1], 3), pose)
    chord = 0.5 * (pixels[0] + pixels[2])
    assert np.linalg.norm(pixels[1] - chord) > 0.2
    corners, _ = fitted(image_of(pose), pose)
    np.testing.assert_allclose(corners, project(CORNERS, pose), atol=0.025)


def test_a_shadow_across_the_sides_moves_no_corner() -> None:
    pose = at(0.0, 0.0, 1.0, 0.1)
    image = background()
    draw(image, 3, pose)
    rows, columns = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    image[columns + 0.6 * rows > 850.0] *= 0.35
    errors = []
    for seed in range(8):
        corners, sides = fitted(finish(image, USUAL, np.random.default_rng(seed)), pose)
        assert (sides[:, COUNT] > 0).all()
        errors.append(corners - project(CORNERS, pose))
    assert np.abs(np.mean(errors, axis=0)).max() < 0.04
    # In the dark part the noise relative to the contrast is three times as large.
    assert np.sqrt(np.mean(np.square(errors))) < 0.05


def test_dirt_on_a_third_of_a_side_moves_no_corner() -> None:
    pose = at(0.0, 0.0, 0.8, 0.1)
    image = background()
    draw(image, 3, pose)
    top = project(np.array([[-0.2 * H, H, 0.0], [0.4 * H, H, 0.0]]), pose)
    (x0, y), (x1, _) = top.round().astype(int)
    image[y - 6 : y + 9, x0:x1] = 60.0
    corners, sides = fitted(finish(image, USUAL, np.random.default_rng(3)), pose)
    assert (sides[:, COUNT] > 0).all()
    assert np.linalg.norm(corners - project(CORNERS, pose), axis=1).max() < 0.08


def test_hidden_marker_side_has_no_edge_points() -> None:
    pose = at(0.0, 0.0, 0.8)
    image = background()
    draw(image, 3, pose)
    top = int(project(CORNERS, pose)[0, 1])
    image[: top + 14] = 20.0
    _, sides = fitted(finish(image, USUAL, np.random.default_rng(3)), pose)
    assert sides[0, COUNT] == 0.0
    assert (sides[1:, COUNT] > 0.0).all()


def test_nothing_is_found_where_nothing_is() -> None:
    _, sides = fitted(np.full((720, 1280), 128, np.uint8), at(0.0, 0.0, 1.0))
    assert (sides[:, COUNT] == 0.0).all()


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=True, width=32), min_size=8, max_size=8),
    st.integers(0, 2**32 - 1),
)
def test_any_start_in_any_image_gives_finite_sides(values: list[float], seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (48, 64), dtype=np.uint8)
    corners = np.array(values).reshape(1, 4, 2)
    sides = fit_sides(image, VECTOR, corners, WIDTHS, LIMITS)
    assert np.isfinite(sides).all()
    corners = np.random.default_rng(seed).uniform(-0.71, -0.63, (1, 4, 2))
    corners[..., 1] += 0.27
    assert np.isfinite(fit_sides(image, VECTOR, corners, WIDTHS, LIMITS)).all()
