"""Inputs of the docking controller at a tick, and its outputs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from robot_stack.contract.states import DockingState
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.goals import SendGoal
from robot_stack.docking.latch import LatchCommand, LatchInputs
from robot_stack.docking.results import Failure, Result
from robot_stack.docking.states import Trigger
from robot_stack.docking.target import Estimate


@dataclass(frozen=True, slots=True)
class Safety:
    """The safety monitor's state. stopped: no motion is allowed, without being an emergency."""

    known: bool = False
    emergency: bool = False
    stopped: bool = False
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Situation:
    """Inputs at one tick.

    now_s: ROS time. located: base_link in map, None while stale. odom, twist: base_link in odom now and its velocity,
    None while /odom is stale. images_fresh: detections arrive, from new images. force_n: the wheels' force
    along base_link's x. navigation_served: a server offers navigate_to_pose. charging: the battery is
    being charged, or is full; False while unknown.
    """

    now_s: float
    located: Pose2 | None = None
    odom: Pose2 | None = None
    twist: Twist2 | None = None
    safety: Safety = field(default_factory=Safety)
    images_fresh: bool = False
    latch: LatchInputs = field(default_factory=LatchInputs)
    force_n: float = math.nan
    navigation_served: bool = False
    charging: bool = False


@dataclass(frozen=True, slots=True)
class View:
    """A situation as input of a phase.

    base: base_link in the frame of the dock pose by the present estimate, None without one or without odometry.
    seen_ago_s: since the image of the last accepted sighting. sightings: the dock in base_link, accepted since the
    phase began, oldest first. board: the dock in base_link in the newest image, None without a recent one.
    moved: the dock was found elsewhere. approach_sign: +1 docks forwards, -1 backwards. docked_m: from the dock's
    origin to base_link when docked. commanded: the last command, base_link.
    """

    situation: Situation
    dt_s: float
    base: Pose2 | None
    estimate: Estimate | None
    seen_ago_s: float
    sightings: Sequence[Pose2]
    board: Pose2 | None
    moved: bool
    approach_sign: float
    docked_m: float
    commanded: Twist2


@dataclass(frozen=True, slots=True)
class Step:
    """Output of a phase.

    twist: command in base_link; None: docking does not own the motion. trigger: the phase is over. failure: why, for
    TRY_FAILED and GAVE_UP. goal: for navigation, to send now. latch: outputs.
    """

    text: str
    twist: Twist2 | None = None
    trigger: Trigger | None = None
    failure: Failure | None = None
    goal: SendGoal | None = None
    latch: LatchCommand = LatchCommand.HOLD


@dataclass(frozen=True, slots=True)
class Output:
    """One tick of the controller.

    attached: content of /passenger_attached; None while unknown. goal: for navigation, to send now. cancel_goal: to
    cancel now. result: of the docking or undocking that has just ended. emergency: the robot must stop for good.
    """

    state: DockingState
    text: str
    twist: Twist2 | None
    latch: LatchCommand
    attached: bool | None
    position_error_m: float
    yaw_error_rad: float
    progress: float
    tries: int
    distance_m: float = 0.0
    goal: SendGoal | None = None
    cancel_goal: bool = False
    result: Result | None = None
    emergency: bool = False
