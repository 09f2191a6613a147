"""Converts packets to sweeps, stamped by this computer's clock."""

from __future__ import annotations

import math

from scipy.spatial.transform import Rotation

from robot_stack.drivers.counters import Counters
from robot_stack.drivers.device_clock import DeviceClock, Unwrapped
from robot_stack.drivers.ouster.frame import Frame
from robot_stack.drivers.ouster.geometry import geometry_of, to_sensor
from robot_stack.drivers.ouster.layouts import layout_of
from robot_stack.drivers.ouster.metadata import Metadata
from robot_stack.drivers.ouster.packets import OtherSensor, Packet, PacketRefused, read
from robot_stack.drivers.ouster.params import OusterDriverParams
from robot_stack.drivers.ouster.points import Limits, points_of
from robot_stack.drivers.sweep import F64, Sweep

LOST, DOUBLED, OUT_OF_ORDER, CORRUPT = "packets lost", "packets doubled", "packets out of order", "packets corrupt"
OTHERS, JUMPS, STARTS = "packets that differ from the metadata", "clock jumps", "starts of the sensor"
INCOMPLETE, EMPTY = "sweeps incomplete", "sweeps without a return"
_FRAMES = 1 << 16  # number of frames after which the sensor counts from 0
_LATE_FRAMES = 2  # a packet further back is not late: the sensor has restarted
_GAP_S = 2.0  # longer: the sensor was silent or its clock was set; the loss is unknown
_WHOLE = 0.9  # of a frame's packets: a sweep that spans less began or ended elsewhere


class SweepBuilder:
    """A frame is a sweep, complete when all of its packets have arrived, else when the next frame begins.

    Packets may arrive in another order until then. mounted: (3, 3) from the sensor's own axes
    to those of the frame that its points are published in, None if they are the same.
    Raises ConfigError, which names ``source``, for metadata with unsupported packets.
    """

    def __init__(self, params: OusterDriverParams, metadata: Metadata, source: str, mounted: F64 | None = None) -> None:
        self._latency_s, self._metadata = params.latency_s, metadata
        self._layout = layout_of(metadata, source)
        own = Rotation.from_euler("xyz", params.rpy_deg, degrees=True).as_matrix() @ to_sensor(metadata)[0]
        self._geometry = geometry_of(metadata, own if mounted is None else mounted @ own)
        step_m = 1e-3 * self._layout.pixel.step_mm
        self._limits = Limits(math.ceil(params.min_range_m / step_m), math.floor(params.max_range_m / step_m), step_m)
        self._frame = Frame(metadata, self._layout)
        self._clock = DeviceClock(params.clock)
        self.counters = Counters(LOST, DOUBLED, OUT_OF_ORDER, CORRUPT, OTHERS, INCOMPLETE, EMPTY, JUMPS, STARTS)
        self.model = ""
        self._refused, self._empty = "", ""
        self._initialization: int | None = None
        self._newest_s: float | None = None
        self._host_ahead_s = 0.0
        self._begin_anew()

    @property
    def drift_ppm(self) -> float:
        return self._clock.drift_ppm

    @property
    def problem(self) -> str:
        """Why the newest packet or sweep was rejected; empty if neither was."""
        return self._refused or self._empty

    def received(self, data: bytes, arrival_s: float) -> Sweep | None:
        """The sweep completed by this packet."""
        try:
            packet = read(data, self._layout, self._metadata)
        except PacketRefused as refusal:
            self.counters.add(OTHERS if isinstance(refusal, OtherSensor) else CORRUPT)
            self._refused = str(refusal)
            return None
        self._refused, self.model = "", self._metadata.describe()
        self._see_start(packet)
        self._see_time(packet, arrival_s)
        return self._add(packet)

    def _begin_anew(self) -> None:
        """Drops an incomplete frame."""
        self._numbers = Unwrapped(_FRAMES)
        self._number: int | None = None
        self._first, self._done = True, False
        self._frame.begin()

    def _see_start(self, packet: Packet) -> None:
        """Handles a restart: the sensor has a new initialization number, and its time starts anywhere."""
        before, self._initialization = self._initialization, packet.initialization
        if before is not None and before != packet.initialization:
            self.counters.add(STARTS)
            self._clock.restart()
            self._newest_s = None
            self._begin_anew()

    def _see_time(self, packet: Packet, arrival_s: float) -> None:
        """Updates the clocks' offset by the newest column; late packets do not count."""
        if not packet.valid.any():
            return
        device_s = 1e-9 * float(packet.times_ns[packet.valid][-1])
        before_s = self._newest_s
        late_s = 0.0 if before_s is None else before_s - device_s
        if late_s > _LATE_FRAMES * self._metadata.period_s or late_s < -_GAP_S:
            self._begin_anew()
        elif before_s is not None and late_s >= 0.0:
            return
        self._newest_s = device_s
        jumps = self._clock.jumps
        self._host_ahead_s = self._clock.update(device_s, arrival_s) - device_s - self._latency_s
        if self._clock.jumps > jumps:
            self.counters.add(JUMPS, self._clock.jumps - jumps)
            self._begin_anew()

    def _add(self, packet: Packet) -> Sweep | None:
        number = self._numbers.update(packet.frame)
        sweep = None
        if self._number is None:
            self._number = number
        elif number < self._number - _LATE_FRAMES:
            self._begin_anew()
            self._number = self._numbers.update(packet.frame)
        elif number < self._number:
            self.counters.add(OUT_OF_ORDER)
            return None
        elif number > self._number:
            sweep = self._close(number)
        if self._frame.has(packet):
            self.counters.add(DOUBLED)
            return sweep
        if packet.first < self._frame.furthest:
            self.counters.add(OUT_OF_ORDER)
        self._frame.add(packet)
        if self._frame.lost or self._done:
            return sweep
        self._done = True
        return self._sweep()

    def _close(self, number: int) -> Sweep | None:
        """The frame that ends at the begin of ``number``; None if it was completed before, or is incomplete."""
        assert self._number is not None
        lost = self._frame.lost + (number - self._number - 1) * self._frame.packets
        self.counters.add(LOST, lost - self._frame.before_first if self._first else lost)
        sweep = None if self._done else self._sweep()
        self._number, self._first, self._done = number, False, False
        self._frame.begin()
        return sweep

    def _sweep(self) -> Sweep | None:
        if self._frame.spanned < _WHOLE or not self._frame.valid.any():
            self.counters.add(INCOMPLETE)
            return None
        points, newest_ns = points_of(self._frame, self._geometry, self._limits)
        if not len(points):
            self.counters.add(EMPTY)
            self._empty = "the newest sweep has no returns"
            return None
        self._empty = ""
        return Sweep(points, 1e-9 * newest_ns + self._host_ahead_s)
