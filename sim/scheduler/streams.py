"""Random streams split from one seed by name, so that an added stream shifts none of the others."""

from __future__ import annotations

import hashlib
import math

import numpy as np

from sim.scheduler.params import Spread

# The 99th percentile of the standard normal distribution.
_Z99 = 2.3263478740408408
_NS_PER_MS = 1e6
_FIRST_BLOCK = 16
_LARGEST_BLOCK = 256


class Delays:
    """Durations in ns drawn from a lognormal distribution, in blocks: a single draw by numpy costs a microsecond."""

    __slots__ = ("_block", "_generator", "_median_ns", "_sigma", "_values")

    def __init__(self, generator: np.random.Generator, spread: Spread) -> None:
        self._generator = generator
        self._median_ns = spread.median_ms * _NS_PER_MS
        self._sigma = math.log(spread.p99_ms / spread.median_ms) / _Z99
        self._values: list[int] = []
        self._block = _FIRST_BLOCK

    def draw(self) -> int:
        if not self._values:
            self._refill()
        return self._values.pop()

    def _refill(self) -> None:
        # math.exp, not numpy's: the latter's vector code differs between processors in the last bit.
        normals = self._generator.standard_normal(self._block).tolist()
        scale, sigma = self._median_ns, self._sigma
        # At least 1 ns: a wake-up without duration could be followed by the next for ever.
        self._values = [max(1, int(scale * math.exp(sigma * value))) for value in reversed(normals)]
        self._block = min(2 * self._block, _LARGEST_BLOCK)


class Streams:
    """The streams of one seed. A stream belongs to one name and goes on for the whole run."""

    def __init__(self, seed: int) -> None:
        """Raises ValueError for a negative seed."""
        if seed < 0:
            raise ValueError(f"the seed must not be negative, is {seed}")
        self.seed = seed
        self._generators: dict[str, np.random.Generator] = {}
        self._delays: dict[str, Delays] = {}

    def generator(self, name: str) -> np.random.Generator:
        """The stream of this name; the same object for the same name."""
        found = self._generators.get(name)
        if found is None:
            # SHA-256 and not Python's hash, which differs from process to process.
            words = np.frombuffer(hashlib.sha256(name.encode()).digest()[:16], "<u4").tolist()
            sequence = np.random.SeedSequence([self.seed, *words])
            found = self._generators[name] = np.random.Generator(np.random.PCG64(sequence))
        return found

    def delays(self, name: str, spread: Spread) -> Delays:
        """Durations from the stream of this name; the same object for the same name."""
        found = self._delays.get(name)
        if found is None:
            found = self._delays[name] = Delays(self.generator(name), spread)
        return found
