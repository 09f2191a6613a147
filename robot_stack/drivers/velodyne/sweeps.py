"""Converts packets to sweeps, stamped by this computer's clock."""

from __future__ import annotations

from typing import Any

import numpy as np
import velodyne_decoder

from robot_stack.core.point_cloud import SWEEP, Points, xyz_of
from robot_stack.drivers.counters import Counters
from robot_stack.drivers.device_clock import DeviceClock, Unwrapped
from robot_stack.drivers.sweep import F64, Sweep, turning
from robot_stack.drivers.velodyne.packets import HOUR_US, Packet, PacketRefused, read
from robot_stack.drivers.velodyne.params import VelodyneDriverParams

LOST, DOUBLED, OUT_OF_ORDER, CORRUPT = "packets lost", "packets doubled", "packets out of order", "packets corrupt"
JUMPS, INCOMPLETE = "clock jumps", "sweeps incomplete"
_LATE_PACKETS = 100  # a packet further back is not late: the LiDAR has restarted
_GAP_S = 2.0  # longer: the LiDAR was silent or its clock was set; the loss is unknown
_WHOLE = 0.9  # of a period: a sweep that spans less began or ended elsewhere


class SweepBuilder:
    """period_s: of a turn. mounted: (3, 3) from the LiDAR's own axes to those of the frame that its points are
    published in, None if they are the same. problem: why the newest packet was refused; empty if it was not."""

    def __init__(self, params: VelodyneDriverParams, period_s: float, mounted: F64 | None = None) -> None:
        self._params, self._period_s = params, period_s
        self._turned = turning(params.rpy_deg, mounted)
        self._config = velodyne_decoder.Config(min_range=params.min_range_m, max_range=params.max_range_m)
        self._clock = DeviceClock(params.clock)
        self._time = Unwrapped(HOUR_US)
        self._before_s: float | None = None
        self.counters = Counters(LOST, DOUBLED, OUT_OF_ORDER, CORRUPT, INCOMPLETE, JUMPS)
        self.problem, self.model = "", ""
        self._decoder = self._begin()

    @property
    def drift_ppm(self) -> float:
        return self._clock.drift_ppm

    def received(self, data: bytes, arrival_s: float) -> Sweep | None:
        """The sweep completed by this packet."""
        try:
            packet = read(data)
        except PacketRefused as refusal:
            self.counters.add(CORRUPT)
            self.problem = str(refusal)
            return None
        device_s = 1e-6 * self._time.update(packet.hour_us)
        if not self._follows(packet, device_s):
            return None
        if packet.model != self.model:
            self._decoder = self._begin()  # a decoder rejects the packets of a second model
        self.problem, self.model = "", packet.model
        jumps = self._clock.jumps
        taken_s = self._clock.update(device_s, arrival_s)
        if self._clock.jumps > jumps:
            self.counters.add(JUMPS, self._clock.jumps - jumps)
            self._decoder = self._begin()
        found = self._decoder.decode(taken_s - self._params.latency_s, packet.data, as_pcl_structs=True)
        return self._sweep(*found) if found is not None else None

    def _begin(self) -> Any:
        """A new decoder: an incomplete sweep is not continued."""
        return velodyne_decoder.StreamDecoder(self._config)

    def _follows(self, packet: Packet, device_s: float) -> bool:
        """False for a packet that is old or late. One far back is a restart."""
        before_s, self._before_s = self._before_s, device_s
        if before_s is None:
            return True
        steps = round((device_s - before_s) / packet.duration_s)
        if steps == 0:
            self.counters.add(DOUBLED)
        elif -_LATE_PACKETS < steps < 0:
            self.counters.add(OUT_OF_ORDER)
            self._before_s = before_s
        if -_LATE_PACKETS < steps <= 0:
            return False
        gap_s = steps * packet.duration_s
        if 0.0 < gap_s < _GAP_S:
            self.counters.add(LOST, steps - 1)
        if gap_s > self._period_s:
            self._decoder = self._begin()
        return True

    def _sweep(self, times: Any, cloud: Points) -> Sweep | None:
        if not len(cloud) or float(np.ptp(cloud["time"])) < _WHOLE * self._period_s:
            self.counters.add(INCOMPLETE)
            return None
        order = np.argsort(cloud["time"], kind="stable")  # dual returns come in pairs
        cloud = cloud[order]
        points = np.empty(len(cloud), SWEEP)
        for name in ("x", "y", "z", "intensity", "ring"):
            points[name] = cloud[name]
        newest = float(cloud["time"][-1])
        points["time"] = cloud["time"] - np.float32(newest)
        if self._turned is not None:
            coordinates = xyz_of(points)
            coordinates[:] = coordinates @ self._turned.T
        return Sweep(points, float(times.host) + newest)
