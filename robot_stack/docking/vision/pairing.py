"""Pairs images of the cameras, and selects the images to search."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")

# Stamps that go back farther are a restarted clock, less are a late or repeated image.
_CLOCK_RESTART_S = 1.0


@dataclass(frozen=True, slots=True)
class Exposure(Generic[ItemT]):
    """One image: camera, time of exposure, time of reception (steady) and the result."""

    camera: str
    stamp_s: float
    received_s: float
    item: ItemT


class ExposureSets(Generic[ItemT]):
    """Collects one image of each camera; each image is returned once, or is replaced by its camera's next.

    One camera leads: its image waits only for others that are due. So images of cameras triggered together are returned
    together; with cameras at other phases the leading one's image is returned at once, with the newest others.
    """

    def __init__(self, cameras: tuple[str, ...], period_s: float, wait_s: float) -> None:
        """period_s: of the cameras. wait_s: longest wait of the leading camera's image."""
        self._cameras = cameras
        self._period_s = period_s
        self._wait_s = wait_s
        self._pending: dict[str, Exposure[ItemT]] = {}
        self._last_stamp_s: dict[str, float] = {}
        self._taken_s = -math.inf

    def is_new(self, camera: str, stamp_s: float) -> bool:
        """False for an image that is no newer than its camera's last."""
        last_s = self._last_stamp_s.get(camera)
        return last_s is None or not last_s - _CLOCK_RESTART_S < stamp_s <= last_s

    def add(self, exposure: Exposure[ItemT]) -> None:
        self._last_stamp_s[exposure.camera] = exposure.stamp_s
        self._pending[exposure.camera] = exposure

    def take(self, now_s: float, alive: frozenset[str], leading: str) -> tuple[Exposure[ItemT], ...]:
        """The images that leave now, in the cameras' order. alive: the cameras that are sending."""
        if not self._pending:
            return ()
        lead = self._pending.get(leading if leading in alive else next(iter(self._pending)))
        if lead is None:  # not dead yet: it is waited for only once
            due = now_s - self._taken_s >= self._period_s + self._wait_s
        else:
            due = alive <= self._pending.keys() or now_s - lead.received_s >= self._wait_s
        if not due:
            return ()
        taken = tuple(self._pending[camera] for camera in self._cameras if camera in self._pending)
        self._pending.clear()
        self._taken_s = now_s
        return taken


class Attention:
    """Selects the camera to search: the one with markers. Others are searched less often meanwhile."""

    def __init__(self, cameras: tuple[str, ...], idle_every: int) -> None:
        self._idle_every = idle_every
        self._cameras = cameras
        self.reset()

    def reset(self) -> None:
        self._without = dict.fromkeys(self._cameras, 0)
        self.leading = self._cameras[0]

    def uses(self, camera: str) -> bool:
        """True if this image of a camera shall be searched. Asked once for each image."""
        count = self._without[camera]
        self._without[camera] = count + 1
        elsewhere = any(other != camera and self._sees(other) for other in self._cameras)
        return count < self._idle_every or not elsewhere or count % self._idle_every == 0

    def saw(self, camera: str) -> None:
        """The image of a camera showed a marker."""
        self._without[camera] = 0
        if not self._sees(self.leading):
            self.leading = camera

    def _sees(self, camera: str) -> bool:
        # The image after the last with a marker may be on its approach_sign: one without does not count yet.
        return self._without[camera] <= 1
