"""Integration of yaw gyro samples to the angle between two times.

A sample is the mean rate since the sample before, as MEMS units deliver it, so the angle is the plain sum. The rate is
integrated once, without gaps, and increments are differences of the sum: an odometry message that arrives before the
gyro samples of its last milliseconds uses a held rate, which the next increment corrects.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from robot_stack.localization.params import GyroParams

# Weight of a new sample in the running estimate of the scatter: about 50 samples of memory.
_SCATTER_WEIGHT = 0.02


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One reading of the IMU: yaw rate about base_link's z, rad/s, and every number of the message as its signature."""

    stamp_s: float
    yaw_rate_radps: float
    signature: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class GyroIncrement:
    """Angle turned in an interval, bias included, rad, and the variance of its noise, rad2."""

    angle_rad: float
    variance_rad2: float


@dataclass(frozen=True, slots=True)
class _Knot:
    stamp_s: float
    rate_radps: float
    angle_rad: float
    variance_rad2: float
    piece: int  # counts up at every gap: angles of two pieces have no difference


class GyroIntegrator:
    """Integrates samples and returns increments between successive query times."""

    def __init__(self, params: GyroParams) -> None:
        self._params = params
        self._knots: deque[_Knot] = deque()
        self._taken: _Knot | None = None
        self._piece = 0
        self._signature: tuple[float, ...] = ()
        self._repeats = 0
        self._backward = 0
        self._rates: deque[float] = deque(maxlen=3)
        self._scatter_radps2 = params.noise_radps**2

    @property
    def frozen(self) -> bool:
        """True while the sensor repeats the same bits, which a working sensor never does."""
        return self._repeats >= self._params.frozen_samples

    @property
    def noise_radps(self) -> float:
        """Noise of one sample: the configured one, or the observed one if that is more."""
        return max(self._params.noise_radps, math.sqrt(self._scatter_radps2))

    def clear(self) -> None:
        """Drops all samples, e.g. after a restart of the clock. The next increment needs two new ends."""
        self._knots.clear()
        self._rates.clear()
        self._taken = None
        self._piece += 1
        self._backward = 0

    def add(self, sample: ImuSample) -> str:
        """Adds a sample; returns the reason if it is rejected, else an empty text."""
        if not math.isfinite(sample.stamp_s) or not math.isfinite(sample.yaw_rate_radps):
            return f"/sensors/imu angular_velocity.z is not finite: {sample.yaw_rate_radps}"
        if abs(sample.yaw_rate_radps) > self._params.max_rate_radps:
            return f"/sensors/imu angular_velocity.z is beyond its limit of {self._params.max_rate_radps} rad/s"
        self._count_repeats(sample.signature)
        if self.frozen:
            self.clear()
            return f"/sensors/imu frozen: {self._params.frozen_samples} or more equal samples"
        if self._knots and sample.stamp_s <= self._knots[-1].stamp_s:
            self._backward += 1
            if self._backward >= self._params.frozen_samples:  # not one late message: the clock was set back
                self.clear()
            return "/sensors/imu stamp does not advance"
        self._backward = 0
        self._observe_scatter(sample.yaw_rate_radps)
        self._append(sample)
        return ""

    def take(self, until_s: float) -> GyroIncrement | None:
        """The angle from the last query time to ``until_s``; None where the samples do not cover that."""
        end = self._at(until_s)
        start, self._taken = self._taken, end
        if start is None or end is None or start.piece != end.piece:
            return None
        # A held rate that turned out smaller can make the sum fall: the variance is at least that of one sample.
        least_rad2 = (self.noise_radps * self._params.period_s) ** 2
        return GyroIncrement(end.angle_rad - start.angle_rad, max(least_rad2, end.variance_rad2 - start.variance_rad2))

    def _count_repeats(self, signature: tuple[float, ...]) -> None:
        self._repeats = self._repeats + 1 if signature == self._signature else 0
        self._signature = signature

    def _observe_scatter(self, rate_radps: float) -> None:
        # The second difference of white noise has six times its variance; a turning robot's own rate, smooth over
        # 20 ms, all but cancels in it.
        self._rates.append(rate_radps)
        if len(self._rates) == 3:
            first, second, third = self._rates
            self._scatter_radps2 += _SCATTER_WEIGHT * ((first - 2.0 * second + third) ** 2 / 6.0 - self._scatter_radps2)

    def _append(self, sample: ImuSample) -> None:
        last = self._knots[-1] if self._knots else None
        if last is not None and sample.stamp_s - last.stamp_s <= self._params.hold_s:
            self._knots.append(self._after(last, sample.stamp_s, sample.yaw_rate_radps))
        else:
            self._piece += 1
            self._rates.clear()
            self._knots.append(_Knot(sample.stamp_s, sample.yaw_rate_radps, 0.0, 0.0, self._piece))
        self._forget(sample.stamp_s)

    def _after(self, knot: _Knot, stamp_s: float, rate_radps: float) -> _Knot:
        """The knot that follows after a time at a mean rate."""
        dt_s = stamp_s - knot.stamp_s
        lost_s = max(0.0, dt_s - 1.5 * self._params.period_s)
        unseen_rad = 0.5 * self._params.gap_acceleration_radps2 * lost_s**2
        variance_rad2 = self.noise_radps**2 * self._params.period_s * dt_s + unseen_rad**2
        angle_rad = knot.angle_rad + rate_radps * dt_s
        return _Knot(stamp_s, rate_radps, angle_rad, knot.variance_rad2 + variance_rad2, knot.piece)

    def _forget(self, now_s: float) -> None:
        # Odometry arrives at 50 Hz: a second of knots is plenty, and bounds the memory if odometry stops.
        while now_s - self._knots[0].stamp_s > 1.0:
            self._knots.popleft()

    def _at(self, time_s: float) -> _Knot | None:
        if not self._knots or time_s < self._knots[0].stamp_s or time_s > self._knots[-1].stamp_s + self._params.hold_s:
            return None
        before = next(knot for knot in reversed(self._knots) if knot.stamp_s <= time_s)
        after = next((knot for knot in self._knots if knot.stamp_s > time_s), None)
        if after is None:
            return self._after(before, time_s, before.rate_radps)
        return None if after.piece != before.piece else self._after(before, time_s, after.rate_radps)
