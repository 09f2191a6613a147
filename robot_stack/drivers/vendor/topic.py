"""The topic of another vendor's driver: its parameters, the stamps of its messages, and why none is used."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.contract.model import Reliability
from robot_stack.core.config import Config
from robot_stack.drivers.counters import Counters
from robot_stack.drivers.device_clock import DeviceClock, DeviceClockParams
from robot_stack.drivers.thinning import Thinning

USED, REFUSED, DOUBLED = "messages used", "messages refused", "messages doubled"
LOST, OUT_OF_ORDER, JUMPS = "messages lost", "messages out of order", "clock jumps"


class MessageRefused(ValueError):
    """The message cannot be used. The message of the error gives what was found and what was expected."""


class Clock(StrEnum):
    """What dates a message: its header by this computer's clock or by the device's own, or its arrival."""

    HEADER = "header"
    DEVICE = "device"
    ARRIVAL = "arrival"


class VendorTopicParams(Config):
    """topic, rate_hz: as the vendor's driver publishes. reliability: of the subscription; best_effort receives both.

    latency_s: from the measurement to the arrival at best, for the clocks device and arrival. device: the estimate of
    the device's clock, null for the others. future_s, oldest_s: largest time of a message after and before its arrival,
    by this computer's clock. silence_s: timeout.
    """

    topic: Annotated[str, Field(pattern=r"^(/[A-Za-z][A-Za-z0-9_]*)+$")]
    rate_hz: Annotated[float, Field(gt=0.0, le=1000.0)]
    reliability: Reliability
    clock: Clock
    latency_s: Annotated[float, Field(ge=0.0, le=0.5)]
    device: DeviceClockParams | None
    future_s: Annotated[float, Field(gt=0.0, le=0.1)]
    oldest_s: Annotated[float, Field(gt=0.0, le=2.0)]
    silence_s: Annotated[float, Field(gt=0.0, le=10.0)]

    @model_validator(mode="after")
    def _fits(self) -> VendorTopicParams:
        if (self.clock is Clock.DEVICE) != (self.device is not None):
            raise ValueError(f"device: needed with clock: device, null with the others; clock is {self.clock}")
        return self


class VendorTopic:
    """Call ``stamp`` for every message, then ``used`` or ``refused``. rate_hz: of the contract's topic.

    Times are by this computer's system clock, except those named steady.
    """

    def __init__(self, params: VendorTopicParams, rate_hz: float) -> None:
        self.params = params
        self._period_s = 1.0 / params.rate_hz
        self._device = None if params.device is None else DeviceClock(params.device)
        self._thinning = Thinning(1.0 / rate_hz, 0.5 * self._period_s) if params.rate_hz > rate_hz else None
        self._header_s = self._newest_s = -math.inf
        self._used_s = -math.inf
        self._refusal = ""
        self.counters = Counters(USED, REFUSED, LOST, DOUBLED, OUT_OF_ORDER, JUMPS)

    def stamp(self, header_s: float, arrival_s: float) -> float | None:
        """The time of the measurement; None for a message between those that the topic's rate needs.

        Raises MessageRefused.
        """
        if header_s == self._header_s and self.params.clock is not Clock.ARRIVAL:
            self.counters.add(DOUBLED)
            raise MessageRefused(f"a message of {header_s:.3f} s was received before, expected a newer one")
        self._header_s = header_s
        stamp_s = self._dated(header_s, arrival_s)
        age_s = arrival_s - stamp_s
        if not -self.params.future_s <= age_s <= self.params.oldest_s:
            raise MessageRefused(
                f"the stamp lies {age_s:.3f} s before the arrival, expected {-self.params.future_s} to "
                f"{self.params.oldest_s} s: for another clock set clock: device or arrival"
            )
        self._follow(stamp_s, arrival_s)
        return stamp_s if self._thinning is None or self._thinning.wants(stamp_s) else None

    def used(self, steady_s: float) -> None:
        """The message has been published."""
        self.counters.add(USED)
        self._used_s, self._refusal = steady_s, ""

    def refused(self, why: str) -> None:
        """The message has been dropped."""
        self.counters.add(REFUSED)
        self._refusal = why

    def problem(self, steady_s: float, publishers: int) -> str:
        """Why no messages are used; empty while they are. publishers: of the topic, as discovered."""
        topic, reliable = self.params.topic, self.params.reliability is Reliability.RELIABLE
        silent = steady_s - self._used_s > self.params.silence_s
        if silent and not publishers:
            return f"{topic} has no publisher: start the vendor's driver, or name its topic"
        if self._refusal:
            return f"{topic} refused: {self._refusal}"
        if not silent:
            return ""
        advice = ": if its publisher is best effort, set reliability: best_effort" if reliable else ""
        return f"{topic} is silent{advice}"

    def _dated(self, header_s: float, arrival_s: float) -> float:
        if self.params.clock is Clock.HEADER:
            return header_s
        if self._device is None:
            return arrival_s - self.params.latency_s
        jumps = self._device.jumps
        stamp_s = self._device.update(header_s, arrival_s) - self.params.latency_s
        self.counters.add(JUMPS, self._device.jumps - jumps)
        return stamp_s

    def _follow(self, stamp_s: float, arrival_s: float) -> None:
        """Raises MessageRefused for a message that is not newer than the one before."""
        step_s = stamp_s - self._newest_s
        if self._newest_s > arrival_s + self.params.future_s:  # this computer's clock was set back
            self.counters.add(JUMPS)
            if self._thinning is not None:
                self._thinning.restart()
        elif step_s <= 0.0:
            self.counters.add(OUT_OF_ORDER)
            raise MessageRefused(f"the message is {-step_s:.3f} s older than the one before, expected a newer one")
        elif math.isfinite(step_s):
            self.counters.add(LOST, max(0, round(step_s / self._period_s) - 1))
        self._newest_s = stamp_s
