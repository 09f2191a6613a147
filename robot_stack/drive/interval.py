"""The body's motion between two readings of the encoders, to the next order beyond constant speeds.

Within an interval headings and distances of the wheels follow parabolas through the last three readings. The
displacement of a wheel is then the chord of an arc, along the heading in the middle, with small corrections for the
change of the heading's rate and of the wheel's speed. A twist that changes within the interval adds the commutator
term of the Magnus series, exp(m + [m, m']/12), with m' the change of the motion m (Magnus, Comm. Pure Appl. Math. 7,
1954). Without these terms a ride of 78 m with perfect encoders at 50 Hz ends 1 mm off, with them 0.004 mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from operator import add, sub

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.drive.kinematics import ZEROS, Four

# Mean of u (1 - u) / 2 over an interval: the mean of a parabola minus that of its chord, per second difference.
_PARABOLA = 1.0 / 12.0


@dataclass(frozen=True, slots=True)
class Interval:
    """elapsed_s: between the readings. headings_rad: at its start. turns_rad: of the headings. ways_m: of the wheels,
    signed. motion: of the body (m, m, rad), where it is known.
    """

    elapsed_s: float
    headings_rad: Four
    turns_rad: Four
    ways_m: Four
    motion: Twist2 = ZERO_TWIST


@dataclass(frozen=True, slots=True)
class Curvature:
    """Second differences over an interval: of the headings (rad), of the ways of the wheels (m), of the motion."""

    turns_rad: Four
    ways_m: Four
    motion_ratio: float
    motion: Twist2


def curvature(interval: Interval, previous: Interval | None, max_acceleration_radps2: float) -> Curvature | None:
    """Second difference of the speeds since the ``previous`` interval; None if unknown.

    A heading whose rate changed by more than ``max_acceleration_radps2`` allows started or stopped in between: a
    parabola does not fit its readings, so its change counts as zero.
    """
    if previous is None:
        return None
    ratio = interval.elapsed_s / previous.elapsed_s
    weight = 2.0 * ratio / (1.0 + ratio)  # the rates lie half of both intervals apart
    most = max_acceleration_radps2 * interval.elapsed_s**2
    turns = [weight * (new - ratio * old) for new, old in zip(interval.turns_rad, previous.turns_rad, strict=True)]
    ways = [weight * (new - ratio * old) for new, old in zip(interval.ways_m, previous.ways_m, strict=True)]
    return Curvature(four([turn if abs(turn) <= most else 0.0 for turn in turns]), four(ways), ratio, previous.motion)


def split(interval: Interval, second_difference: Curvature | None, parts: int) -> list[Interval]:
    """``parts`` parts of equal time, along the parabolas that ``second_difference`` describes."""
    turns_bend, ways_bend = (
        (second_difference.turns_rad, second_difference.ways_m) if second_difference else (ZEROS, ZEROS)
    )
    pieces = []
    for index in range(parts):
        start, end = index / parts, (index + 1) / parts
        pieces.append(
            Interval(
                interval.elapsed_s / parts,
                four(map(add, interval.headings_rad, _along(interval.turns_rad, turns_bend, start))),
                four(
                    map(sub, _along(interval.turns_rad, turns_bend, end), _along(interval.turns_rad, turns_bend, start))
                ),
                four(map(sub, _along(interval.ways_m, ways_bend, end), _along(interval.ways_m, ways_bend, start))),
            )
        )
    return pieces


def _along(totals: Four, second_differences: Four, share: float) -> Four:
    """Parabolas from 0 to ``totals`` with the second differences ``second_differences``, at ``share`` of the
    interval."""
    return four(
        total * share - 0.5 * second_difference * share * (1.0 - share)
        for total, second_difference in zip(totals, second_differences, strict=True)
    )


def displacements(interval: Interval, second_difference: Curvature | None) -> list[tuple[float, float]]:
    """Displacement vectors of the modules, m, base_link."""
    vectors = []
    for i, (heading, turn, way) in enumerate(
        zip(interval.headings_rad, interval.turns_rad, interval.ways_m, strict=True)
    ):
        angle, along, across = heading + 0.5 * turn, way * _chord_over_arc(turn), 0.0
        if second_difference:
            angle -= second_difference.turns_rad[i] * _PARABOLA
            across = second_difference.ways_m[i] * turn * _PARABOLA
        c, s = math.cos(angle), math.sin(angle)
        vectors.append((along * c - across * s, along * s + across * c))
    return vectors


def _chord_over_arc(turn: float) -> float:
    half = 0.5 * turn
    return math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0


def with_commutator(motion: Twist2, second_difference: Curvature | None) -> Twist2:
    """``motion`` with the correction for the twist's change within the interval."""
    if second_difference is None:
        return motion
    before = second_difference.motion.scaled(second_difference.motion_ratio)
    factor = _PARABOLA * 2.0 * second_difference.motion_ratio / (1.0 + second_difference.motion_ratio)
    return Twist2(
        motion.vx + factor * (motion.omega * before.vy - before.omega * motion.vy),
        motion.vy + factor * (before.omega * motion.vx - motion.omega * before.vx),
        motion.omega,
    )


def four(values: Iterable[float]) -> Four:
    """One value of each module."""
    a, b, c, d = values
    return a, b, c, d
