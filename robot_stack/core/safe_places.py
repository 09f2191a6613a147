"""Places where the robot may stand with a passenger until help comes, ``config/safe_places.yaml``."""

from __future__ import annotations

from robot_stack.core.config import Config
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Name, Spot


class SafePlace(Spot):
    """A named pose in the map."""

    name: Name


class SafePlaces(Config):
    """May be empty: then the robot stops where it is."""

    places: tuple[SafePlace, ...]

    def nearest(self, pose: Pose2) -> SafePlace | None:
        """By the straight line; None without places."""
        return min(self.places, key=lambda place: pose.distance_to(place.pose), default=None)
