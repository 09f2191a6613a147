"""Rigid poses between given ones, compiled: positions linear, rotations by slerp."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled

F64 = NDArray[np.float64]
# A longer step between two knots is no motion: a lift has arrived, or the body was placed elsewhere.
_LEAP_M = 1.0


@compiled(error_model="numpy")
def interpolate(knots_s: F64, poses: F64, times_s: F64, mounted: F64, place: F64, turn: F64) -> None:
    """Fills place (k, 3) and turn (k, 3, 3) with the pose of ``mounted`` (4, 4) on a body, at (k,) rising times.

    poses: (n, 4, 4) of the body at (n,) rising knots; constant before the first and after the last, and over a leap.
    """
    quaternions = np.empty((len(knots_s), 4))
    for k in range(len(knots_s)):
        _quaternion(poses[k], quaternions[k])
    mixed, rotation, centre = np.empty(4), np.empty((3, 3)), np.empty(3)
    left, last = 0, len(knots_s) - 1
    for k in range(len(times_s)):
        while left < last - 1 and times_s[k] > knots_s[left + 1]:
            left += 1
        right = min(left + 1, last)
        span = knots_s[right] - knots_s[left]
        share = min(1.0, max(0.0, (times_s[k] - knots_s[left]) / span)) if span > 0.0 else 0.0
        if abs(poses[right, 0, 3] - poses[left, 0, 3]) + abs(poses[right, 1, 3] - poses[left, 1, 3]) > _LEAP_M:
            share = math.floor(share)
        for i in range(3):
            centre[i] = (1.0 - share) * poses[left, i, 3] + share * poses[right, i, 3]
        _slerp(quaternions[left], quaternions[right], share, mixed)
        _matrix(mixed, rotation)
        for i in range(3):
            place[k, i] = centre[i]
            for j in range(3):
                place[k, i] += rotation[i, j] * mounted[j, 3]
                turn[k, i, j] = (
                    rotation[i, 0] * mounted[0, j] + rotation[i, 1] * mounted[1, j] + rotation[i, 2] * mounted[2, j]
                )


@compiled(error_model="numpy")
def _quaternion(m: F64, q: F64) -> None:
    """Of a rotation matrix, w x y z; the largest component first, which avoids small divisors (Shepperd)."""
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    largest, value = 0, trace
    for i in range(3):
        if m[i, i] > value:
            largest, value = i + 1, m[i, i]
    if largest == 0:
        s = 2.0 * math.sqrt(1.0 + trace)
        q[0], q[1] = 0.25 * s, (m[2, 1] - m[1, 2]) / s
        q[2], q[3] = (m[0, 2] - m[2, 0]) / s, (m[1, 0] - m[0, 1]) / s
        return
    i = largest - 1
    j, k = (i + 1) % 3, (i + 2) % 3
    s = 2.0 * math.sqrt(1.0 + m[i, i] - m[j, j] - m[k, k])
    q[0], q[1 + i] = (m[k, j] - m[j, k]) / s, 0.25 * s
    q[1 + j], q[1 + k] = (m[j, i] + m[i, j]) / s, (m[k, i] + m[i, k]) / s


@compiled(error_model="numpy")
def _slerp(a: F64, b: F64, share: float, mixed: F64) -> None:
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    sign = -1.0 if cosine < 0.0 else 1.0
    angle = math.acos(min(1.0, abs(cosine)))
    weight_a, weight_b = 1.0 - share, share
    if angle > 1e-4:
        weight_a, weight_b = math.sin((1.0 - share) * angle), math.sin(share * angle)
    norm = 0.0
    for i in range(4):
        mixed[i] = weight_a * a[i] + sign * weight_b * b[i]
        norm += mixed[i] * mixed[i]
    for i in range(4):
        mixed[i] /= math.sqrt(norm)


@compiled(error_model="numpy")
def _matrix(q: F64, m: F64) -> None:
    w, x, y, z = q[0], q[1], q[2], q[3]
    m[0, 0], m[0, 1], m[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    m[1, 0], m[1, 1], m[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    m[2, 0], m[2, 1], m[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
