"""The compiled part of P2D-NDT (Magnusson 2009, chapter 6): objective, gradient, Hessian, and Newton's method.

A pose moves by increments delta (6,) [translation m, rotation rad], both in the axes of map, the rotation about the
origin of base_link: x -> exp(rotation) R x + t + translation. Derivatives are taken at delta = 0, where they are exact
and short.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return"

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled

# Beyond this squared Mahalanobis distance a cell's pull is below 1e-6.
_FAR2 = 28.0
# The voxel of a point and its direct neighbours.
DX = np.array([0, 1, -1, 0, 0, 0, 0])
DY = np.array([0, 0, 0, 1, -1, 0, 0])
DZ = np.array([0, 0, 0, 0, 0, 1, -1])


@compiled(nogil=True, inline="always")
def add_turned(h, axx, axy, axz, ayy, ayz, azz, px, py, pz):
    """Adds J^T a J of one point to the upper half of h, where J = [1 K] and K omega = omega x p."""
    # a K; the columns of K are (0, -pz, py), (pz, 0, -px), (-py, px, 0).
    b00, b10, b20 = axz * py - axy * pz, ayz * py - ayy * pz, azz * py - ayz * pz
    b01, b11, b21 = axx * pz - axz * px, axy * pz - ayz * px, axz * pz - azz * px
    b02, b12, b22 = axy * px - axx * py, ayy * px - axy * py, ayz * px - axz * py
    h[0, 0] += axx
    h[0, 1] += axy
    h[0, 2] += axz
    h[1, 1] += ayy
    h[1, 2] += ayz
    h[2, 2] += azz
    h[0, 3] += b00
    h[1, 3] += b10
    h[2, 3] += b20
    h[0, 4] += b01
    h[1, 4] += b11
    h[2, 4] += b21
    h[0, 5] += b02
    h[1, 5] += b12
    h[2, 5] += b22
    h[3, 3] += py * b20 - pz * b10
    h[3, 4] += py * b21 - pz * b11
    h[3, 5] += py * b22 - pz * b12
    h[4, 4] += pz * b01 - px * b21
    h[4, 5] += pz * b02 - px * b22
    h[5, 5] += px * b12 - py * b02


@compiled(nogil=True)
def fill_symmetric(upper, full):
    """Writes the (6, 6) matrix whose upper half is given."""
    for i in range(6):
        for j in range(i, 6):
            full[i, j] = upper[i, j]
            full[j, i] = upper[i, j]


@compiled(nogil=True)
def derivatives(points, rotation, position, field, d1, d2, gradient, hessian):
    """The objective; writes its gradient (6,) and Hessian (6, 6) with respect to the increment."""
    gradient[:] = 0.0
    total = 0.0
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
        # Over the cells around the point: v = sum f C q, a = sum f (C - d2 C q (C q)^T).
        vx = vy = vz = 0.0
        axx = axy = axz = ayy = ayz = azz = 0.0
        near = False
        for k in range(7):
            jx, jy, jz = ix + DX[k], iy + DY[k], iz + DZ[k]
            if jx < 0 or jy < 0 or jz < 0 or jx >= nx or jy >= ny or jz >= nz:
                continue
            cell = field.rows[jx, jy, jz]
            if cell < 0:
                continue
            qx, qy, qz = wx - field.mean[cell, 0], wy - field.mean[cell, 1], wz - field.mean[cell, 2]
            c = field.inverse[cell]
            cx = c[0] * qx + c[1] * qy + c[2] * qz
            cy = c[1] * qx + c[3] * qy + c[4] * qz
            cz = c[2] * qx + c[4] * qy + c[5] * qz
            m2 = cx * qx + cy * qy + cz * qz
            if m2 >= _FAR2:
                continue
            near = True
            e = np.exp(-0.5 * d2 * m2)
            total += e
            f = -d1 * d2 * e
            vx += f * cx
            vy += f * cy
            vz += f * cz
            g = f * d2
            axx += f * c[0] - g * cx * cx
            axy += f * c[1] - g * cx * cy
            axz += f * c[2] - g * cx * cz
            ayy += f * c[3] - g * cy * cy
            ayz += f * c[4] - g * cy * cz
            azz += f * c[5] - g * cz * cz
        if not near:
            continue
        gradient[0] += vx
        gradient[1] += vy
        gradient[2] += vz
        gradient[3] += py * vz - pz * vy
        gradient[4] += pz * vx - px * vz
        gradient[5] += px * vy - py * vx
        add_turned(h, axx, axy, axz, ayy, ayz, azz, px, py, pz)
        # v times the second derivative of exp(omega) p: (e_i p_j + e_j p_i) / 2 - delta_ij p.
        pv = px * vx + py * vy + pz * vz
        h[3, 3] += px * vx - pv
        h[3, 4] += 0.5 * (px * vy + py * vx)
        h[3, 5] += 0.5 * (px * vz + pz * vx)
        h[4, 4] += py * vy - pv
        h[4, 5] += 0.5 * (py * vz + pz * vy)
        h[5, 5] += pz * vz - pv
    fill_symmetric(h, hessian)
    return d1 * total


@compiled(nogil=True)
def turned(rotation, omega) -> npt.NDArray[np.float64]:
    """exp(omega) times a rotation matrix (Rodrigues)."""
    angle = np.sqrt(omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2)
    if angle < 1e-12:
        return rotation.copy()
    x, y, z = omega[0] / angle, omega[1] / angle, omega[2] / angle
    s, c = np.sin(angle), np.cos(angle)
    k = 1.0 - c
    turn = np.empty((3, 3))
    turn[0, 0], turn[0, 1], turn[0, 2] = c + k * x * x, k * x * y - s * z, k * x * z + s * y
    turn[1, 0], turn[1, 1], turn[1, 2] = k * x * y + s * z, c + k * y * y, k * y * z - s * x
    turn[2, 0], turn[2, 1], turn[2, 2] = k * x * z - s * y, k * y * z + s * x, c + k * z * z
    return turn @ rotation


@compiled(nogil=True)
def _tilt(rotation, up):
    """Tilt of the measured vertical ``up`` (in base_link), rotated into map, against z: the rotation that levels it."""
    return (
        rotation[1, 0] * up[0] + rotation[1, 1] * up[1] + rotation[1, 2] * up[2],
        -(rotation[0, 0] * up[0] + rotation[0, 1] * up[1] + rotation[0, 2] * up[2]),
    )


@compiled(nogil=True)
def _whole(points, rotation, position, field, d1, d2, prior, gradient, hessian):
    """The objective plus the prior, with the derivatives of both."""
    score = derivatives(points, rotation, position, field, d1, d2, gradient, hessian)
    tx, ty = _tilt(rotation, prior)
    dz = position[2] - prior[4]
    gradient[2] += prior[5] * dz
    gradient[3] -= prior[3] * tx
    gradient[4] -= prior[3] * ty
    hessian[2, 2] += prior[5]
    hessian[3, 3] += prior[3]
    hessian[4, 4] += prior[3]
    return score + 0.5 * (prior[3] * (tx * tx + ty * ty) + prior[5] * dz * dz)


@compiled(nogil=True)
def newton(points, rotation, position, field, d1, d2, prior, limits) -> tuple[float, int, bool, int]:
    """Minimises the objective plus the prior; moves rotation and position in place.

    prior: (6,) vertical in base_link (3), its weight 1/rad2, height m, its weight 1/m2. limits: [iterations, longest
    step m, longest turn rad, step m and turn rad below which it has converged]. Returns (objective, iterations,
    converged, reversals): reversals counts steps that went back against the one before.
    """
    gradient, hessian = np.empty(6), np.empty((6, 6))
    last = np.zeros(6)
    reversals = 0
    new_gradient, new_hessian = np.empty(6), np.empty((6, 6))
    score = _whole(points, rotation, position, field, d1, d2, prior, gradient, hessian)
    for iteration in range(int(limits[0])):
        value, vector = np.linalg.eigh(hessian)
        # Made positive definite: across a saddle the step goes down its slope, in flat directions it stays small.
        floor = max(1e-3 * value[5], 1e-6)
        along = vector.T @ gradient
        for k in range(6):
            along[k] /= max(abs(value[k]), floor)
        step = -(vector @ along)
        shrink = min(1.0, limits[1] / max(np.linalg.norm(step[:3]), 1e-12))
        shrink = min(shrink, limits[2] / max(np.linalg.norm(step[3:]), 1e-12))
        step *= shrink
        slope = gradient @ step
        size, accepted = 1.0, False
        new_rotation, new_position, new_score = rotation, position, score
        for _ in range(6):
            new_rotation = turned(rotation, size * step[3:])
            new_position = position + size * step[:3]
            # With its derivatives at once: nearly every first try is accepted, and the next step needs them.
            new_score = _whole(points, new_rotation, new_position, field, d1, d2, prior, new_gradient, new_hessian)
            if new_score <= score + 1e-4 * size * slope:
                accepted = True
                break
            # The lowest point of the parabola through both scores and the slope (Nocedal and Wright 2006, 3.5).
            curve = new_score - score - size * slope
            size = min(max(-0.5 * slope * size * size / max(curve, 1e-12), 0.1 * size), 0.5 * size)
        if not accepted:  # no step descends any more: converged
            small = np.linalg.norm(step[:3]) < 10.0 * limits[3] and np.linalg.norm(step[3:]) < 10.0 * limits[4]
            return score, iteration + 1, small, reversals
        rotation[:] = new_rotation
        position[:] = new_position
        score = new_score
        gradient[:] = new_gradient
        hessian[:] = new_hessian
        if iteration > 0 and step @ last < -0.5 * np.linalg.norm(step) * np.linalg.norm(last):
            reversals += 1
        last = size * step
        if np.linalg.norm(last[:3]) < limits[3] and np.linalg.norm(last[3:]) < limits[4]:
            return score, iteration + 1, True, reversals
    return score, int(limits[0]), False, reversals
