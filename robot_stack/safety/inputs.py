"""The inputs of the safety monitor at one moment: the values of its conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from robot_stack.contract.model import Criticality, SafetyAction
from robot_stack.core.limits import SpeedLimit
from robot_stack.core.robot import Latch, SafetyEdge
from robot_stack.safety.button import Contact
from robot_stack.safety.collision_prediction import CollisionPrediction
from robot_stack.wmx.axes import StatusSnapshot


class Level(IntEnum):
    """Result of a condition."""

    CLEAR = 0
    UNKNOWN = 1  # cannot be judged: neither raises nor clears the row
    WAITING = 2  # not available yet, within the time allowed: stops the robot, latches nothing
    PRESENT = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """Finding of one condition.

    action: the requested one, NONE unless WAITING or PRESENT.
    limit: the speed limit of a LIMIT action.
    detail: one phrase for the log, the diagnostics and a refused reset.
    """

    level: Level
    action: SafetyAction = SafetyAction.NONE
    limit: SpeedLimit | None = None
    detail: str = ""


CLEAR, UNKNOWN = Finding(Level.CLEAR), Finding(Level.UNKNOWN)


@dataclass(frozen=True, slots=True)
class Axis:
    """State of one drive axis of the motion engine."""

    servo_on: bool
    amp_alarm: bool
    following_error: bool


@dataclass(frozen=True, slots=True)
class LatchReading:
    """The latch's two contacts, and whether its output commands it to open, in one engine cycle."""

    closed: bool
    open: bool
    opening: bool

    @property
    def confirmed(self) -> bool:
        """Closed, plausibly: not open at the same time."""
        return self.closed and not self.open

    @property
    def contradictory(self) -> bool:
        return self.closed and self.open

    def describe(self) -> str:
        return f"latch not confirmed closed: closed={int(self.closed)}, open={int(self.open)}"


@dataclass(frozen=True, slots=True)
class EdgeReading:
    """The inputs of the safety edge in one engine cycle.

    sides: those whose switch is open. relay_open: the relay with all sides in series is open.
    """

    sides: tuple[str, ...] = ()
    relay_open: bool = False

    @property
    def pressed(self) -> bool:
        """A switch or the relay is open, or one of their wires is cut."""
        return bool(self.sides) or self.relay_open

    def describe(self) -> str:
        """The phrase for a pressed edge. Sides and relay that disagree are a defect of the wiring."""
        if not self.sides:
            return "safety edge: relay open, no side pressed: check the relay and its wire"
        names = ", ".join(self.sides)
        if not self.relay_open:
            return f"safety edge: {names} open, relay closed: check the wire and the relay"
        return f"safety edge pressed: {names}: remove the contact"


@dataclass(frozen=True, slots=True)
class DriveReading:
    """One reading of the motion engine's status.

    cycle: a number that changes with every engine cycle: a status with a constant number is stale.
    axes: the robot's axes, index = axis number.
    button: contact of the emergency-stop button, an input of the engine.
    latch: contacts of the wheelchair's latch, inputs of the engine; None if they cannot be read.
    edge: switches of the safety edge, inputs of the engine; None if they cannot be read or there is no edge.
    """

    communicating: bool
    cycle: int
    axes: tuple[Axis, ...]
    button: Contact = Contact.UNREADABLE
    latch: LatchReading | None = None
    edge: EdgeReading | None = None


def latch_reading(status: StatusSnapshot, latch: Latch) -> LatchReading | None:
    """The latch's contacts at the inputs of the motion engine, None while they cannot be read."""
    if not status.communicating:
        return None
    return LatchReading(
        closed=status.input_bit(latch.byte, latch.closed_input_bit),
        open=status.input_bit(latch.byte, latch.open_input_bit),
        opening=status.output_bit(latch.byte, latch.open_output_bit),
    )


def edge_reading(status: StatusSnapshot, edge: SafetyEdge | None) -> EdgeReading | None:
    """The safety edge at the inputs of the motion engine, None without one or while they cannot be read.

    Normally closed: a cut wire reads as pressed.
    """
    if edge is None or not status.communicating:
        return None
    return EdgeReading(
        sides=tuple(side for side, bit in edge.side_bits.items() if not status.input_bit(edge.byte, bit)),
        relay_open=not status.input_bit(edge.byte, edge.relay_input_bit),
    )


def drive_reading(
    status: StatusSnapshot, button: Contact, latch: Latch, edge: SafetyEdge | None = None
) -> DriveReading:
    flags = zip(status.servo_on, status.amp_alarm, status.following_error_alarm, strict=True)
    axes = tuple(Axis(bool(on), bool(alarm), bool(error)) for on, alarm, error in flags)
    contacts = button, latch_reading(status, latch), edge_reading(status, edge)
    return DriveReading(status.communicating, status.cycle_counter, axes, *contacts)


@dataclass(frozen=True, slots=True)
class ImuSample:
    """Specific force in m/s2 and angular rate in rad/s, base_link."""

    ax: float
    ay: float
    az: float
    wx: float
    wy: float
    wz: float


@dataclass(frozen=True, slots=True)
class ProcessAge:
    """Seconds since the last heartbeat of an expected process, infinite if there was none."""

    criticality: Criticality
    age_s: float


@dataclass(frozen=True, slots=True)
class ComputerState:
    """The computer at one moment. NaN = unknown.

    cpu_high_for_s: for how long the processor has been above its limit without a break; 0 while it is not.
    """

    temperature_c: float
    cpu_percent: float
    cpu_high_for_s: float
    memory_percent: float
    disk_percent: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All inputs at one moment. Ages in s on the steady clock, infinite for missing or unusable ones.

    overspeed: judgement of the measured speed by the limits that were in force, made by ``OverspeedWatch``.
    joint_states_up: they have once been fresh for the whole settling time of the start-up.
    estop: phrase that names the sources of the stop, empty without any.
    contact: judgement of the safety edge, made by ``EdgeWatch``.
    chair_loose, latch_not_closed: judgement of the latch and the wheelchair on it, made by ``ChairWatch``.
    undocking: the limit while the robot undocks from a wheelchair that the latch does not hold, else None.
    docking: the limit while the robot moves into a dock, whose parts are no obstacles, else None.
    steering: judgement of commanded and measured headings, made by ``SteeringWatch``.
    drive: judgement of the drives, made by ``DriveWatch`` because it needs their history.
    inclination_rad: angle between base_link's z axis and the vertical, NaN = unknown.
    slope: judgement of the inclination and of the requested motions, made by ``SlopeWatch`` because it needs their
        history.
    quality: newest localization quality, [0, 1].
    pose_jump_m: largest distance between two consecutive poses since the last snapshot.
    battery: newest state of charge, [0, 1].
    latch_problem: why the latched stop and the passenger are not on disk, empty if they are.
    cameras: age of the newest image by the topic of its camera; empty unless a docking is guided by images.
    sight_age_s: age of the newest obstacle points; ``obstacles_age_s`` counts from the reception of their cloud.
    prediction: predicted contacts of the robot's motion; None while the obstacles are unknown.
    ehmi_silent_s, ui_silent_s: since the external display acknowledged, since a page of the touch screen was connected;
        None while the link is not monitored.
    """

    uptime_s: float
    estop: str
    contact: Finding
    chair_loose: Finding
    latch_not_closed: Finding
    undocking: SpeedLimit | None
    docking: SpeedLimit | None
    steering: Finding
    drive: Finding
    overspeed: Finding
    joint_states_up: bool
    joint_states_age_s: float
    joint_states_problem: str
    imu_age_s: float
    imu_problem: str
    inclination_rad: float
    slope: Finding
    pose_age_s: float
    pose_jump_m: float
    quality_age_s: float
    quality: float
    battery_age_s: float
    battery: float
    latch_problem: str
    processes: Mapping[str, ProcessAge]
    cameras: Mapping[str, float]
    lidar_age_s: float
    lidar_problem: str
    overhead_lidar_age_s: float
    overhead_lidar_problem: str
    obstacles_age_s: float
    obstacles_problem: str
    sight_age_s: float
    prediction: CollisionPrediction | None
    computer: ComputerState
    ehmi_silent_s: float | None
    ui_silent_s: float | None
