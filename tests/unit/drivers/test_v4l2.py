"""Camera buffers: valid images, which of them are decoded, and their stamps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.core.config import ConfigError, load, validate
from robot_stack.drivers.v4l2.frames import BadFrame, FrameChooser, decode
from robot_stack.drivers.v4l2.params import PixelFormat, V4l2CameraDriverParams

PARAMS = load(V4l2CameraDriverParams, "v4l2_camera_driver")
HEIGHT, WIDTH = 48, 64
PERIOD_S = 1.0 / PARAMS.frame_rate_hz


def ramp() -> NDArray[np.uint8]:
    """Returns an image whose brightness grows with column and row."""
    return (np.arange(WIDTH, dtype=np.uint8)[None, :] * 3 + np.arange(HEIGHT, dtype=np.uint8)[:, None]).astype(np.uint8)


def jpeg(quality: int = 100) -> NDArray[np.uint8]:
    return np.asarray(cv2.imencode(".jpg", ramp(), [cv2.IMWRITE_JPEG_QUALITY, quality])[1], np.uint8).reshape(-1)


def changed(**changes: object) -> V4l2CameraDriverParams:
    return validate(V4l2CameraDriverParams, PARAMS.model_dump() | changes, "test")


def test_grey_is_the_bytes() -> None:
    data = ramp().reshape(1, -1)
    pixels = decode(data, PixelFormat.GREY, HEIGHT, WIDTH)
    data[:] = 0  # the kernel reuses the buffer
    np.testing.assert_array_equal(pixels, ramp())


def test_yuyv_is_every_other_byte() -> None:
    data = np.full(2 * HEIGHT * WIDTH, 128, np.uint8)
    data[::2] = ramp().reshape(-1)
    np.testing.assert_array_equal(decode(data, PixelFormat.YUYV, HEIGHT, WIDTH), ramp())


@pytest.mark.parametrize("padding", [0, 1, 4096])
def test_a_jpeg_may_be_padded(padding: int) -> None:
    data = np.append(jpeg(), np.zeros(padding, np.uint8))
    assert np.abs(decode(data, PixelFormat.MJPG, HEIGHT, WIDTH).astype(int) - ramp()).max() <= 2


@pytest.mark.parametrize("kept", [0, 2, 100, 400])
def test_truncated_jpeg_is_rejected(kept: int) -> None:
    assert kept < len(jpeg())
    with pytest.raises(BadFrame, match="is no JPEG" if kept == 0 else "is cut off"):
        decode(jpeg()[:kept], PixelFormat.MJPG, HEIGHT, WIDTH)


def test_empty_jpeg_is_rejected() -> None:
    with pytest.raises(BadFrame, match="cannot be decoded"):
        decode(np.frombuffer(b"\xff\xd8\x00\x01\xff\xd9", np.uint8), PixelFormat.MJPG, HEIGHT, WIDTH)


def test_jpeg_with_a_size_beyond_the_decoder_is_rejected() -> None:
    data = jpeg()
    size = data.tobytes().index(b"\xff\xc0") + 5
    data[size] = data[size + 2] = 0xFF
    with pytest.raises(BadFrame, match="cannot be decoded"):
        decode(data, PixelFormat.MJPG, HEIGHT, WIDTH)


def test_another_size_is_refused_by_name() -> None:
    with pytest.raises(BadFrame, match="is 64x48, the calibration is for 64x50"):
        decode(jpeg(), PixelFormat.MJPG, 50, WIDTH)
    with pytest.raises(BadFrame, match="has 3071 bytes instead of 3072"):
        decode(ramp().reshape(-1)[1:], PixelFormat.GREY, HEIGHT, WIDTH)


@pytest.mark.parametrize("jitter_s", [0.0, 0.004])
def test_every_third_frame_of_thirty_a_second_becomes_an_image(jitter_s: float) -> None:
    chooser, random = FrameChooser(PARAMS, HEIGHT, WIDTH), np.random.default_rng(1)
    stamps = [100.0 + PERIOD_S * number + jitter_s * random.uniform(-1, 1) for number in range(301)]
    taken = [stamp for stamp in stamps if chooser.wants(stamp, stamp + 0.03)]
    assert len(taken) == 101
    assert np.abs(np.diff(taken) - 0.1).max() < 2.0 * jitter_s + 1e-6
    assert chooser.counters["lost frames"] == 0


def test_lost_frames_are_counted_and_the_next_is_taken() -> None:
    chooser = FrameChooser(PARAMS, HEIGHT, WIDTH)
    assert chooser.wants(100.0, 100.03)
    assert chooser.wants(100.0 + 7 * PERIOD_S, 100.3)
    assert chooser.counters["lost frames"] == 6
    chooser.begin_anew()
    assert chooser.wants(160.0, 160.0)
    assert chooser.counters["lost frames"] == 6


def test_frames_out_of_order_are_left_out() -> None:
    chooser = FrameChooser(PARAMS, HEIGHT, WIDTH)
    assert chooser.wants(100.0, 100.0)
    assert not chooser.wants(100.0, 100.01)
    assert not chooser.wants(99.9, 100.01)
    assert chooser.counters["frames out of order"] == 2


@pytest.mark.parametrize("stamp_s", [1_790_000_000.0, 0.0, float("nan"), float("inf")])
def test_a_camera_on_another_clock_is_refused_by_name(stamp_s: float) -> None:
    chooser = FrameChooser(PARAMS, HEIGHT, WIDTH)
    assert not chooser.wants(stamp_s, 5000.0)
    assert "off the monotonic clock" in chooser.problem
    assert chooser.counters["refused timestamps"] == 1
    assert chooser.wants(5000.1, 5000.1)


def test_the_stamp_is_the_middle_of_the_middle_rows_exposure() -> None:
    # rows start one after the other within 16 ms, each exposed for 4 ms
    first = FrameChooser(changed(stamp_at="start_of_exposure", pixel_format="GREY"), HEIGHT, WIDTH)
    last = FrameChooser(changed(stamp_at="end_of_frame", pixel_format="GREY"), HEIGHT, WIDTH)
    for chooser, time_s in ((first, 100.010), (last, 99.990)):
        picture = chooser.picture(ramp(), 100.0)
        assert picture is not None
        assert picture.time_s == pytest.approx(time_s)


def test_a_corrupt_frame_is_counted_and_the_next_ends_the_problem() -> None:
    chooser = FrameChooser(PARAMS, HEIGHT, WIDTH)
    assert chooser.picture(jpeg()[:200], 100.0) is None
    assert chooser.problem == "a frame is cut off"
    assert chooser.counters["corrupt frames"] == 1
    assert chooser.picture(jpeg(), 100.1) is not None
    assert chooser.problem == ""


def test_reopening_ends_the_problem_of_the_last_frame() -> None:
    chooser = FrameChooser(PARAMS, HEIGHT, WIDTH)
    assert chooser.picture(jpeg()[:200], 100.0) is None
    chooser.begin_anew()
    assert chooser.problem == ""


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"frame_rate_hz": 25.0}, "no whole multiple of 10"),
        ({"exposure_s": 0.02, "frame_rate_hz": 60.0}, "longer than a frame"),
        ({"devices": {"front": "", "rear": ""}}, "names no camera"),
        ({"devices": {"front": "/dev/video0", "rear": "/dev/video0"}}, "are the same"),
        ({"pixel_format": "RGB3"}, "pixel_format"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(changes: dict[str, object], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        changed(**changes)
