"""The body's motion between two readings of the encoders.

Within an interval a module's heading is taken to turn evenly with its distance: its displacement is then the chord of
an arc, along the heading in the middle. Where the interval before is known, how speeds changed since then corrects this
to the next order: a heading that turns ever faster and a wheel that speeds up on the way shift the chord, and a twist
that changes within the interval adds the commutator term of the Magnus series, exp(m + [m, m']/12), with m' the change
of the motion m (Magnus, Comm. Pure Appl. Math. 7, 1954).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.drive.kinematics import Four

# Mean of a parabola over an interval against its value in the middle: 1/12 of its second difference.
_SECOND_ORDER = 1.0 / 12.0


@dataclass(frozen=True, slots=True)
class Interval:
    """elapsed_s: between the readings. headings_rad: at its start. turns_rad: of the headings. distances_m: of the
    wheels, signed. motion: of the body (m, m, rad), where it is known.
    """

    elapsed_s: float
    headings_rad: Four
    turns_rad: tuple[float, ...]
    distances_m: tuple[float, ...]
    motion: Twist2 = ZERO_TWIST

    def part(self, index: int, parts: int) -> Interval:
        """One of ``parts`` even parts of the interval."""
        a, b, c, d = (
            heading + turn * index / parts for heading, turn in zip(self.headings_rad, self.turns_rad, strict=True)
        )
        return Interval(
            self.elapsed_s / parts,
            (a, b, c, d),
            tuple(turn / parts for turn in self.turns_rad),
            tuple(distance / parts for distance in self.distances_m),
        )


def displacements(interval: Interval, previous: Interval | None) -> list[tuple[float, float]]:
    """Displacement vectors (m, base_link) of the modules; ``previous``: the interval just before, if it is known."""
    ratio = interval.elapsed_s / previous.elapsed_s if previous else 0.0
    vectors = []
    for i, (heading, turn, distance) in enumerate(
        zip(interval.headings_rad, interval.turns_rad, interval.distances_m, strict=True)
    ):
        angle = heading + 0.5 * turn
        along, across = distance * _chord_over_arc(turn), 0.0
        if previous:
            angle -= (turn - ratio * previous.turns_rad[i]) * _SECOND_ORDER
            across = (distance - ratio * previous.distances_m[i]) * turn * _SECOND_ORDER
        c, s = math.cos(angle), math.sin(angle)
        vectors.append((along * c - across * s, along * s + across * c))
    return vectors


def _chord_over_arc(turn: float) -> float:
    half = 0.5 * turn
    return math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0


def with_commutator(motion: Twist2, interval: Interval, previous: Interval | None) -> Twist2:
    """``motion`` of ``interval`` with the correction for the twist's change since the interval before."""
    if previous is None:
        return motion
    before = _scaled_sequence(previous.motion, interval.elapsed_s / previous.elapsed_s)
    return Twist2(
        motion.vx + (motion.omega * before[1] - before[2] * motion.vy) * _SECOND_ORDER,
        motion.vy + (before[2] * motion.vx - motion.omega * before[0]) * _SECOND_ORDER,
        motion.omega,
    )


def _scaled_sequence(twist: Twist2, factor: float) -> Sequence[float]:
    return twist.vx * factor, twist.vy * factor, twist.omega * factor
