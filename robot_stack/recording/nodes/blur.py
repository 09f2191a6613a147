"""Blurs camera images in their bytes, so that a recording shows no face and no number plate."""

from __future__ import annotations

import cv2
import numpy as np

from robot_stack.middleware.wire import READERS, ImageView
from robot_stack.recording.images import IMAGE_TYPE


def blurred(data: bytes, block_px: int) -> bytes:
    """The same ``sensor_msgs/msg/Image``, each square of ``block_px`` pixels in its mean colour; 0 changes nothing.

    data: CDR, encodings with 8 bits per channel. An image of another encoding becomes black: it must not be kept clear.
    Raises UnknownEncoding.
    """
    if not block_px:
        return data
    image: ImageView = READERS[IMAGE_TYPE](data)
    pixels, begin = image.data, len(data) - image.data.nbytes
    return b"".join((data[:begin], _mosaic(pixels, image, block_px).tobytes()))


def _mosaic(pixels: np.ndarray, image: ImageView, block_px: int) -> np.ndarray:
    channels = {"mono8": 1, "bgr8": 3, "rgb8": 3}.get(image.encoding, 0)
    if not channels or pixels.size != image.height * image.step or image.step != image.width * channels:
        return np.zeros_like(pixels)
    grid = pixels.reshape(image.height, image.width, channels)
    blocks = (max(image.width // block_px, 1), max(image.height // block_px, 1))
    small = cv2.resize(grid, blocks, interpolation=cv2.INTER_AREA)
    return cv2.resize(small, (image.width, image.height), interpolation=cv2.INTER_NEAREST)
