"""Set-up of one run of the simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2
from sim.plant.robot_model import GRAVITY_MPS2
from sim.worldfile import WorldFile


@dataclass(frozen=True, slots=True)
class Setup:
    """Set-up of one run: the world file, the seed, the robot's start, and the wheelchair.

    wheelchair: a wheelchair is in the model, invisible if it has no place, and can be attached.
    wheelchair_pose: its place instead of the world file's (frame of its dock, in map).
    passenger_mass_kg: a passenger in it; attached_at_start latches it to the robot from the start.
    people: the world file's people are present.
    slope_rad: the whole ground is inclined and rises towards slope_direction_rad in map; map's z stays square to it.
    """

    world: WorldFile
    seed: int
    start: Pose2
    wheelchair: bool = False
    attached_at_start: bool = False
    passenger_mass_kg: float = 0.0
    wheelchair_pose: Pose2 | None = None
    slope_rad: float = 0.0
    slope_direction_rad: float = 0.0
    people: bool = False

    def wheelchair_place(self) -> Pose2 | None:
        """Place of the wheelchair at the start, if not on the latch."""
        own = self.world.wheelchair
        return self.wheelchair_pose or (None if own is None else own.pose())

    def has_wheelchair(self) -> bool:
        return self.wheelchair or self.attached_at_start or self.wheelchair_place() is not None

    def gravity_mps2(self) -> tuple[float, float, float]:
        """In map. Raises ValueError for an invalid slope."""
        if not abs(self.slope_rad) < 0.5 * math.pi or not math.isfinite(self.slope_direction_rad):
            raise ValueError(f"slope_rad must be within +-90 deg, is {self.slope_rad}, {self.slope_direction_rad}")
        along = -GRAVITY_MPS2 * math.sin(self.slope_rad)
        x, y = math.cos(self.slope_direction_rad), math.sin(self.slope_direction_rad)
        return along * x, along * y, -GRAVITY_MPS2 * math.cos(self.slope_rad)

    def inclination_wxyz(self) -> tuple[float, float, float, float]:
        """Turns map into a frame whose z is upright."""
        half, direction = 0.5 * self.slope_rad, self.slope_direction_rad
        return math.cos(half), math.sin(half) * math.sin(direction), -math.sin(half) * math.cos(direction), 0.0
