"""Site data for pages: its map, its cameras, its recordings."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import cv2

from robot_stack.contract.frames import FRONT_CAMERA, REAR_CAMERA
from robot_stack.core.camera import camera_file, load_intrinsics
from robot_stack.core.display_patterns import load_patterns
from robot_stack.core.display_picture import svg
from robot_stack.core.kept_events import event_bytes, events_dir, read_events
from robot_stack.core.robot import Footprint
from robot_stack.core.runtime import recordings_dir
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, load_map, shaded
from robot_stack.ui.params import TouchUiParams

_RECORDINGS_MAX = 50
_EVENTS_MAX = 50
# Free ground is nearly white, walls are dark; unknown is between, and bluish as water on a map.
_SHADES_BGR = {FREE: (250, 249, 247), OCCUPIED: (74, 58, 44), UNKNOWN: (226, 218, 209)}


class Site:
    """Data that is constant while the node runs, except the recordings and the events. Raises ConfigError.

    pictures: see ``pictures``.
    """

    def __init__(self, params: TouchUiParams, footprint: Footprint) -> None:
        pages, pad = params.pages, params.pad
        about, map_png = background(pages.map)
        self.pictures = pictures(map_png)
        self._recordings = recordings_dir(pages.recordings_folder)
        self._section = {
            "map": about,
            "language": pages.language,
            "staff_contact": pages.staff_contact,
            "footprint": {"front": footprint.front_m, "rear": footprint.rear_m, "width": footprint.width_m},
            "cameras": cameras(),
            "pad": {"linear_mps": pad.linear_mps, "lateral_mps": pad.lateral_mps, "angular_radps": pad.angular_radps},
        }

    def section(self) -> dict[str, Any]:
        return self._section

    def recordings(self) -> dict[str, Any]:
        return recordings(self._recordings)

    def events(self) -> dict[str, Any]:
        return kept_events(events_dir())


def background(name: str) -> tuple[dict[str, Any] | None, bytes]:
    """(where the picture lies in map, the picture as PNG), or (None, nothing) without a map. Raises ConfigError."""
    if not name:
        return None, b""
    grid = load_map(name).grid
    _, png = cv2.imencode(".png", shaded(grid.occupancy, _SHADES_BGR)[::-1])
    rows, columns = grid.occupancy.shape
    about = {
        "x": grid.origin_x_m,
        "y": grid.origin_y_m,
        "width": columns * grid.resolution_m,
        "height": rows * grid.resolution_m,
    }
    return about, png.tobytes()


def pictures(map_png: bytes) -> dict[str, tuple[str, bytes]]:
    """Pictures served beside the page's own files, path -> (type, bytes): the map, and the external display
    in each state and language. Raises ConfigError.
    """
    patterns = load_patterns()
    found = {
        f"/display/{state}-{language}.svg": ("image/svg+xml", svg(patterns, state, language).encode())
        for state in patterns.states
        for language in ("en", "ja", "zh")
    }
    return found | ({"/map.png": ("image/png", map_png)} if map_png else {})


def cameras() -> dict[str, dict[str, float]]:
    """For each camera the parameters that project a marker into its image. Raises ConfigError."""
    found = {}
    for frame in (FRONT_CAMERA, REAR_CAMERA):
        k = load_intrinsics(camera_file(frame))
        found[frame] = {"fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "width": float(k.width)}
    return found


def recordings(folder: Path) -> dict[str, Any]:
    """The newest recordings: name and size."""
    try:
        names = sorted((item for item in folder.iterdir() if item.is_dir()), reverse=True)[:_RECORDINGS_MAX]
        found = [{"name": item.name, "megabytes": _megabytes(item)} for item in names]
    except OSError:
        found = []
    return {"list": found, "folder": str(folder)}


def kept_events(folder: Path) -> dict[str, Any]:
    """The newest events of the black box. at: ms since the epoch, of the first trigger."""
    found = []
    for event in read_events(folder)[:_EVENTS_MAX]:
        with contextlib.suppress(OSError):  # deleted meanwhile
            size = round(event_bytes(folder / event.id) / 1e6, 1)
            found.append(
                {
                    "id": event.id,
                    "at": round(1e3 * event.at_s),
                    "state": event.state.value,
                    "reasons": list(event.reasons),
                    "megabytes": size,
                }
            )
    return {"list": found, "folder": str(folder)}


def _megabytes(folder: Path) -> float:
    return round(sum(item.stat().st_size for item in folder.iterdir() if item.is_file()) / 1e6, 1)
