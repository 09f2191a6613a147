"""Printed markers: the content and position that a camera would detect on the paper."""

from __future__ import annotations

import io
import math

import cv2
import numpy as np
import pytest

from robot_stack.core.docks import Dock, MarkerPlace, load_docks
from robot_stack.docking.tools.board_page import board_page, describe
from robot_stack.docking.tools.marker_page import DoesNotFit, NoSuchMarker, marker_bits, marker_page
from robot_stack.docking.tools.page import MM_PER_INCH, PAPERS

DOCKS = load_docks()
DPI = 300


def rendered(page) -> np.ndarray:
    """Renders the page as printed, 8 bit grey."""
    buffer = io.BytesIO()
    page.figure.savefig(buffer, format="png", dpi=DPI)
    return cv2.imdecode(np.frombuffer(buffer.getvalue(), np.uint8), cv2.IMREAD_GRAYSCALE)


def texts_of(page) -> list[str]:
    return [text.get_text() for text in page.axes.texts]


def detected(image: np.ndarray) -> dict[int, np.ndarray]:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DOCKS.dictionary))
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    return {int(number): square.reshape(4, 2) for number, square in zip(ids.ravel(), corners, strict=True)}


@pytest.mark.parametrize(("marker_id", "size_mm"), [(0, 150.1), (2, 60.0)])
def test_a_camera_reads_the_marker_in_its_size(marker_id, size_mm):
    image = rendered(marker_page(DOCKS.dictionary, marker_id, 1e-3 * size_mm, "chair_1", PAPERS["a4"]))
    assert image.shape == (math.floor(297 / MM_PER_INCH * DPI), math.floor(210 / MM_PER_INCH * DPI))
    found = detected(image)
    assert list(found) == [marker_id]
    corners_mm = found[marker_id] * MM_PER_INCH / DPI
    sides_mm = np.linalg.norm(np.roll(corners_mm, -1, axis=0) - corners_mm, axis=1)
    assert sides_mm == pytest.approx(size_mm, abs=0.1)
    top_left, top_right, bottom_right, _ = corners_mm
    assert top_left[0] < top_right[0]
    assert top_right[1] < bottom_right[1], "the marker stands upright"
    assert corners_mm[:, 0].mean() == pytest.approx(105.0, abs=0.1), "in the middle of the paper"
    # Adjacent black cells show no seam.
    left, top, right, bottom = (round(corner) for corner in (*found[marker_id][0], *found[marker_id][2]))
    cell = size_mm / 6.0 / MM_PER_INCH * DPI
    for edge in (image[top + round(0.5 * cell), left:right], image[top:bottom, left + round(0.5 * cell)]):
        assert edge[2:-2].max() == 0
    if size_mm > 100.0:  # the quiet zone of one cell is white but for the line at its rim
        clear = round(0.8 * cell)
        around = image[top - clear : bottom + clear, left - clear : right + clear].copy()
        around[clear - 3 : -clear + 3, clear - 3 : -clear + 3] = 255
        assert around.min() == 255
    # The ruler is 100 mm long.
    dark = np.flatnonzero(image[round(image.shape[0] - 15.0 / MM_PER_INCH * DPI)] < 128)
    assert (dark[-1] - dark[0] + 1) * MM_PER_INCH / DPI == pytest.approx(100.0, abs=0.3)
    assert len(dark) == dark[-1] - dark[0] + 1


def test_marker_larger_than_paper_is_rejected():
    with pytest.raises(
        DoesNotFit, match=r"a marker of 160 mm needs 213\.333 mm with its quiet zone; A4 has room for 202"
    ):
        marker_page(DOCKS.dictionary, 0, 0.16, "chair_1", PAPERS["a4"])
    marker_page(DOCKS.dictionary, 0, 0.16, "chair_1", PAPERS["a3"])


@pytest.mark.parametrize(
    ("dictionary", "marker_id", "says"),
    [("DICT_4X4_50", 50, "ids 0 to 49"), ("DICT_NOTHING", 0, "no 'DICT_NOTHING'"), ("Board", 0, "no 'Board'")],
)
def test_unknown_markers_are_refused(dictionary, marker_id, says):
    with pytest.raises(NoSuchMarker, match=says):
        marker_bits(dictionary, marker_id)


def test_the_overview_shows_where_the_robot_sees_each_marker():
    page = board_page("chair_1", DOCKS.docks["chair_1"], DOCKS.marker_size_m, PAPERS["a4"])
    texts = texts_of(page)
    assert "marker 0: centre 200 mm to the left, 575 mm above the ground" in texts
    assert "marker 3: centre 200 mm to the right, 325 mm above the ground" in texts
    assert "scale 1:5; markers 150 mm wide" in texts
    centres = [dot.get_path().get_extents().get_points().mean(axis=0) for dot in page.axes.patches]
    assert [text for text in texts if len(text) == 1] == ["0", "1", "2", "3"]
    assert 5.0 * (centres[1] - centres[0])[0] == pytest.approx(400.0)
    assert 5.0 * (centres[0] - centres[2])[1] == pytest.approx(250.0)
    ends = np.concatenate([line.get_xydata() for line in page.axes.lines])
    assert (ends >= 0.0).all()
    assert (ends <= (210.0, 297.0)).all()


def test_description_of_marker_out_of_board_plane():
    place = MarkerPlace(x_m=-0.05, y_m=0.0, z_m=0.4, yaw_rad=math.radians(10.0))
    words = describe(9, place)
    assert words == (
        "marker 9: centre in the middle, 400 mm above the ground, 50 mm nearer to the robot than the board, "
        "facing 10 deg to the right"
    )


def test_a_high_board_is_drawn_smaller():
    high = Dock.model_validate(
        {
            **DOCKS.docks["chair_1"].model_dump(),
            "markers": {0: {"x_m": 0.0, "y_m": 0.0, "z_m": 3.0}},
        }
    )
    page = board_page("pole", high, 0.15, PAPERS["a4"])
    assert "scale 1:20; markers 150 mm wide" in texts_of(page)
    assert max(line.get_ydata().max() for line in page.axes.lines) < 297.0
