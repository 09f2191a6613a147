"""Which images belong together, and which of them are worth a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")

# Stamps that go back farther are a restarted clock, less are a late or repeated image.
_CLOCK_RESTART_S = 1.0


@dataclass(frozen=True, slots=True)
class Exposure(Generic[ItemT]):
    """One image: camera frame, time of exposure, time of reception (steady) and whatever goes with it."""

    camera: str
    stamp_s: float
    received_s: float
    item: ItemT


class ExposurePairs(Generic[ItemT]):
    """Images that wait for those of the other cameras, triggered at the same time. Each leaves once."""

    def __init__(self, cameras: tuple[str, ...], same_s: float, wait_s: float) -> None:
        """same_s: stamps of one exposure differ by less. wait_s: an image waits no longer."""
        self._cameras = cameras
        self._same_s = same_s
        self._wait_s = wait_s
        self._pending: dict[str, Exposure[ItemT]] = {}
        self._last_stamp_s: dict[str, float] = {}

    def add(self, exposure: Exposure[ItemT]) -> bool:
        """Takes an image; False if it is no newer than this camera's last."""
        last_s = self._last_stamp_s.get(exposure.camera)
        if last_s is not None and last_s - _CLOCK_RESTART_S < exposure.stamp_s <= last_s:
            return False
        self._last_stamp_s[exposure.camera] = exposure.stamp_s
        self._pending[exposure.camera] = exposure
        return True

    def take(self, now_s: float, alive: frozenset[str]) -> tuple[Exposure[ItemT], ...]:
        """The images of one exposure, in the cameras' order, once no other is worth waiting for; else nothing.

        alive: the cameras that are sending. An image that is left behind by a newer exposure of another camera goes
        with it: its own stamp tells its time.
        """
        if not self._pending:
            return ()
        waiting = self._pending.values()
        newest_s = max(item.stamp_s for item in waiting)
        complete = all(
            camera in self._pending and newest_s - self._pending[camera].stamp_s < self._same_s
            for camera in self._cameras
            if camera in alive
        )
        if not complete and now_s - min(item.received_s for item in waiting) < self._wait_s:
            return ()
        taken = tuple(self._pending[camera] for camera in self._cameras if camera in self._pending)
        self._pending.clear()
        return taken


class Attention:
    """Spends less on a camera without markers while another one sees some."""

    def __init__(self, idle_every: int) -> None:
        self._idle_every = idle_every
        self._since_seen: dict[str, int] = {}

    def wants(self, camera: str) -> bool:
        """True if this image of a camera shall be searched. Asked once for each image."""
        count = self._since_seen.get(camera, 0)
        self._since_seen[camera] = count + 1
        elsewhere = any(other != camera and since <= 1 for other, since in self._since_seen.items())
        return count < self._idle_every or not elsewhere or count % self._idle_every == 0

    def saw(self, camera: str) -> None:
        """The image of a camera showed a marker."""
        self._since_seen[camera] = 0

    def reset(self) -> None:
        self._since_seen.clear()
