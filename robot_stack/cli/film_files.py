"""Films as files: GIF by Pillow, MP4 by OpenCV, with a line of text below the pictures."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from matplotlib import get_data_path
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from robot_stack.cli.errors import CommandError

Picture = NDArray[np.uint8]
_BAR_PX, _TEXT_PX, _MARGIN_PX = 26, 14, 10
_BAR_RGB, _TEXT_RGB, _FAINT_RGB = (38, 44, 54), (240, 242, 245), (160, 168, 178)
_PALETTE_FRAMES = 6  # the colours are chosen from these frames
_COARSE = 4  # nearer colours count as equal
_LEAST_PIXELS = 20  # of a colour; fewer belong to edges between two colours


class Lettering:
    """Writes below a picture with matplotlib's font."""

    def __init__(self) -> None:
        self._font = ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), _TEXT_PX)

    def write(self, picture: Picture, left: str, right: str) -> Picture:
        """The picture with a bar below it."""
        height, width = picture.shape[:2]
        whole = Image.new("RGB", (width, height + _BAR_PX), _BAR_RGB)
        whole.paste(Image.fromarray(picture))
        draw = ImageDraw.Draw(whole)
        line = height + _BAR_PX // 2
        draw.text((_MARGIN_PX, line), left, _TEXT_RGB, self._font, anchor="lm")
        draw.text((width - _MARGIN_PX, line), right, _FAINT_RGB, self._font, anchor="rm")
        return np.asarray(whole)


def save_gif(path: Path, pictures: list[Picture], frame_hz: float, colours: int) -> None:
    """One palette for all pictures, without dithering, so that static parts are identical in all frames."""
    palette = _palette(pictures, colours)
    frames = [Image.fromarray(item).quantize(palette=palette, dither=Image.Dither.NONE) for item in pictures]
    hundredths = max(2, round(100.0 / frame_hz))  # GIF frame time, 1/100 s
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=10 * hundredths, loop=0, optimize=False)


def _palette(pictures: list[Picture], colours: int) -> Image.Image:
    """Weights each colour by the root of its area, so that a small red object stays red."""
    chosen = [pictures[index] for index in np.linspace(0, len(pictures) - 1, _PALETTE_FRAMES).astype(int)]
    coarse = np.concatenate([item.reshape(-1, 3) for item in chosen]) // _COARSE * _COARSE + _COARSE // 2
    found, counts = np.unique(coarse, axis=0, return_counts=True)
    seen = counts >= _LEAST_PIXELS
    swatches = np.repeat(found[seen], np.ceil(np.sqrt(counts[seen])).astype(int), axis=0)
    return Image.fromarray(swatches[None]).quantize(colours, Image.Quantize.MEDIANCUT)


def save_mp4(path: Path, pictures: Iterable[Picture], frame_hz: float) -> None:
    """MPEG-4. Raises CommandError if OpenCV has no encoder for it."""
    writer: cv2.VideoWriter | None = None
    try:
        for picture in pictures:
            if writer is None:
                size = (picture.shape[1], picture.shape[0])
                writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), frame_hz, size)
                if not writer.isOpened():
                    raise CommandError(f"{path} cannot be written: this OpenCV encodes no MP4; GIF works everywhere")
            writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    finally:
        if writer is not None:
            writer.release()
