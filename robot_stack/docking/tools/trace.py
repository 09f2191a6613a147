"""The data of one docking in a recording. Times in s since the epoch of the recorder's clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from typing import Any, Protocol, TypeVar


@dataclass(frozen=True, slots=True)
class Status:
    """``/docking/status``: errors NaN where unknown."""

    at_s: float
    state: str
    error_m: float
    yaw_rad: float
    visible: int
    progress: float


@dataclass(frozen=True, slots=True)
class Marker:
    """One detection. stamp_s: exposure; position m and quaternion (x, y, z, w) in the camera's frame."""

    at_s: float
    stamp_s: float
    camera: str
    marker_id: int
    quality: float
    position_m: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Safety:
    at_s: float
    state: str
    faults: tuple[str, ...]
    emergency: bool


@dataclass(frozen=True, slots=True)
class Limit:
    """``/safety/velocity_limit``, in force until the next."""

    at_s: float
    linear_mps: float
    angular_radps: float
    reason: str


@dataclass(frozen=True, slots=True)
class Speed:
    at_s: float
    vx_mps: float
    vy_mps: float
    yaw_rate_radps: float


@dataclass(frozen=True, slots=True)
class Effort:
    """Largest absolute effort of all joints, Nm."""

    at_s: float
    largest_nm: float


@dataclass(frozen=True, slots=True)
class Shot:
    """A camera image at an event, as JPEG. at_s: the event, stamp_s: the exposure, why: the event in words."""

    at_s: float
    stamp_s: float
    camera: str
    why: str
    jpeg: bytes


@dataclass(frozen=True, slots=True)
class Lens:
    """``camera_info``: (3, 3) matrix by rows and distortion coefficients."""

    k: tuple[float, ...]
    d: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Spell:
    """A stretch of time in which a value stayed the same."""

    start_s: float
    end_s: float
    value: Any

    @property
    def duration_s(self) -> float:
        return self.end_s - self.start_s


@dataclass(slots=True)
class Trace:
    """One docking: from the first active state to the final one.

    before: state before the first, empty if the recording begins in the middle. after: the final state, empty
    if the recording ends before. seen: reception times of each source (a camera's frame, or the detector).
    """

    start_s: float
    before: str
    end_s: float = 0.0
    after: str = ""
    latched: bool = False
    statuses: list[Status] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)
    safety: list[Safety] = field(default_factory=list)
    limits: list[Limit] = field(default_factory=list)
    commanded: list[Speed] = field(default_factory=list)
    driven: list[Speed] = field(default_factory=list)
    efforts: list[Effort] = field(default_factory=list)
    seen: dict[str, list[float]] = field(default_factory=dict)
    lenses: dict[str, Lens] = field(default_factory=dict)
    shots: list[Shot] = field(default_factory=list)
    log: list[tuple[float, str, str]] = field(default_factory=list)

    def states(self) -> list[Spell]:
        """The states in order, without the one that ended it."""
        return [spell for spell in spells(self.statuses, lambda item: item.state, self.end_s) if spell.duration_s > 0.0]

    def camera(self) -> str:
        """Frame of the camera with most markers; empty without markers."""
        frames = [marker.camera for marker in self.markers]
        return max(sorted(set(frames)), key=frames.count, default="")


class _Timed(Protocol):
    @property
    def at_s(self) -> float: ...


TimedT = TypeVar("TimedT", bound=_Timed)


def spells(items: Sequence[TimedT], value: Callable[[TimedT], Any], end_s: float) -> list[Spell]:
    """Stretches of equal ``value``; each lasts until the next begins, the last until ``end_s``."""
    groups = [(key, next(group).at_s) for key, group in groupby(items, value)]
    ends = [*(at_s for _, at_s in groups[1:]), end_s]
    return [Spell(min(at_s, end_s), min(until, end_s), key) for (key, at_s), until in zip(groups, ends, strict=True)]


def silences(times_s: Sequence[float], start_s: float, end_s: float, longest_s: float) -> list[Spell]:
    """Stretches of [start_s, end_s] longer than ``longest_s`` without any of the times."""
    inside = sorted(time for time in times_s if start_s <= time <= end_s)
    edges = [start_s, *inside, end_s]
    return [Spell(before, after, None) for before, after in pairwise(edges) if after - before > longest_s]
