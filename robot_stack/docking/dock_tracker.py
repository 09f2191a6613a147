"""Fuses sightings and odometry into the dock's estimated pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.docks import Dock
from robot_stack.core.geometry import Pose2
from robot_stack.core.pose_history import PoseHistory
from robot_stack.docking.dock_calibration import Correction
from robot_stack.docking.params import TargetParams
from robot_stack.docking.sighting import Marker, Sighting, sighting
from robot_stack.docking.target import DockTarget, Estimate, Seen


class DockTracker:
    """Tracks one dock at a time. mountings: (4, 4) optical frame in base_link by camera frame."""

    def __init__(self, params: TargetParams, mountings: Mapping[str, NDArray[np.float64]]) -> None:
        self._mountings = mountings
        self._target = DockTarget(params)
        self._odometry = PoseHistory(params.history_s)
        self._dock: Dock | None = None
        self._correction = Correction()
        self._newest_s = -math.inf
        self._newest: Pose2 | None = None
        self._count_from_s = -math.inf
        self._uncorrected: list[Pose2] = []
        self._early: Sighting | None = None
        self.seen_s = -math.inf
        self.moved = False
        self.visible_markers = 0

    def look_for(self, dock: Dock | None, correction: Correction) -> None:
        """Starts a new job without earlier sightings. dock: None if it is unknown. correction: see dock_calibration."""
        self._dock, self._correction = dock, correction
        self.visible_markers = 0
        self.forget()

    def forget(self) -> None:
        """The estimate restarts with the next sighting."""
        self._target.forget()
        self._early = None
        self.moved = False
        self.seen_s = -math.inf

    def count_from(self, stamp_s: float) -> None:
        """``sightings`` are those of images since then."""
        self._count_from_s = stamp_s
        self._uncorrected = []

    @property
    def sightings(self) -> list[Pose2]:
        """The measured dock in base_link in the images since ``count_from``, without the correction."""
        return self._uncorrected

    def board(self, now_s: float, within_s: float) -> Pose2 | None:
        """The dock in base_link in the newest image, independent of the estimate; None if that is older."""
        return self._newest if now_s - self._newest_s <= within_s else None

    @property
    def estimate(self) -> Estimate | None:
        return self._target.estimate

    def dock_pose_in_odom(self) -> Pose2 | None:
        """The docked pose of base_link in odom, None before the first sighting of the dock."""
        estimate = self._target.estimate
        if estimate is None or self._dock is None:
            return None
        return estimate.pose.compose(self._dock.dock_pose.pose())

    def on_odometry(self, stamp_s: float, pose: Pose2) -> None:
        """Adds base_link in odom, which must be finite."""
        before = self._odometry.newest
        if self._odometry.is_set_back(stamp_s):  # another history begins
            self._odometry.clear()
            before, self._newest_s = None, -math.inf
            self.seen_s, self._count_from_s = min(self.seen_s, stamp_s), min(self._count_from_s, stamp_s)
        if self._odometry.add(stamp_s, pose) and before is not None:
            self._target.drive(pose.relative_to(before.pose))
        early, self._early = self._early, None
        if early is not None:
            self._see(early)

    def on_markers(self, markers: Sequence[Marker]) -> None:
        """Adds the markers of all cameras' newest images."""
        if self._dock is None:
            return
        frame = self._dock.camera_frame
        own = [item for item in markers if item.camera_frame == frame]
        seen = sighting(own, self._dock, self._mountings[frame])
        self.visible_markers = 0 if seen is None else seen.markers
        if seen is not None and seen.stamp_s > self._newest_s:
            self._see(seen)

    def _see(self, seen: Sighting) -> None:
        base = self._odometry.at(seen.stamp_s)
        if base is None:
            newest = self._odometry.newest
            # A fast detector is ahead of the odometry: the sighting waits for the reading of its time.
            self._early = seen if newest is None or seen.stamp_s > newest.stamp_s else None
            return
        self._newest_s, self._newest = seen.stamp_s, seen.dock
        verdict = self._target.see(replace(seen, dock=self._correction.apply(seen.dock)), base)
        self.moved = self.moved or verdict is Seen.MOVED
        if verdict is Seen.ACCEPTED:
            self.seen_s = seen.stamp_s
            if seen.stamp_s >= self._count_from_s:
                self._uncorrected.append(seen.dock)
