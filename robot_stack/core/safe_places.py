"""Places where the robot may stand with a passenger until help comes, ``config/safe_places.yaml``."""

from __future__ import annotations

from pydantic import field_validator

from robot_stack.core.config import Config
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Home, Name


class SafePlace(Home):
    """A named pose in the map. dock: only of a mission's home."""

    name: Name

    def __str__(self) -> str:
        return f"the {'charger' if self.dock else 'safe place'} {self.name!r}"


class SafePlaces(Config):
    """May be empty: then the robot stops where it is."""

    places: tuple[SafePlace, ...]

    @field_validator("places")
    @classmethod
    def _without_docks(cls, places: tuple[SafePlace, ...]) -> tuple[SafePlace, ...]:
        if any(place.dock for place in places):
            raise ValueError("a passenger cannot be docked to a charger: a safe place has no dock")
        return places

    def nearest(self, pose: Pose2) -> SafePlace | None:
        """By the straight line; None without places."""
        return min(self.places, key=lambda place: pose.distance_to(place.pose), default=None)
