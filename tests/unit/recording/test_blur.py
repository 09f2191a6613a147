"""Images are blurred in their bytes, and everything else of the message stays."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from robot_stack.recording.nodes.blur import blurred

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
IMAGE = "sensor_msgs/msg/Image"
RANDOM = np.random.default_rng(1)


def image(encoding: str, channels: int, height: int = 64, width: int = 96, step: int = 0) -> tuple[bytes, np.ndarray]:
    """(message, its pixels) of noise, so that every detail would be seen."""
    step = step or width * channels
    pixels = RANDOM.integers(0, 256, height * step, dtype=np.uint8)
    stamp = TYPES["builtin_interfaces/msg/Time"](12, 34)
    header = TYPES["std_msgs/msg/Header"](stamp, "front_camera_optical")
    message = TYPES[IMAGE](header, height, width, encoding, 0, step, pixels)
    return bytes(STORE.serialize_cdr(message, IMAGE)), pixels


@pytest.mark.parametrize(("encoding", "channels"), [("mono8", 1), ("bgr8", 3), ("rgb8", 3)])
def test_each_square_has_its_mean_colour(encoding: str, channels: int) -> None:
    data, pixels = image(encoding, channels)
    seen = STORE.deserialize_cdr(blurred(data, 32), IMAGE)
    assert (seen.header.frame_id, seen.header.stamp.sec, seen.encoding) == ("front_camera_optical", 12, encoding)
    before = pixels.reshape(64, 96, channels).astype(float)
    after = seen.data.reshape(64, 96, channels)
    for row in (0, 32):
        for column in (0, 32, 64):
            square = after[row : row + 32, column : column + 32].reshape(-1, channels)
            assert (square == square[0]).all(), "no detail is left"
            mean = before[row : row + 32, column : column + 32].reshape(-1, channels).mean(0)
            assert np.abs(square[0] - mean).max() <= 1.0


def test_an_image_smaller_than_a_square_is_one_colour() -> None:
    data, _ = image("mono8", 1, height=5, width=7)
    assert len(set(STORE.deserialize_cdr(blurred(data, 32), IMAGE).data.tolist())) == 1


@pytest.mark.parametrize(
    ("encoding", "channels", "step"), [("16UC1", 2, 0), ("bayer_rggb8", 1, 0), ("mono8", 1, 128), ("bgr8", 3, 100)]
)
def test_what_cannot_be_blurred_becomes_black(encoding: str, channels: int, step: int) -> None:
    data, _ = image(encoding, channels, step=step)
    seen = STORE.deserialize_cdr(blurred(data, 32), IMAGE)
    assert seen.encoding == encoding
    assert not seen.data.any()


def test_zero_keeps_the_image() -> None:
    data, _ = image("mono8", 1)
    assert blurred(data, 0) is data
