"""Camera images as JPEG, for pages and remote viewers."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def grey_jpeg(grey: NDArray[np.uint8], width_px: int, quality: int) -> bytes:
    """A JPEG of the (height, width) image, shrunk to ``width_px`` if it is wider; the aspect ratio is kept.

    quality: of OpenCV, [0, 100]. Raises ValueError if the encoder fails.
    """
    height, width = grey.shape
    if width > width_px:
        size = (width_px, max(1, round(width_px * height / width)))
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
    done, data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"image: {width} x {height} pixels could not be encoded")
    return data.tobytes()
