"""The columns of one turn, in order, whatever the order of their packets."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.drivers.ouster.layouts import Layout
from robot_stack.drivers.ouster.metadata import Metadata
from robot_stack.drivers.ouster.packets import Packet

_BRIGHTEST: Final = 255  # of the contract; firmware before 2.1 counts on to 65535


class Frame:
    """W columns of H beams.

    steps: (W, H) ranges in the layout's steps, 0 without a return; reflectivity: (W, H); times_ns: (W,) by the sensor's
    clock; valid: (W,) columns that were measured.
    furthest: first column of the last packet in the frame; -1: none yet.
    """

    def __init__(self, metadata: Metadata, layout: Layout) -> None:
        columns, beams = metadata.columns_per_frame, metadata.pixels_per_column
        self._in_packet, self._mask = metadata.columns_per_packet, layout.pixel.range_mask
        self.steps: NDArray[np.uint32] = np.zeros((columns, beams), np.uint32)
        self.reflectivity: NDArray[np.uint8] = np.zeros((columns, beams), np.uint8)
        self.times_ns: NDArray[np.uint64] = np.zeros(columns, np.uint64)
        self.valid: NDArray[np.bool_] = np.zeros(columns, np.bool_)
        in_window = metadata.in_window(np.arange(columns))
        self._expected: NDArray[np.bool_] = np.asarray(in_window.reshape(-1, self._in_packet).any(axis=1))
        self._seen: NDArray[np.bool_] = np.zeros(len(self._expected), np.bool_)
        self.furthest = -1

    @property
    def packets(self) -> int:
        """Number of packets of a whole frame: those with columns in the window."""
        return int(self._expected.sum())

    def begin(self) -> None:
        self.valid[:] = False
        self._seen[:] = False
        self.furthest = -1

    def has(self, packet: Packet) -> bool:
        return bool(self._seen[packet.first // self._in_packet])

    def add(self, packet: Packet) -> None:
        at = slice(packet.first, packet.first + self._in_packet)
        pixels = packet.columns["pixels"]
        np.bitwise_and(pixels["range"], self._mask, out=self.steps[at])
        np.minimum(pixels["reflectivity"], _BRIGHTEST, out=self.reflectivity[at], casting="unsafe")
        self.times_ns[at], self.valid[at] = packet.times_ns, packet.valid
        self._seen[packet.first // self._in_packet] = True
        self.furthest = max(self.furthest, packet.first)

    @property
    def lost(self) -> int:
        """Packets that have not come."""
        return int((self._expected & ~self._seen).sum())

    @property
    def before_first(self) -> int:
        """Number of packets before the first received one."""
        seen = np.flatnonzero(self._seen)
        return int(self._expected[: seen[0]].sum()) if len(seen) else 0

    @property
    def spanned(self) -> float:
        """Span from the first to the last received packet, as a share of a whole frame's."""
        seen = np.flatnonzero(self._seen & self._expected)
        if not len(seen):
            return 0.0
        whole = np.flatnonzero(self._expected)
        return float(seen[-1] - seen[0] + 1) / float(whole[-1] - whole[0] + 1)

    def in_order(self) -> NDArray[np.int64]:
        """The measured columns in the order of time."""
        measured = np.flatnonzero(self.valid)
        order: NDArray[np.int64] = measured[np.argsort(self.times_ns[measured], kind="stable")]
        return order
