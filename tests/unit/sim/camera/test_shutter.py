"""Rolling shutter and motion blur: moving objects are sheared and smeared according to their speed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim.camera.model import TrueCamera
from sim.camera.motion import Motion, Track, still
from tests.unit.sim.camera.bench import (
    FRAME,
    NOMINAL,
    calibrated,
    edge_in_line,
    marker_sides,
    place,
    project_on,
    renderer,
    sharp,
)

BOARD = np.eye(4)
CAMERA = TrueCamera(FRAME, calibrated(), NOMINAL)
SPAN_S = 0.02


def turning(base: np.ndarray, rate_radps: float) -> Track:
    """base_link turns on the spot, at ``base`` at time 0."""
    return Track(
        np.array([-SPAN_S, SPAN_S]),
        np.stack([base @ place(0.0, 0.0, -rate_radps * SPAN_S), base @ place(0.0, 0.0, rate_radps * SPAN_S)]),
    )


def sliding(base: np.ndarray, left_mps: float) -> Track:
    return Track(
        np.array([-SPAN_S, SPAN_S]),
        np.stack([base @ place(0.0, -left_mps * SPAN_S), base @ place(0.0, left_mps * SPAN_S)]),
    )


def left_edge(
    picture: np.ndarray, base: np.ndarray, rows: range, beside: np.ndarray | float = 0.0, camera: TrueCamera = CAMERA
) -> np.ndarray:
    """Returns the columns of marker 0's left side in rows of a picture, ``beside`` a still camera's columns."""
    curve = project_on(camera, marker_sides(0)[3], BOARD, base)
    order = np.argsort(curve[:, 1])
    wanted = np.interp(rows, curve[order, 1], curve[order, 0]) + beside
    return np.array([edge_in_line(picture[row].astype(float), round(x)) for row, x in zip(rows, wanted, strict=True)])


def test_a_yawing_camera_shears_the_board() -> None:
    rate, row_s = 1.0, 25e-6
    base = place(-1.0, 0.0)
    params = sharp(exposure_s=1e-6, row_time_s=row_s)
    pinhole = TrueCamera(FRAME, replace(calibrated(), distortion=(0.0,) * 5), NOMINAL)
    view = renderer(pinhole, params)
    # An arbitrary time: only the time relative to the picture counts.
    calm = view.render(Motion.still(base, {"chair_1": BOARD}))
    track = turning(base, rate)
    moved = view.render(Motion(7.0, Track(track.times_s + 7.0, track.poses), {"chair_1": still(BOARD)}))
    rows = range(110, 270)
    column = left_edge(calm, base, rows, camera=pinhole)
    # A left turn moves the image to the right: f (1 + x^2) per rad, x the column's normalized coordinate; and the
    # camera, 0.35 m ahead of the turning point, to the left: f / distance per metre, 0.65 m from the board.
    x = (column.mean() - CAMERA.intrinsics.cx) / CAMERA.intrinsics.fx
    per_rad = CAMERA.intrinsics.fx * (1.0 + x * x + 0.35 / 0.65)
    expected = rate * (np.array(rows) - 359.5) * row_s * per_rad
    assert abs(expected[0]) > 5.0
    shift = left_edge(moved, base, rows, np.round(expected), pinhole) - column
    assert shift == pytest.approx(expected, rel=0.005, abs=0.03)
    fitted = np.polyfit(rows, shift, 1)[0]
    assert fitted == pytest.approx(rate * row_s * per_rad, rel=0.01)


def test_motion_blur_is_as_long_as_the_way_during_the_exposure_around_its_middle() -> None:
    exposure, speed_mps = 0.004, 1.0
    base = place(-0.95, 0.0)
    view = renderer(CAMERA, sharp(exposure_s=exposure, row_time_s=0.0))
    picture = view.render(Motion(0.0, sliding(base, speed_mps), {"chair_1": still(BOARD)}))
    row = 200
    middle = round(float(left_edge(picture, base, range(row, row + 1))[0]))
    part = picture[row, middle - 12 : middle + 13].astype(float)
    slope = -np.diff(part)
    weights = slope / slope.sum()
    columns = np.arange(len(weights))
    variance = weights @ (columns - weights @ columns) ** 2
    length = CAMERA.intrinsics.fx / 0.6 * speed_mps * exposure
    # The pixel, the difference of pixels and the motion are boxes: variances 1/12, 1/12 and length^2 / 12.
    assert math.sqrt(max(0.0, 12.0 * variance - 2.0)) == pytest.approx(length, rel=0.03)
    calm = view.render(Motion.still(base, {"chair_1": BOARD}))
    moved = view.render(Motion(0.0, sliding(base, 0.5), {"chair_1": still(BOARD)}))
    rows = range(180, 260)
    assert left_edge(moved, base, rows) == pytest.approx(left_edge(calm, base, rows), abs=0.02)


def test_tracks_interpolate_and_refuse_nonsense() -> None:
    track = turning(np.eye(4), 2.0)
    halfway = track.at(np.array([0.5 * SPAN_S]))[0]
    assert math.atan2(halfway[1, 0], halfway[0, 0]) == pytest.approx(SPAN_S)
    assert np.allclose(track.at(np.array([9.0]))[0], track.poses[-1])
    with pytest.raises(ValueError, match="times must rise"):
        Track(np.array([0.0, 0.0]), np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(ValueError, match="finite"):
        Track(np.array([0.0]), np.full((1, 4, 4), np.nan))
    with pytest.raises(ValueError, match=r"\(n, 4, 4\) poses"):
        Track(np.array([0.0]), np.zeros((1, 3, 4)))
