"""Each condition changes a picture as specified, and randomness depends only on the seed."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from sim.camera.conditions import CLEAR, Conditions, Glare, Shadow
from sim.camera.faults import CameraFaults
from sim.camera.motion import Motion
from sim.camera.render import Renderer
from sim.camera.scenery import build_scenery
from sim.plant.fault_table import FaultRefused
from sim.plant.terrain import solids
from sim.worldfile import load_world
from tests.unit.sim.camera.bench import DOCKS, PARAMS, marker_sides, place, project_on, renderer, sharp, true_camera

CAMERA = true_camera()
BOARD = place(-4.5, 11.0, np.radians(183.0))
BASE = BOARD @ place(-1.3, 0.0)
SCENE = Motion.still(BASE, {"chair_1": BOARD})
WHITE = PARAMS.board.white * PARAMS.sensor.white_dn
BLACK = PARAMS.board.black * PARAMS.sensor.white_dn


def ids(picture: NDArray[np.uint8]) -> set[int]:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DOCKS.dictionary))
    found = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)[1]
    return set() if found is None else {int(marker) for marker in np.ravel(found)}


def marker_patch(picture: NDArray[np.uint8], marker: int) -> NDArray[np.uint8]:
    corners = project_on(CAMERA, np.concatenate(marker_sides(marker)), BOARD, BASE)
    (left, top), (right, bottom) = corners.min(axis=0).astype(int), corners.max(axis=0).astype(int)
    return picture[top : bottom + 1, left : right + 1]


@pytest.fixture(scope="module")
def plain() -> Renderer:
    """Returns a sharp camera without noise."""
    return renderer(CAMERA, sharp())


@pytest.fixture(scope="module")
def clear(plain: Renderer) -> NDArray[np.uint8]:
    return plain.render(SCENE)


def test_a_clear_picture_has_the_levels_of_its_paint(clear: NDArray[np.uint8]) -> None:
    patch = marker_patch(clear, 0)
    assert ids(clear) == {0, 1, 2, 3}
    assert np.isin(patch, [round(BLACK), round(WHITE)]).mean() > 0.85
    assert clear[360, 640] == round(PARAMS.board.panel * PARAMS.sensor.white_dn)


def test_the_same_seed_draws_the_same_pictures() -> None:
    sequence = (CLEAR, Conditions(rain=0.5, dirt={1: 0.2}), CLEAR)
    first, again, other = (
        [view.render(SCENE, conditions) for conditions in sequence]
        for view in (renderer(CAMERA, PARAMS, seed) for seed in (8, 8, 9))
    )
    assert all(np.array_equal(one, same) for one, same in zip(first, again, strict=True))
    assert not any(np.array_equal(one, different) for one, different in zip(first, other, strict=True))
    assert not np.array_equal(first[0], first[2]), "noise is new in each picture"


def test_noise_is_read_noise_and_shot_noise() -> None:
    view = renderer(CAMERA, PARAMS)
    pictures = np.stack([view.render(SCENE)[340:380, 620:660].astype(float) for _ in range(20)])
    sensor, level = PARAMS.sensor, PARAMS.board.panel * PARAMS.sensor.white_dn
    sigma = np.sqrt(sensor.read_noise_dn**2 + level * 255.0 / sensor.full_well_e + 1.0 / 12.0)
    assert pictures.std(axis=0).mean() == pytest.approx(sigma, rel=0.05)
    assert pictures.mean() == pytest.approx(level, abs=0.1)
    louder = view.render(SCENE, Conditions(noise_factor=6.0))[340:380, 620:660]
    assert louder.astype(float).std() == pytest.approx(6.0 * sigma, rel=0.1)


def test_dark_is_amplified_as_far_as_the_sensor_can(plain: Renderer, clear: NDArray[np.uint8]) -> None:
    dim = plain.render(SCENE, Conditions(illumination=0.5))
    assert np.abs(dim.astype(int) - clear).max() <= 1, "the gain makes up for it"
    dark = plain.render(SCENE, Conditions(illumination=0.02))
    assert dark[360, 640] == round(0.02 * PARAMS.sensor.max_gain * PARAMS.board.panel * PARAMS.sensor.white_dn)


def test_blur_is_that_of_a_gaussian(clear: NDArray[np.uint8], plain: Renderer) -> None:
    blurred = plain.render(SCENE, Conditions(blur_px=2.0))
    wanted = cv2.GaussianBlur(clear.astype(np.float32), (0, 0), 2.0)
    inner = np.s_[300:420, 500:780]
    assert np.abs(blurred[inner] - wanted[inner]).max() < 2.0


def test_defocus_grows_away_from_the_focus() -> None:
    lens = PARAMS.lens.model_copy(update={"blur_px": 0.4, "aperture_m": 0.008})
    view = renderer(CAMERA, sharp().model_copy(update={"lens": lens}))

    def steepest(distance_m: float) -> float:
        base = BOARD @ place(-0.35 - distance_m, 0.0)
        picture = view.render(Motion.still(base, {"chair_1": BOARD})).astype(float)
        corners = project_on(CAMERA, marker_sides(0)[3], BOARD, base)
        row, column = int(corners[:, 1].mean()), int(corners[:, 0].mean())
        return float(-np.diff(picture[row, column - 8 : column + 9]).min())

    assert steepest(lens.focus_m) > 1.3 * steepest(0.7)
    assert steepest(lens.focus_m) > 1.3 * steepest(3.5)


def test_a_shadow_takes_its_share_beyond_its_edge(plain: Renderer, clear: NDArray[np.uint8]) -> None:
    edge = Shadow(offset_m=0.05, angle_rad=0.0, depth=0.6)
    picture = plain.render(SCENE, Conditions(shadow=edge))
    assert np.array_equal(marker_patch(picture, 0), marker_patch(clear, 0)), "the left is in the light"
    dark, bright = marker_patch(picture, 1)[3:-3, 3:-3], marker_patch(clear, 1)[3:-3, 3:-3]
    assert np.unique(dark[bright == round(WHITE)]).tolist() == [round(0.4 * WHITE)]
    column = project_on(CAMERA, np.array([[0.0, -0.05, 0.45]]), BOARD, BASE)[0, 0]
    hard = picture[360].astype(float)
    step = np.flatnonzero(np.abs(np.diff(hard)) > 20.0)
    assert np.abs(step - column).min() < 1.5
    sloping = plain.render(SCENE, Conditions(gradient_per_m=(0.5, 0.0)))
    left, right = project_on(CAMERA, np.array([[0.0, 0.05, 0.45], [0.0, -0.05, 0.45]]), BOARD, BASE)[:, 0]
    ratio = float(sloping[360, round(right)]) / float(sloping[360, round(left)])
    assert ratio == pytest.approx(1.025 / 0.975, abs=0.02), "light can fall off along the board"
    soft = plain.render(SCENE, Conditions(shadow=replace(edge, softness_m=0.1)))[360].astype(float)
    assert np.abs(np.diff(soft[560:740])).max() < 5.0


def test_glare_saturates_its_place_and_veils_the_rest(plain: Renderer, clear: NDArray[np.uint8]) -> None:
    picture = plain.render(SCENE, Conditions(glare=Glare(300.0, 200.0, 60.0, 30.0)))
    assert picture[170:231, 270:331].min() == 255
    far = picture[600:700, 1100:1250].astype(float) - clear[600:700, 1100:1250]
    assert far.min() > 25.0
    assert far.max() < 80.0


def test_rain_dirt_and_covers_change_their_places_alone(plain: Renderer, clear: NDArray[np.uint8]) -> None:
    picture = plain.render(SCENE, Conditions(rain=0.7))
    changed = (np.abs(picture.astype(int) - clear) > 5).mean()
    assert 0.005 < changed < 0.15
    assert (picture == clear).mean() > 0.7
    covered = plain.render(SCENE, Conditions(covered=frozenset([1])))
    assert ids(covered) == {0, 2, 3}
    assert np.unique(marker_patch(covered, 1)[3:-3, 3:-3]).tolist() == [round(PARAMS.board.cover * 230.0)]
    picture = plain.render(SCENE, Conditions(dirt={2: 0.3}))
    changed = np.abs(picture.astype(int) - clear) > 10
    assert 0.15 < marker_patch(changed, 2).mean() < 0.45
    for other in (0, 1, 3):
        assert not marker_patch(changed, other).any()


def test_wall_in_front_of_board_hides_markers() -> None:
    world = load_world("yard")
    view = Renderer(CAMERA, DOCKS, sharp(), np.random.default_rng(0), build_scenery(solids(world), DOCKS))
    charger = place(-3.45, 0.0, np.pi)
    behind_the_depot = place(-7.0, 0.0, 0.0)
    assert ids(view.render(Motion.still(place(-1.5, 0.0, np.pi), {"charger": charger}))) == {4, 5, 6, 7}
    turned = charger @ place(0.0, 0.0, np.pi)  # its front faces the depot
    assert ids(view.render(Motion.still(behind_the_depot, {"charger": turned}))) == set()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rain": 1.5}, "rain must be in 0..1, is 1.5"),
        ({"illumination": float("nan")}, "illumination must be in 0..10, is nan"),
        ({"dirt": {3: -1.0}}, "dirt of marker 3"),
        ({"glare": Glare(0.0, 0.0, float("inf"))}, "glare.radius_px"),
        ({"shadow": Shadow(depth=2.0)}, "shadow.depth"),
    ],
)
def test_conditions_out_of_range_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Conditions(**values)  # type: ignore[arg-type]


def test_camera_faults_become_conditions_and_end() -> None:
    faults = CameraFaults(("front", "rear"), range(4), (720, 1280))
    assert faults.conditions("front", 0.0) == CLEAR
    faults.inject("rain", "front", 0.0, 2.0, 10.0)
    faults.inject("dirt", "3", 0.4, 0.0, 10.0)
    assert faults.conditions("front", 11.0) == Conditions(rain=0.6, dirt={3: 0.4})
    assert faults.conditions("rear", 11.0) == Conditions(dirt={3: 0.4})
    assert faults.conditions("front", 12.0) == Conditions(dirt={3: 0.4})
    faults.inject("cover", "", 0.0, 0.0, 12.0)
    assert faults.conditions("rear", 12.0).covered == frozenset(range(4))
    assert faults.inject("clear", "cover:1", 0.0, 0.0, 12.0) == "cleared cover:1"
    assert faults.conditions("rear", 12.0).covered == frozenset([0, 2, 3])
    faults.inject("clear", "", 0.0, 0.0, 12.0)
    assert faults.conditions("rear", 12.0) == CLEAR


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (("fog", "front", 0.0, 0.0), "no fault 'fog'"),
        (("rain", "top", 0.0, 0.0), "target must be one of 'front', 'rear'"),
        (("dirt", "9", 0.0, 0.0), "target must be one of '0', '1', '2', '3'"),
        (("rain", "front", 3.0, 0.0), r"must be in 0.01..1, is 3.0"),
    ],
)
def test_camera_faults_that_make_no_sense_are_refused(request_: tuple[str, str, float, float], message: str) -> None:
    faults = CameraFaults(("front", "rear"), range(4), (720, 1280))
    with pytest.raises(FaultRefused, match=message):
        faults.inject(*request_, 0.0)
