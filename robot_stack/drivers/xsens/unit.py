"""The unit: converts its bytes to samples in base_link's axes, stamped by this computer's clock."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.drivers.counters import Counters
from robot_stack.drivers.device_clock import DeviceClock, Unwrapped
from robot_stack.drivers.imu import Sample
from robot_stack.drivers.xsens.mtdata2 import TICKS_PER_S, Measurement, MeasurementRefused, measurement
from robot_stack.drivers.xsens.params import XsensDriverParams
from robot_stack.drivers.xsens.xbus import (
    CORRUPT,
    ERROR,
    GO_TO_MEASUREMENT,
    MTDATA2,
    SKIPPED,
    Decoder,
    Message,
    encode,
)

LOST, DOUBLED, REFUSED, CLIPPED = "samples lost", "samples doubled", "samples refused", "samples clipped"
JUMPS = "clock jumps"
START: Final = encode(Message(GO_TO_MEASUREMENT, b""))  # does nothing to a unit that measures already
_COUNTER_RANGE, _TICKS = 1 << 16, 1 << 32


class Unit:
    """problem: why the newest message gave no sample; empty if it did. settled: the unit's orientation is valid."""

    def __init__(self, params: XsensDriverParams) -> None:
        self._latency_s = params.latency_s
        self._mounted = Rotation.from_euler("xyz", params.rpy_deg, degrees=True)
        self._matrix: NDArray[np.float64] = self._mounted.as_matrix()
        self.counters = Counters(LOST, DOUBLED, CORRUPT, SKIPPED, REFUSED, CLIPPED, JUMPS)
        self._decoder = Decoder(self.counters)
        self._clock = DeviceClock(params.clock)
        self._ticks = Unwrapped(_TICKS)
        self._counter: int | None = None
        self.problem = ""
        self.settled = False

    @property
    def drift_ppm(self) -> float:
        return self._clock.drift_ppm

    def opened(self) -> None:
        """The line has been opened or reopened: incomplete data and its time are dropped."""
        self._decoder.restart()
        self._clock.restart()
        self._ticks, self._counter = Unwrapped(_TICKS), None
        self.problem = ""

    def received(self, data: bytes, arrival_s: float) -> list[Sample]:
        """arrival_s: of the newest byte, by this computer's clock."""
        samples = []
        for message in self._decoder.feed(data):
            sample = self._sample(message, arrival_s)
            if sample is not None:
                samples.append(sample)
        return samples

    def _sample(self, message: Message, arrival_s: float) -> Sample | None:
        if message.id == ERROR:
            self.problem = f"the unit reports error {message.data.hex() or 'without a number'}"
        if message.id != MTDATA2:
            return None
        try:
            measured = measurement(message.data)
        except MeasurementRefused as refusal:
            self.counters.add(REFUSED)
            self.problem = str(refusal)
            return None
        if not self._follows(measured.counter):
            return None
        self.problem, self.settled = "", measured.settled
        self.counters.add(CLIPPED, int(measured.clipped))
        jumps = self._clock.jumps
        taken_s = self._clock.update(self._ticks.update(measured.ticks) / TICKS_PER_S, arrival_s)
        self.counters.add(JUMPS, self._clock.jumps - jumps)
        return self._mounted_sample(measured, taken_s - self._latency_s)

    def _follows(self, counter: int | None) -> bool:
        """False for a sample that came before."""
        before, self._counter = self._counter, counter
        if before is None or counter is None:
            return True
        step = (counter - before) % _COUNTER_RANGE
        if step == 0:
            self.counters.add(DOUBLED)
            return False
        if step < _COUNTER_RANGE // 2:  # else the unit's counter restarted
            self.counters.add(LOST, step - 1)
        return True

    def _mounted_sample(self, measured: Measurement, stamp_s: float) -> Sample:
        w, x, y, z = measured.orientation_wxyz
        orientation = (Rotation.from_quat((x, y, z, w)) * self._mounted.inv()).as_quat(canonical=True)
        acceleration = self._matrix @ measured.acceleration_mps2
        rotation = self._matrix @ measured.rotation_radps
        return Sample(stamp_s, tuple(orientation.tolist()), tuple(acceleration.tolist()), tuple(rotation.tolist()))
