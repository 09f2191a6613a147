"""A site's map as ground and walls."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Grid, SiteMap, shaded
from robot_stack.film.faces import Face, prism

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]
Contour = NDArray[Any]
"""(n, 1, 2) whole pixels, as OpenCV finds them."""

_FREE_RGB, _UNKNOWN_RGB, _TILE_RGB = (230, 233, 236), (208, 212, 217), (220, 224, 228)
_WALL_RGB = np.array([0.66, 0.69, 0.74])
_TILE_M = 1.0
_SMOOTH_CELLS = 0.9  # smoothing of an outline, so that it does not follow every cell
_LEAST_CELLS = 4  # smaller regions are noise
_LEAST_M = 0.12
_PIECE_M = 0.8
_MAPPED_M = 0.3  # points within this distance of map cells belong to the map


class Site(NamedTuple):
    """ground: image of the floor; to_map: (3, 3) from its pixels x, y, 1 to map, m. faces: walls.

    roofs: outlines (n, 2) at a height, m.
    """

    ground: Image
    to_map: Floats
    faces: list[Face]
    roofs: list[tuple[Floats, float]]


def drawn_site(site: SiteMap, wall_height_m: float) -> Site:
    """Occupied cells as walls of the height seen there, at most ``wall_height_m``."""
    grid, faces, roofs = site.grid, [], []
    for outline in filter(_is_area, _outlines(grid.occupancy)):
        points = outline * grid.resolution_m + (grid.origin_x_m, grid.origin_y_m)
        height_m = _height_m(site, points, wall_height_m)
        faces += prism(points, height_m, _WALL_RGB, _PIECE_M)
        roofs.append((points, height_m))
    return Site(_ground(site), _to_map(site), faces, roofs)


def unmapped(points_m: Floats, grid: Grid) -> Floats:
    """Those of (n, 2) points, m, away from known map cells: people and objects that arrived later."""
    reach = round(_MAPPED_M / grid.resolution_m)
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    known = cv2.dilate((grid.occupancy != FREE).astype(np.uint8), kernel)
    cells = np.floor((points_m - (grid.origin_x_m, grid.origin_y_m)) / grid.resolution_m).astype(int)
    inside = np.all((cells >= 0) & (cells < grid.occupancy.shape[::-1]), axis=1)
    new = np.ones(len(points_m), bool)
    new[inside] = known[cells[inside, 1], cells[inside, 0]] == 0
    return points_m[new]


def empty_site(around_m: Floats, margin_m: float) -> Site:
    """A floor under (n, 2) points, where there is no map."""
    low, high = around_m.min(axis=0) - margin_m, around_m.max(axis=0) + margin_m
    size = np.ceil(10.0 * (high - low)).astype(int)
    ground = np.full((size[1], size[0], 3), _FREE_RGB, np.uint8)
    return Site(ground, np.array([[0.1, 0.0, low[0]], [0.0, 0.1, low[1]], [0.0, 0.0, 1.0]]), [], [])


def _outlines(occupancy: NDArray[np.int8]) -> list[Floats]:
    """Counter-clockwise outlines of occupied regions, with the space they enclose, (n, 2) in cells."""
    occupied = (occupancy == OCCUPIED).astype(np.uint8)
    outlines = []
    for contour in _contours(occupied):
        if _encloses_site(contour, occupied.shape):
            outlines += _ribbons(occupied, contour)
        else:
            outlines.append(_outline(contour))
    return outlines


def _contours(occupied: Image) -> list[Contour]:
    """Contours of occupied regions, without noise; in half cells, with a margin of one cell."""
    # Contours run through the centres of cells: at twice the size they lie at the cells' edges.
    grown = np.pad(occupied, 1).repeat(2, axis=0).repeat(2, axis=1)
    found, _ = cv2.findContours(grown, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return [contour for contour in found if cv2.contourArea(contour) >= 4.0 * _LEAST_CELLS]


def _outline(contour: Contour) -> Floats:
    smooth = cv2.approxPolyDP(contour, 2.0 * _SMOOTH_CELLS, closed=True)[:, 0].astype(np.float64)
    points = 0.5 * (smooth + 0.5) - 1.0
    area = np.sum(points[:, 0] * np.roll(points[:, 1], -1) - points[:, 1] * np.roll(points[:, 0], -1))
    return points if area > 0.0 else points[::-1]


def _is_area(outline: Floats) -> bool:
    """False for thin outlines that smoothing reduced to nothing."""
    return len(outline) > 2 and float(np.ptp(outline, axis=0).min()) > 0.0


def _encloses_site(contour: Contour, shape: tuple[int, ...]) -> bool:
    """True for a wall around the whole site, which is not drawn as one block."""
    return bool(cv2.contourArea(contour) > 0.3 * 4.0 * shape[0] * shape[1])


def _ribbons(occupied: Image, contour: Contour) -> list[Floats]:
    """The cells of an enclosing wall as separate blocks of some metres."""
    inside = np.zeros((2 * occupied.shape[0] + 4, 2 * occupied.shape[1] + 4), np.uint8)
    cv2.drawContours(inside, [contour], -1, 1, cv2.FILLED)
    mine = occupied & inside[2:-2:2, 2:-2:2]
    blocks: list[Floats] = []
    side = 20  # cells
    for row in range(0, mine.shape[0], side):
        for column in range(0, mine.shape[1], side):
            tile = np.zeros_like(mine)
            tile[row : row + side, column : column + side] = mine[row : row + side, column : column + side]
            blocks += map(_outline, _contours(tile))
    return blocks


def _height_m(site: SiteMap, outline: Floats, most_m: float) -> float:
    """Height of the surfaces seen within an outline, m."""
    cells = site.cells
    low, high = outline.min(axis=0) - 0.2, outline.max(axis=0) + 0.2
    near = np.all((cells.mean[:, :2] >= low) & (cells.mean[:, :2] <= high), axis=1)
    tops = cells.mean[near, 2] + 2.0 * np.sqrt(np.maximum(cells.covariance[near, 2, 2], 0.0))
    return float(np.clip(tops.max(initial=0.0), _LEAST_M, most_m))


def _ground(site: SiteMap) -> Image:
    """The floor: row 0 at the lowest y."""
    grid = site.grid
    shades = {FREE: _FREE_RGB, OCCUPIED: _FREE_RGB, UNKNOWN: _UNKNOWN_RGB}
    image = np.asarray(cv2.medianBlur(shaded(grid.occupancy, shades), 5), np.uint8)
    rows, columns = np.indices(grid.occupancy.shape)
    cells = round(_TILE_M / grid.resolution_m)
    image[((rows // cells + columns // cells) % 2 == 0) & (image[:, :, 0] == _FREE_RGB[0])] = _TILE_RGB
    return image


def _to_map(site: SiteMap) -> Floats:
    grid, half = site.grid, 0.5 * site.grid.resolution_m
    r = grid.resolution_m
    return np.array([[r, 0.0, grid.origin_x_m + half], [0.0, r, grid.origin_y_m + half], [0.0, 0.0, 1.0]])
