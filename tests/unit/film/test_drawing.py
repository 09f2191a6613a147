"""The camera's geometry, faces, and pictures of small scenes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.robot_shape import Solid, placed, transform
from robot_stack.core.site_map import load_map
from robot_stack.film.camera import View, followed
from robot_stack.film.faces import faces_of, prism
from robot_stack.film.painter import Painter
from robot_stack.film.params import Camera, FilmParams
from robot_stack.film.site import drawn_site, empty_site, unmapped

PARAMS = load(FilmParams, "film")
SIZE = (320, 200)
NORTH = Camera(distance_m=10.0, elevation_deg=45.0, azimuth_deg=90.0, field_of_view_deg=40.0, calm_s=0.0)
RED = Solid(kind="box", size_m=(1.0, 1.0, 1.0), at_m=(0.0, 0.0, 0.5), turn_deg=(0.0, 0.0, 0.0), colour="#ff0000")
BLUE = Solid(kind="box", size_m=(1.0, 1.0, 1.0), at_m=(0.0, 2.0, 0.5), turn_deg=(0.0, 0.0, 0.0), colour="#0000ff")
FLOOR = empty_site(np.zeros((1, 2)), margin_m=8.0)


def view(x: float = 0.0, y: float = 0.0) -> View:
    return View(NORTH, np.array([x, y]), SIZE)


def test_looking_north_east_is_right_up_is_up_and_far_is_above() -> None:
    points = np.array([[3, 4, 0], [4, 4, 0], [3, 5, 0], [3, 4, 1.0]])
    middle, east, north, up = view(3.0, 4.0).pixels(points)
    assert middle == pytest.approx((160.0, 100.0))
    assert view(3.0, 4.0).depth_m(points[:1])[0] == pytest.approx(10.0)
    flat = np.c_[points[:3, :2], np.ones(3)] @ view(3.0, 4.0).ground().T
    assert flat[:, :2] / flat[:, 2:] == pytest.approx(np.array([middle, east, north]))
    assert east[0] > middle[0]
    assert east[1] == pytest.approx(middle[1])
    assert north[1] < middle[1]
    assert up[1] < middle[1]
    # 1 m across at 10 m with 40 degrees over 320 px.
    assert east[0] - middle[0] == pytest.approx(160.0 / math.tan(math.radians(20.0)) / 10.0)


def test_a_calm_camera_neither_lags_nor_jerks() -> None:
    steady = np.c_[np.arange(100.0), np.zeros(100)]
    assert followed(steady, 5.0)[50] == pytest.approx((50.0, 0.0))
    jump = np.c_[np.repeat([0.0, 1.0], 50), np.zeros(100)]
    assert np.abs(np.diff(followed(jump, 5.0)[:, 0])).max() < 0.1
    assert followed(jump, 0.0) is jump


@pytest.mark.parametrize("kind", ["box", "cylinder", "sphere"])
def test_faces_enclose_their_solid_and_look_outwards(kind: str) -> None:
    size = (2.0, 1.0, 0.5) if kind == "box" else (2.0, 2.0, 0.5) if kind == "cylinder" else (2.0, 2.0, 2.0)
    solid = Solid(kind=kind, size_m=size, at_m=(1.0, 2.0, 3.0), turn_deg=(10.0, 20.0, 30.0), colour="#808080")
    faces = faces_of(placed("", [solid], transform((5.0, 0.0, 0.0))))
    centre = np.array([6.0, 2.0, 3.0])
    for face in faces:
        assert face.normal @ (face.points.mean(axis=0) - centre) > 0.0
        assert np.linalg.norm(face.normal) == pytest.approx(1.0)
    reach = max(np.linalg.norm(point - centre) for face in faces for point in face.points)
    assert reach <= 0.5 * np.linalg.norm(size) + 1e-9
    assert reach >= 0.5 * max(size) - 1e-9


def test_long_walls_come_in_pieces() -> None:
    outline = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 0.2], [0.0, 0.2]])
    faces = prism(outline, 1.0, np.ones(3), 0.5)
    assert len(faces) == 8 + 1 + 8 + 1
    assert all(np.ptp(face.points[:, 0]) <= 0.5 + 1e-9 for face in faces)
    for face in faces:
        assert face.normal @ (face.points.mean(axis=0) - (2.0, 0.1, 0.5)) > 0.0


def reds_and_blues(solids: list[Solid]) -> tuple[int, int]:
    picture = Painter(FLOOR, *SIZE, 1).paint(view(), placed("", solids, np.eye(4)), [])
    assert picture.shape == (200, 320, 3)
    strong = picture.astype(int)
    red = (strong[..., 0] > 120) & (strong[..., 2] < 80)
    blue = (strong[..., 2] > 120) & (strong[..., 0] < 80)
    return int(red.sum()), int(blue.sum())


def test_what_is_near_hides_what_is_behind_it_whatever_the_order() -> None:
    alone_red, alone_blue = reds_and_blues([RED])[0], reds_and_blues([BLUE])[1]
    for solids in ([RED, BLUE], [BLUE, RED]):
        red, blue = reds_and_blues(solids)
        assert red == pytest.approx(alone_red, rel=0.02)
        assert 0 < blue <= alone_blue
    tall = Solid(kind="box", size_m=(3.0, 1.0, 3.0), at_m=(0.0, 0.0, 1.5), turn_deg=(0.0, 0.0, 0.0), colour="#ff0000")
    assert reds_and_blues([BLUE, tall])[1] == 0


def test_the_yards_map_has_its_buildings_and_no_lid() -> None:
    """A wall around the site is drawn as a wall and covers no path."""
    site = drawn_site(load_map("yard"), PARAMS.wall_height_m)
    heights = [height for _, height in site.roofs]
    assert len(heights) >= 25
    assert max(heights) == PARAMS.wall_height_m
    areas = [area(points) for points, _ in site.roofs]
    assert 25.0 < max(areas) < 60.0  # the hall, 7 x 5 m, and the kerb beside it
    assert all(value > 0.0 for value in areas)  # counter-clockwise
    hall = site.roofs[int(np.argmax(areas))][0]
    assert hall.mean(axis=0) == pytest.approx((22.5, 5.5), abs=2.0)


def test_what_the_map_knows_is_no_obstacle() -> None:
    points = np.array([[19.0, 4.0], [9.0, 2.0], [-5.0, 2.0], [100.0, 100.0]])
    # At the hall's wall; on the open path; inside the depot; beyond the map.
    assert unmapped(points, load_map("yard").grid).tolist() == [[9.0, 2.0], [100.0, 100.0]]
    assert unmapped(np.empty((0, 2)), load_map("yard").grid).shape == (0, 2)


def area(points: np.ndarray) -> float:
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
