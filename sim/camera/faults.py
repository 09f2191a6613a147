"""What can go wrong with a simulated camera, on request: what ``/sim/inject_camera_fault`` may ask for."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from sim.camera.conditions import CLEAR, Conditions, Glare, Shadow

CLEAR_ALL = "clear"
# A deep shadow and its soft rim; a veil as bright as a low sun makes it.
_SHADOW_SOFTNESS_M = 0.02
_VEIL_DN = 30.0
_GLARE_PLACE = (0.35, 0.40)  # of the image's width and height


class CameraFaultRefused(Exception):
    """A fault that does not exist, or not with this target or value. The message says what would be accepted."""


@dataclass(frozen=True, slots=True)
class CameraFaultKind:
    """One row. of: what the target names. value: what it means, within low..high; default replaces 0."""

    name: str
    what: str
    of: Literal["camera", "marker"]
    value: str
    low: float
    high: float
    default: float


KINDS: tuple[CameraFaultKind, ...] = (
    CameraFaultKind("silent", "the camera sends nothing", "camera", "none", 0.0, 0.0, 0.0),
    CameraFaultKind("frozen", "the camera repeats its last picture with new stamps", "camera", "none", 0.0, 0.0, 0.0),
    CameraFaultKind("noisy", "the sensor is noisier", "camera", "factor", 1.0, 100.0, 6.0),
    CameraFaultKind("glare", "the sun shines into the lens", "camera", "radius of the bloom, px", 1.0, 1000.0, 120.0),
    CameraFaultKind("rain", "drops on the lens", "camera", "share of a lens full of them", 0.01, 1.0, 0.6),
    CameraFaultKind("shadow", "a shadow's edge across the boards", "camera", "share of light lost", 0.05, 1.0, 0.7),
    CameraFaultKind("blur", "out of focus, or a fogged lens", "camera", "standard deviation, px", 0.1, 30.0, 3.0),
    CameraFaultKind("dark", "poor light", "camera", "share of daylight", 0.001, 1.0, 0.02),
    CameraFaultKind("dirt", "dirt on a marker", "marker", "share of it that is dirty", 0.01, 1.0, 0.3),
    CameraFaultKind("cover", "a marker is covered", "marker", "none", 0.0, 0.0, 0.0),
)
BY_NAME = {kind.name: kind for kind in KINDS}


class CameraFaults:
    """The faults in force. cameras: their short names; markers: ids of all boards; size: height, width of pictures."""

    def __init__(self, cameras: Iterable[str], markers: Iterable[int], size: tuple[int, int]) -> None:
        self._targets = {"camera": tuple(cameras), "marker": tuple(str(marker) for marker in sorted(markers))}
        self._size = size
        self._active: dict[tuple[str, str], tuple[float, float]] = {}  # (kind, target) -> value, end

    def inject(self, kind: str, target: str, value: float, duration_s: float, now_s: float) -> str:
        """Raises a fault for ``duration_s`` (0: until cleared); returns what was done. Raises CameraFaultRefused.

        target: a camera or a marker id; empty: all of them. ``clear`` as the kind ends the faults of the kind that
        ``target`` names (``kind`` or ``kind:target``; empty: all).
        """
        if kind == CLEAR_ALL:
            return self._clear(target)
        row = BY_NAME.get(kind)
        if row is None:
            raise CameraFaultRefused(f"no camera fault {kind!r}; there are {', '.join(BY_NAME)} and {CLEAR_ALL}")
        accepted = self._targets[row.of]
        if target and target not in accepted:
            raise CameraFaultRefused(
                f"{kind}: target must be empty or a {row.of}: {', '.join(accepted)}; is {target!r}"
            )
        if not math.isfinite(duration_s) or duration_s < 0.0:
            raise CameraFaultRefused(f"{kind}: duration_s must be 0 or more, is {duration_s}")
        amount = value if value != 0.0 else row.default
        if not row.low <= amount <= row.high:
            raise CameraFaultRefused(f"{kind}: value ({row.value}) must be in {row.low:g}..{row.high:g}, is {value}")
        end_s = now_s + duration_s if duration_s > 0.0 else math.inf
        for one in (target,) if target else accepted:
            self._active[kind, one] = (amount, end_s)
        return f"{row.what}: {target or f'every {row.of}'}" + (f", {row.value} {amount:g}" if row.default else "")

    def active(self, now_s: float) -> tuple[tuple[str, str], ...]:
        """(kind, target) of every fault in force."""
        self._active = {key: (value, end_s) for key, (value, end_s) in self._active.items() if end_s > now_s}
        return tuple(self._active)

    def is_active(self, kind: str, camera: str, now_s: float) -> bool:
        return (kind, camera) in self.active(now_s)

    def conditions(self, camera: str, now_s: float) -> Conditions:
        """What a camera looks through now."""
        names = self.active(now_s)
        if not names:
            return CLEAR

        def value(kind: str, otherwise: float) -> float:
            return self._active.get((kind, camera), (otherwise, 0.0))[0]

        height, width = self._size
        radius, depth = value("glare", 0.0), value("shadow", 0.0)
        column, row = _GLARE_PLACE[0] * width, _GLARE_PLACE[1] * height
        return Conditions(
            illumination=value("dark", 1.0),
            shadow=Shadow(softness_m=_SHADOW_SOFTNESS_M, depth=depth) if depth else None,
            glare=Glare(column, row, radius, _VEIL_DN) if radius else None,
            rain=value("rain", 0.0),
            blur_px=value("blur", 0.0),
            noise_factor=value("noisy", 1.0),
            dirt={int(target): self._active[kind, target][0] for kind, target in names if kind == "dirt"},
            covered=frozenset(int(target) for kind, target in names if kind == "cover"),
        )

    def _clear(self, target: str) -> str:
        kind, _, which = target.partition(":")
        if kind and kind not in BY_NAME:
            raise CameraFaultRefused(f"no camera fault {kind!r}; there are {', '.join(BY_NAME)}")
        gone = [key for key in self._active if (not kind or key[0] == kind) and (not which or key[1] == which)]
        for key in gone:
            del self._active[key]
        return f"cleared: {', '.join(':'.join(key) for key in gone) or 'nothing'}"
