"""A camera at rest composes its picture once; the result equals that of a camera that has just arrived."""

from __future__ import annotations

import numpy as np

from sim.camera.conditions import CLEAR, Conditions
from sim.camera.motion import Motion

from .bench import PARAMS, place, renderer, true_camera

DOCK = "chair_1"
HERE, BOARDS = place(-1.5, 0.1, 0.05), {DOCK: place(0.0, 0.0)}


def at(base: np.ndarray) -> Motion:
    return Motion.still(base, BOARDS)


def test_the_same_again_differs_by_noise_alone() -> None:
    resting, arriving = renderer(true_camera(), PARAMS), renderer(true_camera(), PARAMS)
    memory = np.zeros((720, 1280), np.uint8)
    first = resting.render(at(HERE), out=memory).copy()
    assert memory.mean() > 50.0
    again = resting.render(at(place(-1.5 + 1e-8, 0.1, 0.05)))
    arriving.render(at(place(-4.0, 1.0, 0.3)))
    assert np.array_equal(again, arriving.render(at(HERE))), "the noise of the second picture, the scene of the first"
    assert not np.array_equal(first, again)


def test_a_move_of_the_robot_or_of_the_board_or_other_light_is_another_picture() -> None:
    for motion, conditions in (
        (at(place(-1.49, 0.1, 0.05)), CLEAR),
        (Motion.still(HERE, {DOCK: place(0.01, 0.0)}), CLEAR),
        (Motion.still(HERE, {}), CLEAR),
        (at(HERE), Conditions(illumination=0.5)),
    ):
        resting, arriving = renderer(true_camera(), PARAMS), renderer(true_camera(), PARAMS)
        resting.render(at(HERE))
        arriving.render(at(place(-4.0, 1.0, 0.3)))
        assert np.array_equal(resting.render(motion, conditions), arriving.render(motion, conditions))
