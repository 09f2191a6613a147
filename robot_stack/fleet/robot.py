"""What the agent knows of the robot, from its topics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robot_stack.contract.states import MissionState
from robot_stack.core.geometry import Pose2, Twist2

FLEET = "fleet"
LOST = "LOCALIZATION_LOST"


@dataclass(frozen=True, slots=True)
class Queue:
    """/mission/queue. current: id of the order under way. waiting: ids. ended: state numbers by id.

    ready: ids of those waiting without an earliest time.
    """

    held_by: int
    reason: str
    current: str
    waiting: frozenset[str]
    ended: Mapping[str, int]
    paused_by: str
    ready: frozenset[str]

    def knows(self, order_id: str) -> bool:
        return order_id == self.current or order_id in self.waiting or order_id in self.ended


@dataclass(frozen=True, slots=True)
class MissionView:
    """/mission/status. completed: waypoints."""

    state: str
    mission_id: str
    completed: int
    reason: str

    @property
    def active(self) -> bool:
        return self.state in (MissionState.RUNNING, MissionState.WAITING, MissionState.PAUSED)


@dataclass(frozen=True, slots=True)
class Battery:
    """percent: state of charge [0, 100]."""

    percent: float
    voltage: float
    charging: bool


@dataclass(frozen=True, slots=True)
class Safety:
    """emergency: latched, or the button is pressed."""

    emergency: bool
    faults: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RobotView:
    """None and NaN: unknown. pose: in the map, while localization sends it. quality: of localization, [0, 1]."""

    pose: Pose2 | None = None
    quality: float = 0.0
    twist: Twist2 | None = None
    battery: Battery | None = None
    safety: Safety | None = None
    mission: MissionView | None = None
    queue: Queue | None = None
    loaded: bool = False

    @property
    def localized(self) -> bool:
        """The pose is there, and the safety monitor does not call it lost."""
        return self.pose is not None and (self.safety is None or LOST not in self.safety.faults)

    @property
    def mission_active(self) -> bool:
        return self.mission is not None and self.mission.active
