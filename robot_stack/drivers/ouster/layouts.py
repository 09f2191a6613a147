"""The layouts of lidar data packets: Ouster Firmware User Manual, "Lidar Data". Little endian throughout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from robot_stack.core.config import ConfigError
from robot_stack.drivers.ouster.metadata import Metadata

LEGACY: Final = "LEGACY"
ENCODER_TICKS: Final = 90112
_HEADER_BYTES, _FOOTER_BYTES, _COLUMN_HEADER_BYTES = 32, 32, 12
_LEGACY_COLUMN_HEADER_BYTES, _LEGACY_STATUS_BYTES = 16, 4
_SIZES: Final = (32, 64, 128, 256)  # beams of the sensors that there are


class Pixel(NamedTuple):
    """Bytes of a pixel; its range: type, mask, mm of a step; its reflectivity: type and place."""

    size: int
    range_type: str
    range_mask: int
    step_mm: int
    reflectivity_type: str
    reflectivity_at: int

    def dtype(self) -> np.dtype[np.void]:
        return np.dtype(
            {
                "names": ["range", "reflectivity"],
                "formats": [self.range_type, self.reflectivity_type],
                "offsets": [0, self.reflectivity_at],
                "itemsize": self.size,
            }
        )


# Of two returns the first is used, which is the stronger one by the sensor's default.
PIXELS: Final = {
    LEGACY: Pixel(12, "<u4", 0xFFFFF, 1, "<u2", 4),
    "RNG19_RFL8_SIG16_NIR16": Pixel(12, "<u4", 0x7FFFF, 1, "<u1", 4),
    "RNG19_RFL8_SIG16_NIR16_DUAL": Pixel(16, "<u4", 0x7FFFF, 1, "<u1", 3),
    "RNG15_RFL8_NIR8": Pixel(4, "<u2", 0x7FFF, 8, "<u1", 2),
}


@dataclass(frozen=True, slots=True)
class Layout:
    """size: bytes of a packet. column: of structured columns, the first at byte ``header``."""

    profile: str
    pixel: Pixel
    column: np.dtype[np.void]
    header: int
    size: int

    @property
    def legacy(self) -> bool:
        return self.profile == LEGACY


def layout_of(metadata: Metadata, source: str) -> Layout:
    """Raises ConfigError, which names ``source``, for an unsupported profile."""
    profile = metadata.udp_profile_lidar
    if profile not in PIXELS:
        raise ConfigError(f"{source}: udp_profile_lidar is {profile}, expected one of {', '.join(PIXELS)}")
    return _layout(profile, metadata.pixels_per_column, metadata.columns_per_packet)


def resembles(size: int, columns_per_packet: int) -> str:
    """The sensors whose packets have ``size`` bytes, for people; empty without any."""
    found = (
        f"{profile} of {beams} beams"
        for profile in PIXELS
        for beams in _SIZES
        if _layout(profile, beams, columns_per_packet).size == size
    )
    return " or ".join(found)


def _layout(profile: str, beams: int, columns: int) -> Layout:
    pixel, legacy = PIXELS[profile], profile == LEGACY
    pixels: Any = (pixel.dtype(), (beams,))
    begin = _LEGACY_COLUMN_HEADER_BYTES if legacy else _COLUMN_HEADER_BYTES
    end = begin + beams * pixel.size
    width = end + (_LEGACY_STATUS_BYTES if legacy else 0)
    fields: dict[str, tuple[Any, int]] = {"timestamp": ("<u8", 0), "measurement": ("<u2", 8), "pixels": (pixels, begin)}
    if legacy:
        fields |= {"frame": ("<u2", 10), "encoder": ("<u4", 12), "status": ("<u4", end)}
    else:
        fields |= {"status": ("<u2", 10)}
    formats, offsets = [kind for kind, _ in fields.values()], [at for _, at in fields.values()]
    column = np.dtype({"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": width})
    around = 0 if legacy else _HEADER_BYTES + _FOOTER_BYTES
    return Layout(profile, pixel, column, 0 if legacy else _HEADER_BYTES, around + columns * width)
