"""Image messages read without copying the pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image

from robot_stack.middleware.wire import ImageView


def grey_image(message: Image | ImageView) -> NDArray[np.uint8]:
    """(height, width) view of a mono8 message's bytes, nothing copied. Raises ValueError naming the field."""
    if message.encoding != "mono8":
        raise ValueError(f"image: encoding is {message.encoding!r}, must be 'mono8'")
    if message.step < message.width or message.width == 0 or message.height == 0:
        raise ValueError(f"image: step is {message.step}, size {message.width} x {message.height}")
    needed = message.step * message.height
    if len(message.data) < needed:
        raise ValueError(f"image: data has {len(message.data)} bytes, step x height is {needed}")
    rows = np.frombuffer(message.data, np.uint8, count=needed).reshape(message.height, message.step)
    return rows[:, : message.width]
