"""The robot's state in the node, as plain values. None: never received, or stale."""

from __future__ import annotations

from dataclasses import dataclass, field

from robot_stack.core.geometry import Pose2


@dataclass(frozen=True, slots=True)
class Safety:
    """As in /safety/status. obstacle_m: +inf nothing detected, NaN unknown."""

    state: str
    faults: tuple[str, ...]
    obstacle_m: float
    pressed: bool


@dataclass(frozen=True, slots=True)
class Limit:
    """As in /safety/velocity_limit."""

    linear_mps: float
    angular_radps: float
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Ride:
    """As in /mission/status."""

    state: str
    mission_id: str
    waypoint: str
    completed: int
    total: int
    progress: float
    eta_s: float
    passenger: bool
    reason: str
    last_command: str
    accepted: bool


@dataclass(frozen=True, slots=True)
class Order:
    """earliest_s: Unix time, 0 = at once. open: its route may be extended."""

    id: str
    mission_id: str
    origin: str
    priority: int
    earliest_s: float
    open: bool = False


@dataclass(frozen=True, slots=True)
class Queue:
    """As in /mission/queue. held_by: name of a member of ``HeldBy``; current: the order under way.

    paused_by: origin that paused it and may resume it, empty if there is none.
    """

    held_by: str
    reason: str
    orders: tuple[Order, ...]
    current: Order | None
    paused_by: str = ""


@dataclass(frozen=True, slots=True)
class Docking:
    """As in /docking/status."""

    state: str
    position_m: float
    yaw_rad: float
    markers: int
    progress: float


@dataclass(frozen=True, slots=True)
class Marker:
    """One of /docking/aruco_detections: where it is in its camera's frame, m."""

    marker_id: int
    camera: str
    quality: float
    x_m: float
    y_m: float
    z_m: float


@dataclass(frozen=True, slots=True)
class Person:
    """One of /navigation/people: kind (walking, person, object), in map, m, m/s; only a walking one has a speed."""

    kind: str
    x_m: float
    y_m: float
    radius_m: float
    vx_mps: float = 0.0
    vy_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class ExternalDisplay:
    """As in /ehmi/status: state is the last one acknowledged by the display, None before any."""

    linked: bool
    state: int | None
    fault: str


@dataclass(frozen=True, slots=True)
class Computer:
    """From /robot_status; NaN unknown."""

    cpu_pct: float
    memory_pct: float
    disk_pct: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """battery: charge [0, 1], NaN unknown. speed: (m/s, rad/s) commanded to the wheels. quality: of the pose [0, 1].

    plan: (x, y) in map, m. emergency_stop: from the first /emergency_stop true until both keys have released it.
    door: name and ``DoorPhase`` of the one for which the robot waits.
    """

    safety: Safety | None = None
    limit: Limit | None = None
    ride: Ride | None = None
    queue: Queue | None = None
    docking: Docking | None = None
    computer: Computer | None = None
    display: ExternalDisplay | None = None
    pose: Pose2 | None = None
    quality: float | None = None
    battery: float | None = None
    speed: tuple[float, float] | None = None
    plan: tuple[tuple[float, float], ...] = ()
    navigation: str = ""
    door: tuple[str, int] | None = None
    markers: tuple[Marker, ...] = ()
    people: tuple[Person, ...] = ()
    emergency_stop: bool = False
    staff_called: bool = False
    driven_by_hand: bool = False
    missing: tuple[str, ...] = field(default=())
