"""Comfort of a ride at the seat, from the inertial unit: vibration by ISO 2631-1, and jerk.

The frequency weightings act on the spectrum of overlapping blocks (Welch), so they are exact up to half the sampling
rate; the standard's upper band limit of 100 Hz is beyond it.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from robot_stack.core.config import Config, load
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, Pose2

F64 = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
_RATE_HZ = 100.0
_BLOCK = 512  # 5.12 s: two periods of the lowest frequency, 0.4 Hz
_LOWEST_HZ = 0.4
# The rotation of the robot is rigid at low frequencies; above, its derivative is noise.
_ROTATION_HZ = 10.0
# A larger gap between two samples begins a new block.
_GAP_S = 0.05
_JERK_SAMPLES = 20  # 0.2 s
_JERK_BIN_MPS3, _JERK_BINS = 0.05, 800


class ComfortParams(Config):
    """``config/comfort.yaml``: the seat in the frame of a docked wheelchair's dock."""

    seat_x_m: Annotated[float, Field(ge=-2.0, le=2.0)]
    seat_z_m: Annotated[float, Field(ge=0.0, le=2.0)]


@dataclass(frozen=True, slots=True)
class Comfort:
    """weighted_mps2: rms of x, y (weighting Wd) and z (Wk), m/s2. jerk_p99_mps3: of the horizontal acceleration.

    duration_s: of the motion that was evaluated, without stops.
    """

    weighted_mps2: tuple[float, float, float]
    jerk_p99_mps3: float
    duration_s: float

    @property
    def total_mps2(self) -> float:
        """The vibration total value of a seated person, ISO 2631-1 6.5 with factors 1."""
        return math.hypot(*self.weighted_mps2)


class ComfortMeter:
    """Collects samples of the inertial unit while the robot moves. seat: x, y, z of the seat in base_link, m."""

    def __init__(self, seat: tuple[float, float, float]) -> None:
        self._seat = np.array(seat)
        self._samples: list[tuple[float, ...]] = []
        self._moved: list[bool] = []
        self._last_s = -math.inf
        self._squares = np.zeros(3)
        self._blocks = self._stretches = 0
        self._block_before = False  # in this stretch: the next one overlaps it by a half
        self._sum = np.zeros(2)
        self._recent: deque[tuple[float, float]] = deque(maxlen=_JERK_SAMPLES + 1)
        self._means: deque[F64] = deque(maxlen=_JERK_SAMPLES + 1)
        self._jerks = np.zeros(_JERK_BINS, np.int64)

    def add(
        self,
        stamp_s: float,
        acceleration_mps2: tuple[float, float, float],
        rotation_radps: tuple[float, float, float],
        *,
        moves: bool,
    ) -> None:
        """One sample in base_link, gravity included. moves: the robot moves; a block needs it throughout."""
        gap = not 0.0 < stamp_s - self._last_s <= _GAP_S
        self._last_s = stamp_s
        if gap or not moves:
            self._samples.clear()
            self._block_before = False
            self._means.clear()
            self._recent.clear()
        if not moves or not all(map(math.isfinite, (*acceleration_mps2, *rotation_radps))):
            return
        self._samples.append((*acceleration_mps2, *rotation_radps))
        self._add_jerk(acceleration_mps2[0], acceleration_mps2[1])
        if len(self._samples) == _BLOCK:
            self._squares += weighted_squares(np.array(self._samples), self._seat)
            self._blocks += 1
            self._stretches += not self._block_before
            self._block_before = True
            del self._samples[: _BLOCK // 2]

    def comfort(self) -> Comfort | None:
        """None before the robot has moved for a whole block."""
        if not self._blocks:
            return None
        x, y, z = np.sqrt(self._squares / self._blocks).tolist()
        share = np.cumsum(self._jerks) / max(int(self._jerks.sum()), 1)
        jerk = _JERK_BIN_MPS3 * (int(np.searchsorted(share, 0.99)) + 1)
        return Comfort((x, y, z), jerk, 0.5 * _BLOCK / _RATE_HZ * (self._blocks + self._stretches))

    def _add_jerk(self, x: float, y: float) -> None:
        """Change of the mean acceleration of 0.2 s within 0.2 s."""
        self._recent.append((x, y))
        if len(self._recent) <= _JERK_SAMPLES:
            return
        self._means.append(np.mean(self._recent, axis=0))
        if len(self._means) <= _JERK_SAMPLES:
            return
        jerk = float(np.hypot(*(self._means[-1] - self._means[0]))) * _RATE_HZ / _JERK_SAMPLES
        self._jerks[min(int(jerk / _JERK_BIN_MPS3), _JERK_BINS - 1)] += 1


def load_seat() -> tuple[float, float, float]:
    """The seat of a docked wheelchair in base_link, m. Raises ConfigError."""
    params = load(ComfortParams, "comfort")
    seat = (load_docks().latched_wheelchair() or IDENTITY).compose(Pose2(params.seat_x_m, 0.0, 0.0))
    return seat.x, seat.y, params.seat_z_m


def weighted_squares(samples: F64, seat: F64) -> F64:
    """(3,) mean squares of the weighted acceleration at the seat, m2/s4.

    samples: (n, 6) acceleration and rotation in base_link at 100 Hz.
    """
    acceleration, rotation = samples[:, :3], samples[:, 3:]
    still = acceleration + np.cross(rotation, np.cross(rotation, seat))
    window = np.hanning(len(samples))[:, None]
    scale = 2.0 / (len(samples) * float(np.sum(window**2)))
    frequency = np.asarray(np.fft.rfftfreq(len(samples), 1.0 / _RATE_HZ), np.float64)
    spectrum = np.fft.rfft((still - still.mean(axis=0)) * window, axis=0)
    turning = np.fft.rfft((rotation - rotation.mean(axis=0)) * window, axis=0)
    rigid = np.where(frequency <= _ROTATION_HZ, 2.0j * np.pi * frequency, 0.0)
    spectrum += np.cross(turning * rigid[:, None], seat)
    weight = np.stack([wd(frequency), wd(frequency), wk(frequency)], axis=1)
    return np.asarray(scale * np.sum(np.abs(spectrum * weight) ** 2, axis=0), np.float64)


def wk(frequency_hz: F64) -> F64:
    """Weighting of the vertical acceleration of a seat, ISO 2631-1 Annex A."""
    p = 2.0j * np.pi * frequency_hz
    return np.asarray(np.abs(_band(p) * _transition(p, 12.5) * _step(p, 2.37, 0.91, 3.35, 0.91)), np.float64)


def wd(frequency_hz: F64) -> F64:
    """Weighting of the horizontal acceleration of a seat, ISO 2631-1 Annex A."""
    p = 2.0j * np.pi * frequency_hz
    return np.asarray(np.abs(_band(p) * _transition(p, 2.0)), np.float64)


def _band(p: Complex) -> Complex:
    """The lower band limit, a Butterworth high-pass filter of second order."""
    w = 2.0 * np.pi * _LOWEST_HZ
    return np.asarray(p**2 / (p**2 + math.sqrt(2.0) * w * p + w**2))


def _transition(p: Complex, frequency_hz: float) -> Complex:
    """From acceleration to velocity above ``frequency_hz``."""
    w, q = 2.0 * np.pi * frequency_hz, 0.63
    return np.asarray((1.0 + p / w) / (1.0 + p / (q * w) + (p / w) ** 2))


def _step(p: Complex, low_hz: float, low_q: float, high_hz: float, high_q: float) -> Complex:
    """A rise between the two frequencies."""
    low, high = 2.0 * np.pi * low_hz, 2.0 * np.pi * high_hz
    upper = 1.0 + p / (low_q * low) + (p / low) ** 2
    return np.asarray(upper / (1.0 + p / (high_q * high) + (p / high) ** 2) * (low / high) ** 2)
