"""Camera images as JPEG."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot_stack.core.jpeg import grey_jpeg

SCENE = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (720, 1280), np.uint8), (0, 0), 16.0) * 8


def decoded(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def test_a_wide_image_is_shrunk_with_its_aspect_ratio() -> None:
    picture = decoded(grey_jpeg(SCENE, 640, 90))
    assert picture.shape == (360, 640)
    expected = cv2.resize(SCENE, (640, 360), interpolation=cv2.INTER_AREA)
    assert np.abs(picture.astype(int) - expected).mean() < 3.0
    assert len(grey_jpeg(SCENE, 640, 30)) < len(grey_jpeg(SCENE, 640, 90))
    assert decoded(grey_jpeg(SCENE[:100, :200], 640, 90)).shape == (100, 200), "a narrow one keeps its size"
    assert decoded(grey_jpeg(np.zeros((1, 4000), np.uint8), 160, 90)).shape == (1, 160), "a flat one keeps a row"


def test_rows_with_padding_are_encoded_without_it() -> None:
    padded = np.zeros((8, 32), np.uint8)
    padded[:, 16:] = 255
    assert decoded(grey_jpeg(padded[:, :16], 640, 95)).max() == 0


def test_an_image_that_cannot_be_encoded_is_an_error() -> None:
    """JPEG has 65 500 rows at most."""
    with pytest.raises(ValueError, match="1 x 70000"):
        grey_jpeg(np.zeros((70_000, 1), np.uint8), 640, 90)
