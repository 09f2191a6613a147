"""Tracking of moving objects: returns in places that were free a moment ago, tracked over views with a velocity.

A static object appears in a free place only by noise, odometry error or late detection: it appears and stays. So an
object counts as moving only after it was tracked over a distance, at a speed that exceeds its uncertainty, and has
left its former place. One ``MovingObjects`` per sensor: two sensors observe different sides of an object.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import Pose2
from robot_stack.perception.params import MovingObjectParams

Floats = NDArray[np.float64]
_SHOWN = 24  # points published per object
_MOST = 300  # largest number of evaluated cells: a dozen people beside the robot give fewer
NOTHING_MOVES: NDArray[np.float32] = np.empty((0, 5), np.float32)


@dataclass(frozen=True, slots=True)
class MovingBody:
    """In odom. x, y: m, of the middle of its visible points. vx, vy: m/s. sigma_m, sigma_mps: standard deviations along
    each axis. extent_m: of its visible points along x and y."""

    x: float
    y: float
    vx: float
    vy: float
    sigma_m: float
    sigma_mps: float
    extent_m: tuple[float, float]


@dataclass(slots=True)
class Track:
    """One object in odom: the centre of its visible points, m, and its velocity, m/s, at ``at_s``.

    count: of its recent returns. p11, p12, p22: covariance of place and velocity, equal along both axes.
    shape: (n, 3) points about the centre. before: its recent points in odom, with times. hid: since its last
    detection its predicted place was unobserved.
    """

    at_s: float
    seen_s: float
    since_s: float
    begin: tuple[float, float]
    x: float
    y: float
    shape: Floats
    p11: float
    p22: float
    p12: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    before: deque[tuple[float, Floats]] = field(default_factory=deque)
    count: float = 0.0
    moves: bool = False
    hid: bool = False

    def predict(self, now_s: float, acceleration_mps2: float) -> None:
        dt = now_s - self.at_s
        q = acceleration_mps2 * acceleration_mps2
        self.x, self.y = self.x + self.vx * dt, self.y + self.vy * dt
        self.p11 += dt * (2.0 * self.p12 + dt * self.p22) + 0.25 * q * dt**4
        self.p12 += dt * self.p22 + 0.5 * q * dt**3
        self.p22 += q * dt * dt
        self.at_s = now_s

    def correct(self, x: float, y: float, sigma_m: float) -> None:
        gain = self.p11 / (self.p11 + sigma_m**2), self.p12 / (self.p11 + sigma_m**2)
        dx, dy = x - self.x, y - self.y
        self.x, self.y = self.x + gain[0] * dx, self.y + gain[0] * dy
        self.vx, self.vy = self.vx + gain[1] * dx, self.vy + gain[1] * dy
        self.p22 -= gain[1] * self.p12
        self.p12 *= 1.0 - gain[0]
        self.p11 *= 1.0 - gain[0]

    @property
    def speed_mps(self) -> float:
        return math.hypot(self.vx, self.vy)

    @property
    def course(self) -> Floats:
        """(2,) unit vector of the velocity of a moving object."""
        return np.array([self.vx, self.vy]) / self.speed_mps

    def places(self, dt_s: float) -> list[tuple[float, float, float]]:
        """Its predicted centre and front after ``dt_s``, each with its height: a half hidden one returns little."""
        x, y, top_m = self.x + dt_s * self.vx, self.y + dt_s * self.vy, float(self.shape[:, 2].max())
        front = self.shape[np.argmax(self.shape[:, :2] @ np.array([self.vx, self.vy]))]
        return [(x, y, top_m), (x + float(front[0]), y + float(front[1]), top_m)]

    def ends_m(self, body: Floats) -> tuple[float, float]:
        """Offsets of its observed rear and front against the prediction, along its course."""
        seen = (body[:, :2] - (self.x, self.y)) @ self.course
        own = self.shape[:, :2] @ self.course
        return float(seen.min() - own.min()), float(seen.max() - own.max())

    def by_one_end(self, body: Floats) -> tuple[float, float]:
        """Its centre by the end, front or rear, whose observation is nearer to the prediction.

        The other end is observed too short or too long: a front gets hidden, a rear merges with a static object,
        another person is beside it."""
        ahead_m = min(self.ends_m(body), key=abs)
        return self.x + ahead_m * float(self.course[0]), self.y + ahead_m * float(self.course[1])

    def go_by_one_end(self, body: Floats, sigma_m: float) -> None:
        """Corrects the track by its nearer end along the course and by the body's centre across it, then moves it to
        that centre without a change of velocity."""
        middle, aside = body[:, :2].mean(axis=0), np.array([-self.course[1], self.course[0]])
        came = self.by_one_end(body) + float((middle - (self.x, self.y)) @ aside) * aside
        self.correct(float(came[0]), float(came[1]), sigma_m)
        self.x, self.y = self.x + float(middle[0] - came[0]), self.y + float(middle[1] - came[1])
        self.shape = body[:, :3] - (*middle, 0.0)

    def stand_in(self, x: float, y: float, body: Floats, sigma_m: float) -> None:
        """Moves the track to other points of the object; the velocity does not change."""
        self.x, self.y, self.p11, self.p12 = x, y, sigma_m * sigma_m, 0.0
        self.shape = body[:, :3] - (x, y, 0.0)
        self.before.clear()


class MovingObjects:
    """Call with new returns (``Space.appeared``) of every view of one sensor. Stamps in s, one clock, odom."""

    def __init__(self, params: MovingObjectParams) -> None:
        self._params = params
        self._tracks: list[Track] = []

    def forget(self) -> None:
        self._tracks.clear()

    def look(
        self,
        points: Floats,
        stamp_s: float,
        is_visible: Callable[[float, float, float], bool],
        seen_at_s: Callable[[float, float], float] | None = None,
    ) -> list[tuple[Floats, float, float]]:
        """points: (n, 5) from ``Space.appeared``. is_visible: whether rays pass at x, y in odom below a height.
        seen_at_s: when the sensor last looked at a place in odom; None: at the stamp.

        Returns objects that disappeared into unobserved space: (n, 3) points at their last place, vx, vy."""
        p = self._params
        there, lost = list[Track](), list[Track]()
        for track in self._tracks:
            missed_s, dt = stamp_s - track.seen_s, stamp_s - track.at_s
            gone = False
            if missed_s > p.missed_s:
                gone = all(is_visible(*place) for place in track.places(dt))
                if gone and not track.hid:
                    continue  # stopped, or moved elsewhere
                track.hid = True
            (there if 0.0 <= missed_s <= p.coast_s and not gone else lost).append(track)
        self._tracks = there
        for track in self._tracks:
            track.predict(stamp_s, p.acceleration_mps2)
        at_s = seen_at_s or (lambda x, y: stamp_s)
        bodies = [(body, at_s(*_middle(body))) for body in self._bodies(points)]
        for body, body_s, nearest in self._matched(bodies):
            x, y = _middle(body)
            if nearest is not None:
                nearest.predict(body_s, p.acceleration_mps2)
                nearest.seen_s, nearest.hid = body_s, False
                before, count = nearest.count, float(body[:, 4].sum())
                nearest.count = max(0.9 * before, count)
                if nearest.moves and self._goes_out_of_sight(nearest, body, is_visible):
                    rear_m, front_m = nearest.ends_m(body)
                    if front_m >= min(rear_m, 0.0):  # else it gets hidden, and keeps its velocity
                        self._follow_one_end(nearest, body)
                    continue
                if count < p.whole * before:  # mostly hidden: the centre of the rest is no measurement
                    nearest.correct(x, y, p.place_sigma_m + 0.5 * _width_m(nearest.shape))
                    continue
                if p.whole * count > before:  # merged with another object: the common centre is elsewhere
                    nearest.stand_in(x, y, body, p.place_sigma_m)
                    continue
                apart_m = abs(np.subtract(*nearest.ends_m(body))) if nearest.moves else 0.0
                if apart_m > p.link_m:
                    self._follow_one_end(nearest, body)
                    continue
                less, more = sorted((before, count))
                sigma_m = p.place_sigma_m + 0.5 * (1.0 - less / more) * _width_m(body)
                if apart_m > 2.0 * p.place_sigma_m:
                    nearest.go_by_one_end(body, sigma_m)
                    nearest.moves = self._moves(nearest)  # its own rear may cover the places that it left
                    continue
                nearest.correct(x, y, sigma_m)
                nearest.shape = body[:, :3] - (x, y, 0.0)
                nearest.moves = self._moves(nearest) and self._has_left(nearest, body[:, :2])
            elif body[:, 3] @ body[:, 4] >= p.points_min:  # returns in unseen cells only may be static
                shape, sigma_m = body[:, :3] - (x, y, 0.0), p.place_sigma_m
                begin = (x, y)
                track = Track(body_s, body_s, body_s, begin, x, y, shape, sigma_m**2, p.fastest_mps**2 / 4.0)
                track.count = float(body[:, 4].sum())
                self._tracks.append(track)
        return [(self._points(track, track.seen_s)[:, :3], track.vx, track.vy) for track in lost if track.moves]

    def _matched(self, bodies: list[tuple[Floats, float]]) -> list[tuple[Floats, float, Track | None]]:
        """Assigns each body, with its time, to a track or None: of all pairs within the gate, nearest first."""
        pairs = list[tuple[float, int, int]]()
        for i, (body, body_s) in enumerate(bodies):
            x, y = _middle(body)
            for j, track in enumerate(self._tracks):
                dt = body_s - track.at_s
                gap_m = math.hypot(track.x + dt * track.vx - x, track.y + dt * track.vy - y)
                if gap_m <= self._params.gate_m:
                    pairs.append((gap_m, i, j))
        found, taken = dict[int, Track](), set[int]()
        for _, i, j in sorted(pairs):
            if i not in found and j not in taken:
                found[i] = self._tracks[j]
                taken.add(j)
        return [(*body, found.get(i)) for i, body in enumerate(bodies)]

    def follows(self, x_m: float, y_m: float, stamp_s: float) -> bool:
        """True if the place in odom may be part of a moving object that is tracked or predicted at the stamp."""
        reach_m = 0.5 * self._params.widest_m
        return any(
            track.moves and math.hypot(x - x_m, y - y_m) <= reach_m
            for track in self._tracks
            for x, y, _ in track.places(stamp_s - track.at_s)[:1]
        )

    def bodies(self, stamp_s: float) -> list[MovingBody]:
        """Moving objects that were detected within the last ``missed_s``, predicted to the stamp."""
        found = list[MovingBody]()
        for track in self._tracks:
            if track.moves and abs(stamp_s - track.seen_s) <= self._params.missed_s:
                now = replace(track)
                now.predict(stamp_s, self._params.acceleration_mps2)
                width_m, depth_m = np.ptp(track.shape[:, :2], axis=0).tolist()
                sigma_m, sigma_mps = math.sqrt(max(now.p11, 0.0)), math.sqrt(max(now.p22, 0.0))
                found.append(MovingBody(now.x, now.y, now.vx, now.vy, sigma_m, sigma_mps, (width_m, depth_m)))
        return found

    def at(self, stamp_s: float, pose: Pose2) -> NDArray[np.float32]:
        """(n, 5) x, y, z, vx, vy in base_link at ``pose``, m, m/s: points of moving objects, predicted to the stamp."""
        found = [self._points(track, stamp_s) for track in self._tracks if track.moves and self._there(track, stamp_s)]
        if not found:
            return NOTHING_MOVES
        rows, (c, s) = np.concatenate(found), (math.cos(pose.yaw), math.sin(pose.yaw))
        dx, dy, vx, vy = rows[:, 0] - pose.x, rows[:, 1] - pose.y, rows[:, 3], rows[:, 4]
        turned = [c * dx + s * dy, c * dy - s * dx, rows[:, 2], c * vx + s * vy, c * vy - s * vx]
        return np.stack(turned, axis=1).astype(np.float32)

    def _there(self, track: Track, stamp_s: float) -> bool:
        return -self._params.coast_s <= stamp_s - track.seen_s <= self._params.coast_s

    def _points(self, track: Track, stamp_s: float) -> Floats:
        """(n, 5) odom."""
        dt = stamp_s - track.at_s
        shape = track.shape[:: len(track.shape) // _SHOWN + 1]
        rows = np.empty((len(shape), 5))
        rows[:, :3] = shape + np.array([track.x + dt * track.vx, track.y + dt * track.vy, 0.0])
        rows[:, 3:] = track.vx, track.vy
        return rows

    def _moves(self, track: Track) -> bool:
        p, speed_mps = self._params, track.speed_mps
        followed = track.at_s - track.since_s >= p.follow_s
        gone = math.hypot(track.x - track.begin[0], track.y - track.begin[1]) >= p.distance_m
        doubt_mps = 0.0 if track.moves else p.sure * math.sqrt(track.p22)  # a hidden part shows a lower speed
        sure = speed_mps >= max(p.slowest_mps, doubt_mps)
        return followed and (gone or track.moves) and sure and speed_mps <= p.fastest_mps

    def _has_left(self, track: Track, places: Floats) -> bool:
        """True if it has left its former place: a wall's end coming into view seems to move, but is still there."""
        p, before = self._params, track.before
        before.append((track.at_s, places))
        while before[0][0] < track.at_s - p.vacated_s:
            before.popleft()
        since_s, was = before[0]
        gaps = np.hypot(*(was[:, None] - places).transpose(2, 0, 1)).min(axis=1)
        still = float(np.mean(gaps <= p.same_m))
        if still <= p.vacated_share or not track.moves:
            return still <= p.vacated_share
        # A long object partly overlaps its former place: half of what its motion would vacate must be vacated.
        way_m = (track.at_s - since_s) * track.speed_mps - p.same_m
        if way_m < 2.0 * p.same_m:
            return True  # not decidable yet
        left = min(way_m / max(float(np.ptp(was @ track.course)), p.same_m), 1.0)
        return still <= 1.0 - left * (1.0 - p.vacated_share)

    def _follow_one_end(self, track: Track, body: Floats) -> None:
        track.correct(*track.by_one_end(body), 0.5 * self._params.link_m)
        track.moves = track.speed_mps >= self._params.slowest_mps

    def _goes_out_of_sight(self, track: Track, body: Floats, is_visible: Callable[[float, float, float], bool]) -> bool:
        """True if its front would be hidden a little farther on: then the observed front does not move with it."""
        front = int(np.argmax(body[:, :2] @ track.course))
        x, y = body[front, :2] + self._params.link_m * track.course
        return not is_visible(float(x), float(y), float(body[:, 2].max()))

    def _bodies(self, points: Floats) -> list[Floats]:
        p = self._params
        points = points[:_MOST]
        labels = np.full(len(points), -1, np.int64)
        count = _clusters(points, p.link_m, labels)
        bodies = [points[labels == number] for number in range(count)]
        return [body for body in bodies if body[:, 4].sum() >= p.points_min and _width_m(body) <= p.widest_m]


def _middle(body: Floats) -> tuple[float, float]:
    x, y = (float(value) for value in body[:, :2].mean(axis=0))
    return x, y


def _width_m(body: Floats) -> float:
    """Diagonal of the axis-aligned rectangle around it."""
    return float(np.hypot(*np.ptp(body[:, :2], axis=0)))


@compiled
def _clusters(points: Floats, link_m: float, labels: Any) -> int:
    """Labels the points (n, 3) by connected cluster in plan. Returns the number of clusters."""
    stack = np.empty(len(points), np.int64)
    count = 0
    for first in range(len(points)):
        if labels[first] >= 0:
            continue
        labels[first], stack[0], left = count, first, 1
        while left:
            left -= 1
            i = stack[left]
            for j in range(len(points)):
                if labels[j] < 0:
                    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                    if dx * dx + dy * dy <= link_m * link_m:
                        labels[j], stack[left] = count, j
                        left += 1
        count += 1
    return count
