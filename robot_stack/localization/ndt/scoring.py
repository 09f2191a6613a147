"""Compiled evaluation of poses: how well one explains a sweep, how well it is constrained, candidate places."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return"

from __future__ import annotations

import numpy as np

from robot_stack.core.compiled import compiled
from robot_stack.localization.ndt.kernels import DX, DY, DZ, add_turned, fill_symmetric


@compiled(nogil=True, inline="always")
def _squared(form, mean, x, y, z) -> float:
    """The offset of (x, y, z) from mean, squared in the symmetric form of xx, xy, xz, yy, yz, zz."""
    x, y, z = x - mean[0], y - mean[1], z - mean[2]
    return (
        form[0] * x * x + form[3] * y * y + form[5] * z * z
        + 2.0 * (form[1] * x * y + form[2] * x * z + form[4] * y * z)
    )  # fmt: skip


@compiled(nogil=True)
def judge(points, rotation, position, field, above_ground_m, explained2, information) -> tuple[int, int, int, float]:
    """How well the pose explains the points above the ground; adds up the information on the pose (6, 6).

    Returns (structure points, explained ones, known ones, residual). A point stands where it is above_ground_m over the
    lowest cell of its column, or over base_link where the column is empty. It is explained within a squared Mahalanobis
    distance of explained2 of a cell around it, and known where it is explained or its column is not empty. residual:
    mean squared distance of explained structure points along their cells' thin directions, in variances, NaN without
    one. information counts every explained point, ground included, along its cell's thin directions only.
    """
    structure, explained, known = 0, 0, 0
    off2, thin = 0.0, 0
    nx, ny, nz = field.rows.shape
    scale = 1.0 / field.size_m
    h = np.zeros((6, 6))
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        px = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
        py = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
        pz = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
        wx, wy, wz = px + position[0], py + position[1], pz + position[2]
        ix = int(np.floor(wx * scale)) - field.corner[0]
        iy = int(np.floor(wy * scale)) - field.corner[1]
        iz = int(np.floor(wz * scale)) - field.corner[2]
        ground = position[2]
        mapped = ix >= 0 and iy >= 0 and ix < nx and iy < ny and not np.isnan(field.ground[ix, iy])
        if mapped:
            ground = field.ground[ix, iy]
        best2, best = explained2, -1
        for k in range(7):
            jx, jy, jz = ix + DX[k], iy + DY[k], iz + DZ[k]
            if jx < 0 or jy < 0 or jz < 0 or jx >= nx or jy >= ny or jz >= nz:
                continue
            cell = field.rows[jx, jy, jz]
            if cell < 0:
                continue
            m2 = _squared(field.inverse[cell], field.mean[cell], wx, wy, wz)
            if m2 < best2:
                best2, best = m2, cell
        stands = wz > ground + above_ground_m
        if stands:
            structure += 1
            explained += best >= 0
            known += best >= 0 or mapped
        if best >= 0:
            n = field.normal[best]
            if stands and n[0] + n[3] + n[5] > 0.0:
                off2 += _squared(n, field.mean[best], wx, wy, wz)
                thin += 1
            add_turned(h, n[0], n[1], n[2], n[3], n[4], n[5], px, py, pz)
    fill_symmetric(h, information)
    return structure, explained, known, off2 / thin if thin > 0 else np.nan


@compiled(nogil=True)
def shares(points, rotations, positions, field, explained2, found) -> None:
    """Writes found (k,): the share of points (n, 3) in base_link that each pose explains, as in :func:`judge`.

    rotations: (k, 3, 3), positions: (k, 3) m, base_link in map.
    """
    nx, ny, nz = field.rows.shape
    scale = 1.0 / field.size_m
    for a in range(positions.shape[0]):
        r, explained = rotations[a], 0
        for i in range(points.shape[0]):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            wx = r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + positions[a, 0]
            wy = r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + positions[a, 1]
            wz = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + positions[a, 2]
            ix = int(np.floor(wx * scale)) - field.corner[0]
            iy = int(np.floor(wy * scale)) - field.corner[1]
            iz = int(np.floor(wz * scale)) - field.corner[2]
            for k in range(7):
                jx, jy, jz = ix + DX[k], iy + DY[k], iz + DZ[k]
                if jx < 0 or jy < 0 or jz < 0 or jx >= nx or jy >= ny or jz >= nz:
                    continue
                cell = field.rows[jx, jy, jz]
                if cell < 0:
                    continue
                m2 = _squared(field.inverse[cell], field.mean[cell], wx, wy, wz)
                if m2 < explained2:
                    explained += 1
                    break
        found[a] = explained / max(points.shape[0], 1)


@compiled(nogil=True)
def pierced(points, rotation, position, lidar, field, above_ground_m, margin_m, within2) -> float:
    """Share of the rays to points (n, 3) in base_link that pass through structure of the map.

    A ray passes through where, more than margin_m from both its ends, it comes within a squared Mahalanobis distance of
    within2 of the cell it is in: an obstacle next to the sensor may share its cell. lidar: (3,) sensor in base_link.
    Rays too short for that are left out; NaN without any.
    """
    nx, ny, nz = field.rows.shape
    scale, step = 1.0 / field.size_m, 0.25 * field.size_m
    o = rotation @ lidar + position
    rays, through = 0, 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        dx = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + position[0] - o[0]
        dy = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + position[1] - o[1]
        dz = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + position[2] - o[2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        first, last = int(np.ceil(margin_m / step)), int((length - margin_m) / step)
        if last < first:
            continue
        rays += 1
        for k in range(first, last + 1):
            share = k * step / length
            wx, wy, wz = o[0] + share * dx, o[1] + share * dy, o[2] + share * dz
            ix = int(np.floor(wx * scale)) - field.corner[0]
            iy = int(np.floor(wy * scale)) - field.corner[1]
            iz = int(np.floor(wz * scale)) - field.corner[2]
            if ix < 0 or iy < 0 or iz < 0 or ix >= nx or iy >= ny or iz >= nz:
                continue
            cell = field.rows[ix, iy, iz]
            if cell < 0 or field.mean[cell, 2] < field.ground[ix, iy] + above_ground_m:
                continue
            m2 = _squared(field.inverse[cell], field.mean[cell], wx, wy, wz)
            if m2 < within2:
                through += 1
                break
    return through / rays if rays > 0 else np.nan


@compiled(nogil=True)
def correlate(points, field, places, yaws, scores) -> None:
    """Writes scores (places, yaws): mean over points of exp(-m2 / 2) of the cell they fall into.

    points: (n, 3) m, levelled, in base_link. places: (k, 3) x, y, z in map.
    """
    nx, ny, nz = field.rows.shape
    scale = 1.0 / field.size_m
    for a in range(yaws.shape[0]):
        c, s = np.cos(yaws[a]), np.sin(yaws[a])
        for k in range(places.shape[0]):
            total = 0.0
            for i in range(points.shape[0]):
                wx = c * points[i, 0] - s * points[i, 1] + places[k, 0]
                wy = s * points[i, 0] + c * points[i, 1] + places[k, 1]
                wz = points[i, 2] + places[k, 2]
                ix = int(np.floor(wx * scale)) - field.corner[0]
                iy = int(np.floor(wy * scale)) - field.corner[1]
                iz = int(np.floor(wz * scale)) - field.corner[2]
                if ix < 0 or iy < 0 or iz < 0 or ix >= nx or iy >= ny or iz >= nz:
                    continue
                cell = field.rows[ix, iy, iz]
                if cell < 0:
                    continue
                m2 = _squared(field.inverse[cell], field.mean[cell], wx, wy, wz)
                total += np.exp(-0.5 * m2)
            scores[k, a] = total / points.shape[0]
