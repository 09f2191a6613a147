"""Sides of square markers, fitted as straight lines to sub-pixel edge positions.

Lens distortion bends straight lines, so a side is a line only in undistorted, normalised coordinates (x/z, y/z). Points
along the presumed side are projected into the image; there the step from black to white is found along the image's own
normal; its position is converted back to normalised coordinates, where a robust line is fitted. Neighbouring lines
intersect in the corners, and the whole is repeated from there.

The position of a step within a window is taken from its area: with plateaus D (black) and B (white) at the two ends,
sum((I - D) / (B - D)) is the length of the white part. Bilinear samples spaced 1 / n pixel make this sum exact for any
position of an edge along the pixel grid, so that frontal markers show no pixel-phase bias.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from robot_stack.core.compiled import compiled

Array = NDArray[np.float64]

# Columns of the result of fit_sides, one row per side: the line n_x x + n_y y = c (unit normal, pointing out of the
# marker), the samples' scatter about it (normalised units), their effective number (0: no usable edge).
NX, NY, C, SCATTER, COUNT = range(5)

_STEP_PX = 0.5
_CELLS = 6.0  # 4 x 4 bits and the black border on both sides
_MAX_SAMPLES = 64
_COARSE_SAMPLES = 24
_MAX_WINDOW = 64
_TUKEY = 4.685  # 95 % efficiency on normal errors
_MAD_TO_SIGMA = 1.4826


def camera_vector(intrinsics: Intrinsics) -> Array:
    """(9,) fx, fy, cx, cy, k1, k2, p1, p2, k3: input of the compiled functions."""
    return np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy, *intrinsics.distortion])


@compiled
def _distort(camera: Array, x: float, y: float) -> tuple[float, float]:
    """Normalised coordinates to pixels (Brown-Conrady)."""
    r2 = x * x + y * y
    radial = 1.0 + r2 * (camera[4] + r2 * (camera[5] + r2 * camera[8]))
    xd = x * radial + 2.0 * camera[6] * x * y + camera[7] * (r2 + 2.0 * x * x)
    yd = y * radial + camera[6] * (r2 + 2.0 * y * y) + 2.0 * camera[7] * x * y
    return camera[0] * xd + camera[2], camera[1] * yd + camera[3]


@compiled
def _undistort(camera: Array, u: float, v: float) -> tuple[float, float]:
    """Pixels to normalised coordinates by fixed-point iteration, to 1e-12 where the lens is ordinary."""
    xd, yd = (u - camera[2]) / camera[0], (v - camera[3]) / camera[1]
    x, y = xd, yd
    for _ in range(20):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (camera[4] + r2 * (camera[5] + r2 * camera[8]))
        dx = 2.0 * camera[6] * x * y + camera[7] * (r2 + 2.0 * x * x)
        dy = camera[6] * (r2 + 2.0 * y * y) + 2.0 * camera[7] * x * y
        x_new, y_new = (xd - dx) / radial, (yd - dy) / radial
        done = abs(x_new - x) + abs(y_new - y) < 1e-12
        x, y = x_new, y_new
        if done:
            break
    return x, y


@compiled
def undistort_points(camera: Array, points: Array) -> Array:
    """(n, 2) pixels to (n, 2) normalised coordinates."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = _undistort(camera, points[i, 0], points[i, 1])
    return out


@compiled
def distort_points(camera: Array, points: Array) -> Array:
    """(n, 2) normalised coordinates to (n, 2) pixels."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = _distort(camera, points[i, 0], points[i, 1])
    return out


@compiled
def _profile(image: Any, u: float, v: float, gu: float, gv: float, half: int, out: Array) -> bool:
    """Bilinear samples at (u, v) + t (gu, gv), t = -half..half steps. False if one would lie outside the image."""
    height, width = image.shape
    for k in range(2 * half + 1):
        t = (k - half) * _STEP_PX
        x, y = u + t * gu, v + t * gv
        if not (0.0 <= x < width - 1.0 and 0.0 <= y < height - 1.0):  # NaN is outside too
            return False
        x0, y0 = int(x), int(y)
        fx, fy = x - x0, y - y0
        upper = (1.0 - fx) * image[y0, x0] + fx * image[y0, x0 + 1]
        lower = (1.0 - fx) * image[y0 + 1, x0] + fx * image[y0 + 1, x0 + 1]
        out[k] = (1.0 - fy) * upper + fy * lower
    return True


@compiled
def _step_position(profile: Array, half: int) -> tuple[float, float]:
    """(offset of the step from the window's middle in px, positive outwards; contrast white - black)."""
    plateau = 3 if half >= 6 else 2
    n = 2 * half + 1
    dark = bright = total = 0.0
    for k in range(plateau):
        dark += float(profile[k])
        bright += float(profile[n - 1 - k])
    dark, bright = dark / plateau, bright / plateau
    contrast = bright - dark
    if not contrast > 0.0:
        return 0.0, 0.0
    for k in range(n):
        total += float(profile[k]) - dark
    return (half + 0.5) * _STEP_PX - total / contrast * _STEP_PX, contrast


@compiled
def _robust_line(u: Array, v: Array, n: int, floor: float) -> tuple[float, float, float, float]:
    """v = a + b u by a median start and Tukey's weights: (a, b, scatter, effective number of samples)."""
    # Slopes of pairs half the length apart: their median bears a quarter of bad samples.
    m = n // 2
    slopes = np.empty(n - m)
    for i in range(n - m):
        slopes[i] = (v[i + m] - v[i]) / (u[i + m] - u[i])
    b = float(np.median(slopes))
    a = float(np.median(v[:n] - b * u[:n]))
    sigma, weight_sum = floor, 0.0
    for _ in range(5):
        sigma = max(_MAD_TO_SIGMA * np.median(np.abs(v[:n] - a - b * u[:n])), floor)
        sw = su = sv = suu = suv = 0.0
        for i in range(n):
            z = (v[i] - a - b * u[i]) / (_TUKEY * sigma)
            if abs(z) < 1.0:
                w = (1.0 - z * z) ** 2
                sw += w
                su += w * u[i]
                sv += w * v[i]
                suu += w * u[i] * u[i]
                suv += w * u[i] * v[i]
        determinant = sw * suu - su * su
        if not determinant > 1e-12 * sw * suu:
            return a, b, sigma, 0.0
        b = (sw * suv - su * sv) / determinant
        a = (sv - b * su) / sw
        weight_sum = sw
    return a, b, sigma, weight_sum


@compiled
def _fit_side(
    image: Any, camera: Array, a: Array, b: Array, half: int, samples: int, limits: Array, out: Array
) -> None:
    """One side from corner a to corner b (normalised, clockwise in the image). Leaves ``out`` alone without an edge.

    limits: least contrast (grey levels), least share of the side's median contrast, least share of samples, share of
    the side left out at each end, floor of the scatter in px.
    """
    out[COUNT] = 0.0
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    if not length > 0.0:
        return
    dx, dy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    nx, ny = dy, -dx
    pixels = length * camera[0]
    wanted = int(min(float(samples), max(12.0, pixels)))
    along, across, contrasts = np.empty(wanted), np.empty(wanted), np.empty(wanted)
    profile = np.empty(_MAX_WINDOW + 1)
    found = 0
    small = 1.0 / camera[0]
    for i in range(wanted):
        share = limits[3] + (1.0 - 2.0 * limits[3]) * (i + 0.5) / wanted
        x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
        u, v = _distort(camera, x, y)
        u1, v1 = _distort(camera, x + small * nx, y + small * ny)
        norm = math.hypot(u1 - u, v1 - v)
        if not norm > 0.0:
            continue
        gu, gv = (u1 - u) / norm, (v1 - v) / norm
        if not _profile(image, u, v, gu, gv, half, profile):
            continue
        offset, contrast = _step_position(profile, half)
        if contrast < limits[0] or abs(offset) > half * _STEP_PX - 1.0:
            continue
        ex, ey = _undistort(camera, u + offset * gu, v + offset * gv)
        along[found] = (ex - a[0]) * dx + (ey - a[1]) * dy - 0.5 * length
        across[found] = (ex - a[0]) * nx + (ey - a[1]) * ny
        contrasts[found] = contrast
        found += 1
    least = limits[2] * wanted
    if found < max(least, 6.0):
        return
    least_contrast = limits[1] * np.median(contrasts[:found])
    kept = 0
    for i in range(found):
        if contrasts[i] >= least_contrast:
            along[kept], across[kept] = along[i], across[i]
            kept += 1
    if kept < max(least, 6.0):
        return
    offset, slope, scatter, count = _robust_line(along, across, kept, limits[4] / camera[0])
    if not (count >= least and abs(slope) < 0.3):
        return
    # The line through mid + offset n with direction d + slope n.
    scale = 1.0 / math.sqrt(1.0 + slope * slope)
    lx, ly = (nx - slope * dx) * scale, (ny - slope * dy) * scale
    px = a[0] + 0.5 * length * dx + offset * nx
    py = a[1] + 0.5 * length * dy + offset * ny
    out[NX], out[NY], out[C], out[SCATTER], out[COUNT] = lx, ly, lx * px + ly * py, scatter, count


@compiled
def _intersect(sides: Array, corners: Array) -> None:
    """Moves each corner to where its two sides meet, if both are known."""
    for k in range(4):
        p, q = sides[(k + 3) % 4], sides[k]
        if p[COUNT] == 0.0 or q[COUNT] == 0.0:
            continue
        determinant = p[NX] * q[NY] - p[NY] * q[NX]
        if abs(determinant) > 0.1:
            corners[k, 0] = (p[C] * q[NY] - q[C] * p[NY]) / determinant
            corners[k, 1] = (p[NX] * q[C] - q[NX] * p[C]) / determinant


@compiled
def _half_window(camera: Array, corners: Array, side: int, widest_px: float) -> int:
    """Steps to each side of an edge: within the black border's width, seen across this side."""
    k = (side + 1) % 4
    m = (side + 3) % 4
    n = (side + 2) % 4
    first = math.hypot(corners[k, 0] - corners[n, 0], corners[k, 1] - corners[n, 1])
    second = math.hypot(corners[side, 0] - corners[m, 0], corners[side, 1] - corners[m, 1])
    cell_px = min(first, second) * camera[0] / _CELLS
    return int(min(max(0.45 * cell_px, 1.5), widest_px) / _STEP_PX)


@compiled
def fit_sides(image: Any, camera: Array, corners: Array, widths_px: Array, limits: Array) -> Array:
    """Fits the four sides of each marker.

    image: (h, w) uint8. camera: see camera_vector. corners: (n, 4, 2) normalised, clockwise in the image; replaced by
    the refined ones. widths_px: half width of the window at most, one pass for each, at most 16. limits: see _fit_side.
    Returns (n, 4, 5): columns NX .. COUNT; side k runs from corner k to corner k + 1.
    """
    sides = np.zeros((corners.shape[0], 4, 5))
    for marker in range(corners.shape[0]):
        for turn, width_px in enumerate(widths_px):
            samples = _COARSE_SAMPLES if turn == 0 else _MAX_SAMPLES
            for k in range(4):
                following = (k + 1) % 4
                half = _half_window(camera, corners[marker], k, width_px)
                a, b = corners[marker, k], corners[marker, following]
                _fit_side(image, camera, a, b, half, samples, limits, sides[marker, k])
            _intersect(sides[marker], corners[marker])
    return sides
