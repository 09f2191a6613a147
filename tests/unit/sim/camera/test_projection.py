"""Boards appear where OpenCV projects them, within a few hundredths of a pixel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sim.camera.edges import half_plane, moving_half_plane
from sim.camera.model import corner_rays, project, undistort
from sim.camera.motion import Motion
from tests.unit.sim.camera.bench import (
    DOCKS,
    NOMINAL,
    PARAMS,
    calibrated,
    edge_errors,
    marker_sides,
    place,
    project_on,
    renderer,
    sharp,
    true_camera,
)

BOARD = place(-4.5, 11.0, np.radians(183.0))


@pytest.mark.parametrize(
    "seen_from",
    [
        (-0.95, 0.0, 0.0),  # docked: edges parallel to the pixel grid
        (-1.6, 0.5, -0.35),
    ],
)
def test_edges_are_where_opencv_projects_them(seen_from: tuple[float, float, float]) -> None:
    camera = true_camera()
    base = BOARD @ place(*seen_from)
    picture = renderer(camera, sharp()).render(Motion.still(base, {"chair_1": BOARD}))
    for marker in DOCKS.docks["chair_1"].markers:
        sides = [project_on(camera, side, BOARD, base) for side in marker_sides(marker)]
        errors = edge_errors(picture, sides)
        assert len(errors) > 150
        assert np.abs(errors).max() < 0.03
        assert abs(errors.mean()) < 0.003


def test_the_edges_of_the_calibrated_camera_are_elsewhere() -> None:
    """Calibration tolerances are detected, so an error of the renderer would be detected too."""
    camera = true_camera()
    base = BOARD @ place(-0.95, 0.0, 0.0)
    picture = renderer(camera, sharp()).render(Motion.still(base, {"chair_1": BOARD}))
    assumed = type(camera)(camera.frame, calibrated(), NOMINAL)
    errors = edge_errors(picture, [project_on(assumed, side, BOARD, base) for side in marker_sides(0)])
    assert np.abs(errors).mean() > 0.2


def test_rays_are_the_inverse_of_the_projection() -> None:
    camera = true_camera().intrinsics
    pixels = np.stack(np.meshgrid(np.linspace(-0.5, 1279.5, 33), np.linspace(-0.5, 719.5, 19)), axis=-1)
    rays = undistort(camera, pixels)
    points = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1)
    assert np.abs(project(camera, points) - pixels).max() < 1e-8
    corners = corner_rays(camera)
    assert corners.shape == (721, 1281, 2)
    assert np.allclose(corners[0, 0], undistort(camera, np.array([-0.5, -0.5])), atol=1e-7)


def test_a_true_camera_is_within_the_tolerances_and_drawn_from_its_seed() -> None:
    limits, assumed = PARAMS.tolerances, calibrated()
    cameras = [true_camera(seed) for seed in range(12)]
    for camera in cameras:
        true = camera.intrinsics
        assert abs(true.fx / assumed.fx - 1.0) <= limits.focal_length
        assert abs(true.cx - assumed.cx) <= limits.principal_point_px
        assert abs(true.cy - assumed.cy) <= limits.principal_point_px
        assert np.linalg.norm(camera.mounting[:3, 3] - NOMINAL[:3, 3]) == pytest.approx(limits.position_m)
        turn = camera.mounting[:3, :3].T @ NOMINAL[:3, :3]
        angle = np.arccos(min(1.0, 0.5 * (np.trace(turn) - 1.0)))
        assert angle == pytest.approx(limits.rotation_rad, rel=1e-3)
    assert len({camera.intrinsics.fx for camera in cameras}) == len(cameras)
    assert true_camera(5).intrinsics == true_camera(5).intrinsics
    assert np.array_equal(true_camera(5).mounting, true_camera(5).mounting)


@settings(max_examples=40, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_share_of_a_pixel_beyond_an_edge(middle: float, across: float, down: float) -> None:
    assume(max(abs(across), abs(down), abs(middle)) > 1e-9)  # otherwise there is no edge
    part = (np.arange(100) + 0.5) / 100 - 0.5
    counted = (middle + across * part[None, :] + down * part[:, None] > 0.0).mean()
    assert half_plane(middle, across, down) == pytest.approx(counted, abs=0.012)
    # A diagonal that cuts off a corner with sides of half a pixel: a triangle of 1/8.
    assert half_plane(0.5, 1.0, 1.0) == pytest.approx(0.875)
    assert half_plane(0.1, 0.0, 0.0) == 1.0


@settings(max_examples=40, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_share_of_a_pixel_beyond_a_moving_edge(middle: float, shift: float, across: float, down: float) -> None:
    moments = (np.arange(400) + 0.5) / 400
    summed = np.mean([half_plane(middle + part * shift, across, down) for part in moments])
    assert moving_half_plane(middle, shift, across, down) == pytest.approx(summed, abs=0.01)


def test_a_board_behind_the_camera_beside_it_or_seen_from_behind_shows_no_marker() -> None:
    camera = true_camera()
    view = renderer(camera, sharp())
    empty = view.render(Motion.still(BOARD @ place(-1.5, 0.0), {}))
    for base in (BOARD @ place(-1.5, 0.0, np.pi), BOARD @ place(-1.5, 3.0, 0.3)):
        nothing = view.render(Motion.still(base, {}))
        assert np.array_equal(view.render(Motion.still(base, {"chair_1": BOARD})), nothing)
    behind = view.render(Motion.still(BOARD @ place(1.5, 0.0, np.pi), {"chair_1": BOARD}))
    middle = behind[260:460, 540:740]
    assert middle.min() > 0.9 * PARAMS.board.panel * PARAMS.sensor.white_dn
    assert empty.shape == (720, 1280)
