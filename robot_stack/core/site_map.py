"""A site's map, used by localization for matching and by navigation for planning. One folder with a checksum.

Folder ``config/maps/<name>/`` (or any path):
     map.yaml     name, frame, sizes, origin of the data, drift, SHA-256 of the other files
    cells.npz    key (n, 3) int32, mean (n, 3) m, covariance (n, 6) m2 [xx, xy, xz, yy, yz, zz], count (n,)
    grid.pgm, grid.yaml    the 2-D grid as Nav2's map_server reads it
    map.png      a picture for people
Frame: map, z up, z = 0 at the start of the mapping ride.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from robot_stack.core.config import ConfigError, chosen_site, config_dir, read_yaml

Floats = npt.NDArray[np.float64]
FREE, UNKNOWN, OCCUPIED = 0, -1, 100
_CELLS, _GRID, _GRID_YAML, _ABOUT = "cells.npz", "grid.pgm", "grid.yaml", "map.yaml"


@dataclass(frozen=True, slots=True)
class Cells:
    """Voxels with a minimum number of points: normal distributions of surface points.

    size_m: edge of a voxel. key: (n, 3) int32, floor(mean / size_m). mean: (n, 3) m, map.
    covariance: (n, 3, 3) m2, as measured (not regularised). count: (n,) points that made it.
    """

    size_m: float
    key: npt.NDArray[np.int32]
    mean: Floats
    covariance: Floats
    count: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Grid:
    """Occupancy of the ground. occupancy: (rows, columns) int8, FREE, UNKNOWN or OCCUPIED, row 0 at the lowest y.

    origin_x_m, origin_y_m: the lower left corner of cell (0, 0) in map. The grid is not turned.
    """

    resolution_m: float
    origin_x_m: float
    origin_y_m: float
    occupancy: npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class SiteMap:
    """cells for localization, grid for planning, about: the content of map.yaml without the checksums."""

    name: str
    cells: Cells
    grid: Grid
    about: dict[str, Any] = field(default_factory=dict)


def shaded(occupancy: npt.NDArray[np.int8], shades: Mapping[int, int | tuple[int, int, int]]) -> npt.NDArray[np.uint8]:
    """(rows, columns) grey or (rows, columns, 3): each cell in the shade of its value, FREE, UNKNOWN or OCCUPIED."""
    table = np.empty((256, *np.shape(shades[UNKNOWN])), np.uint8)
    table[:] = shades[UNKNOWN]
    for value, shade in shades.items():
        table[value] = shade
    return table[occupancy]


def chosen_map(name: str | None) -> str:
    """``name``, or for None that of the site or of localization; empty = no map. Raises ConfigError."""
    if name is not None:
        return name
    return chosen_site() or str(read_yaml(config_dir() / "ndt_localization.yaml").get("map", ""))


def map_folder(name: str) -> Path:
    """``config/maps/<name>``, or the folder itself if ``name`` is a path. Raises ConfigError if there is none."""
    folder = Path(name) if "/" in name else config_dir() / "maps" / name
    if not (folder / _ABOUT).is_file():
        known = sorted(path.parent.name for path in (config_dir() / "maps").glob(f"*/{_ABOUT}"))
        raise ConfigError(f"no map {name!r} in {folder}; there are {', '.join(known) or 'none'}")
    return folder


def map_checksum(name: str) -> str:
    """SHA-256 of map.yaml, which contains those of the other files. Raises ConfigError."""
    path = map_folder(name) / _ABOUT
    try:
        return _digest(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error


def load_map(name: str) -> SiteMap:
    """Reads and verifies a map. Raises ConfigError naming the file that is missing, damaged or changed."""
    folder = map_folder(name)
    about = read_yaml(folder / _ABOUT)
    for file, expected in about.get("sha256", {}).items():
        path = folder / file
        if not path.is_file() or _digest(path) != expected:
            raise ConfigError(f"map {folder}: {file} is missing or differs from the file that was saved with the map")
    if set(about.get("sha256", {})) != {_CELLS, _GRID, _GRID_YAML}:
        raise ConfigError(f"map {folder}: {_ABOUT} lists no checksums of {_CELLS}, {_GRID} and {_GRID_YAML}")
    return SiteMap(folder.name, _read_cells(folder / _CELLS), _read_grid(folder), about)


def save_map(site: SiteMap, folder: Path) -> None:
    """Writes everything but the picture; map.yaml last, so that an interrupted save leaves no valid map."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _ABOUT).unlink(missing_ok=True)
    c = site.cells
    flat = c.covariance[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    np.savez_compressed(
        folder / _CELLS,
        size_m=c.size_m,
        key=c.key.astype(np.int32),
        mean=c.mean.astype(np.float32),
        covariance=flat.astype(np.float32),
        count=c.count.astype(np.int32),
    )
    _write_grid(site.grid, folder)
    sums = {file: _digest(folder / file) for file in (_CELLS, _GRID, _GRID_YAML)}
    about = {key: value for key, value in site.about.items() if key != "sha256"}
    text = yaml.safe_dump({"name": site.name, **about, "sha256": sums}, sort_keys=False)
    (folder / _ABOUT).write_text(text, encoding="utf-8")


def _read_cells(path: Path) -> Cells:
    try:
        with np.load(path) as data:
            flat = data["covariance"].astype(np.float64)
            covariance = flat[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
            cells = Cells(
                float(data["size_m"]),
                data["key"],
                data["mean"].astype(np.float64),
                covariance,
                data["count"].astype(np.int64),
            )
    except (OSError, KeyError, ValueError) as error:
        raise ConfigError(f"map {path}: {error}") from error
    if not (np.isfinite(cells.mean).all() and np.isfinite(covariance).all() and cells.size_m > 0.0):
        raise ConfigError(f"map {path}: holds values that are not finite")
    return cells


# Nav2's map_server, mode trinary: white free, black occupied, between unknown; the picture's first row is the top.
_SHADES = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}


def _write_grid(grid: Grid, folder: Path) -> None:
    picture = shaded(grid.occupancy, _SHADES)
    rows, columns = len(picture), picture.size // len(picture)
    (folder / _GRID).write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + picture[::-1].tobytes())
    about = {
        "image": _GRID,
        "mode": "trinary",
        "resolution": grid.resolution_m,
        "origin": [grid.origin_x_m, grid.origin_y_m, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    (folder / _GRID_YAML).write_text(yaml.safe_dump(about, sort_keys=False), encoding="utf-8")


def _read_grid(folder: Path) -> Grid:
    about = read_yaml(folder / _GRID_YAML)
    data = (folder / _GRID).read_bytes()
    try:
        magic, size, depth, pixels = data.split(b"\n", 3)
        columns, rows = (int(part) for part in size.split())
        if magic != b"P5" or depth != b"255" or len(pixels) != rows * columns:
            raise ValueError("not an 8-bit binary PGM of its size")
        picture = np.frombuffer(pixels, np.uint8).reshape(rows, columns)[::-1]
        occupancy = np.full(picture.shape, UNKNOWN, np.int8)
        occupancy[picture == _SHADES[FREE]] = FREE
        occupancy[picture == _SHADES[OCCUPIED]] = OCCUPIED
        x, y, yaw = about["origin"]
        if yaw != 0.0:
            raise ValueError("a rotated origin is not supported")
        return Grid(float(about["resolution"]), float(x), float(y), occupancy)
    except (KeyError, ValueError, TypeError) as error:
        raise ConfigError(f"map {folder}: {_GRID}: {error}") from error


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
