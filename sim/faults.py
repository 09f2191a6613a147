"""The faults that a simulation can suffer, one row each: what ``/sim/inject_fault`` and scenarios may ask for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from robot_stack.contract.frames import DRIVE_AXES, JOINTS
from robot_stack.core.geometry import Pose2
from sim.simulation import Simulation
from sim.surface import Area

CLEAR = "clear"
DEFAULT_ALARM_CODE = 0x4210  # CiA 402: excess temperature of the device
DEFAULT_PATCH_SIZE_M = 2.0
LARGEST_SHIFT_M, LARGEST_CARRY_M = 5.0, 100.0
DRIVE_JOINTS = tuple(JOINTS[axis] for axis in DRIVE_AXES)
ONLY = ("",)  # a kind with one target, which needs no name


class FaultRefused(Exception):
    """A fault that does not exist, or not with this target or value. The message says what would be accepted."""


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One row.

    what: in words; targets: names accepted as target, None for free text that ``change`` judges.
    value: what the value means, bounded by low and high; ``default`` replaces 0 where 0 means nothing.
    change: raises the fault with a value, ends it with None; returns what it did in words.
    lasts: until it is cleared; otherwise it happens once and there is nothing to clear.
    """

    name: str
    what: str
    targets: tuple[str, ...] | None
    value: str
    change: Callable[[Simulation, str, float | None], str]
    low: float = 0.0
    high: float = 0.0
    default: float = 0.0
    lasts: bool = True


@dataclass(frozen=True, slots=True)
class ActiveFault:
    """A fault in force; ``until_s`` is simulated time, infinite for one that waits to be cleared."""

    kind: str
    target: str
    until_s: float


def _drive_alarm(sim: Simulation, target: str, value: float | None) -> str:
    code = int(value or 0)
    sim.world.drives.set_alarm(JOINTS.index(target), code)
    return f"drive of {target} reports alarm 0x{code:04X}"


def _bus_loss(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.drives.set_bus(value is None)
    return "the fieldbus is cut"


def _encoder_freeze(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.drives.set_encoder_frozen(JOINTS.index(target), value is not None)
    return f"encoder of {target} repeats its last count"


def _slip(sim: Simulation, target: str, value: float | None) -> str:
    for wheel in (DRIVE_JOINTS.index(target),) if target else range(len(DRIVE_JOINTS)):
        sim.world.surface.set_wheel(wheel, value)
    return f"friction {value} under {target or 'every wheel'}"


def _slip_patch(sim: Simulation, target: str, value: float | None) -> str:
    if value is None:
        sim.world.surface.remove_area(f"fault {target}")
        return ""
    area = _area(sim, target, value)
    sim.world.surface.add_area(f"fault {target}", area)
    size = f"{2 * area.half_length_m:g} x {2 * area.half_width_m:g} m"
    return f"friction {value:g} on {size} of ground around ({area.x_m:.2f}, {area.y_m:.2f})"


def _area(sim: Simulation, target: str, friction: float) -> Area:
    """The rectangle named by ``x,y,length,width``, or one ahead of the robot."""
    if not target:
        pose = sim.world.truth().pose()
        half = 0.5 * DEFAULT_PATCH_SIZE_M
        middle = pose.compose(Pose2(half, 0.0, 0.0))
        return Area(middle.x, middle.y, pose.yaw, half, half, friction)
    try:
        x, y, length, width = (float(part) for part in target.split(","))
    except ValueError:
        raise FaultRefused(f"slip_patch: target must be empty or 'x,y,length,width' in m, is {target!r}") from None
    if not all(map(math.isfinite, (x, y))) or not 0.0 < length < 1e4 or not 0.0 < width < 1e4:
        raise FaultRefused(f"slip_patch: target must be a place and two sizes above 0 m, is {target!r}")
    return Area(x, y, 0.0, 0.5 * length, 0.5 * width, friction)


def _imu_silent(sim: Simulation, target: str, value: float | None) -> str:
    sim.imu.silent = value is not None
    return "the inertial unit is silent"


def _imu_frozen(sim: Simulation, target: str, value: float | None) -> str:
    sim.imu.frozen = value is not None
    return "the inertial unit repeats its last values"


def _imu_noise(sim: Simulation, target: str, value: float | None) -> str:
    sim.imu.noise_factor = 1.0 if value is None else value
    return f"noise of the inertial unit {value} times its own"


def _estop_button(sim: Simulation, target: str, value: float | None) -> str:
    pressed = value is not None and value > 0.5
    sim.world.drives.set_estop_pressed(pressed)
    return f"emergency stop button {'pressed' if pressed else 'released'}"


def _engine_stall(sim: Simulation, target: str, value: float | None) -> str:
    sim.engine_stalled = value is not None
    return "the motion engine stands still"


def _wheelchair(sim: Simulation, target: str, value: float | None) -> str:
    if value is None:
        sim.world.detach_wheelchair()
        return ""
    try:
        sim.world.attach_wheelchair(value)
    except ValueError as error:
        raise FaultRefused(f"wheelchair: {error}") from None
    return f"wheelchair latched, passenger of {value:g} kg"


def _latch_stuck(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.latch.stuck = value is not None
    return "the latch does not move"


def _latch_no_confirm(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.latch.set_no_confirm(value is not None)
    return "the latch never says that it is closed"


def _latch_opens(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.latch.fail_open(value is not None)
    return "the latch has let go"


def _chair_moved(sim: Simulation, target: str, value: float | None) -> str:
    return _moved("chair_moved", "wheelchair", sim.world.move_wheelchair, target, LARGEST_SHIFT_M)


def _robot_moved(sim: Simulation, target: str, value: float | None) -> str:
    return _moved("robot_moved", "robot", sim.world.move_robot, target, LARGEST_CARRY_M)


def _moved(kind: str, who: str, move: Callable[[float, float, float], None], target: str, largest_m: float) -> str:
    try:
        along, across, turn = (float(part) for part in target.split(","))
    except ValueError:
        raise FaultRefused(f"{kind}: target must be 'dx,dy,dyaw' in m and degrees, is {target!r}") from None
    if not (abs(along) <= largest_m and abs(across) <= largest_m and abs(turn) <= 180.0):
        raise FaultRefused(f"{kind}: at most {largest_m:g} m and 180 degrees, not {target!r}")
    try:
        move(along, across, math.radians(turn))
    except ValueError as error:
        raise FaultRefused(f"{kind}: {error}") from None
    return f"the {who} is moved by {along:g} m ahead, {across:g} m to its left, {turn:g} degrees"


_FRICTION = ("friction coefficient", 0.01, 2.0, 0.1)
_ALARM, _FACTOR = ("alarm code", 1.0, 65535.0, DEFAULT_ALARM_CODE), ("factor", 0.0, 1000.0, 10.0)


def _row(
    change: Callable[[Simulation, str, float | None], str],
    what: str,
    targets: tuple[str, ...] | None = ONLY,
    value: tuple[str, float, float, float] = ("none", 0.0, 0.0, 0.0),
    lasts: bool = True,
) -> FaultKind:
    name, low, high, default = value
    return FaultKind(change.__name__.lstrip("_"), what, targets, name, change, low, high, default, lasts)


FAULT_KINDS: tuple[FaultKind, ...] = (
    _row(_drive_alarm, "a fault inside a servo drive; its alarm stays until the engine clears it", JOINTS, _ALARM),
    _row(_bus_loss, "no telegram passes between engine and drives"),
    _row(_encoder_freeze, "an encoder repeats its last count", JOINTS),
    _row(_slip, "ground slippery under a wheel wherever it is; no target: all", ("", *DRIVE_JOINTS), _FRICTION),
    _row(_slip_patch, "slippery ground at x,y,length,width in m; no target: ahead of the robot", None, _FRICTION),
    _row(_imu_silent, "the inertial unit sends nothing"),
    _row(_imu_frozen, "the inertial unit repeats its last values"),
    _row(_imu_noise, "the inertial unit is noisier", ONLY, _FACTOR),
    _row(_estop_button, "the emergency stop button", ONLY, ("1 pressed, 0 released", 0.0, 1.0, 0.0)),
    _row(_engine_stall, "the motion engine stops cycling"),
    _row(_latch_stuck, "the latch of the wheelchair does not move"),
    _row(_latch_no_confirm, "the latch moves, but its closed input stays 0"),
    _row(_latch_opens, "the latch loses its closed input, lets go at once and stays open"),
    _row(_chair_moved, "shifts the standing wheelchair by dx,dy,dyaw (m, degrees) in its own frame", None, lasts=False),
    _row(_robot_moved, "carries the robot off by dx,dy,dyaw (m, degrees) in its own frame", None, lasts=False),
    _row(_wheelchair, "no fault: the wheelchair hangs on the latch at once", ONLY, ("passenger, kg", 0.0, 1e3, 0.0)),
)

BY_NAME: dict[str, FaultKind] = {kind.name: kind for kind in FAULT_KINDS}


class Faults:
    """The faults in force in one simulation."""

    def __init__(self, sim: Simulation) -> None:
        self._sim = sim
        self._active: dict[tuple[str, str], ActiveFault] = {}
        self._next_end_s = math.inf

    @property
    def active(self) -> tuple[ActiveFault, ...]:
        return tuple(self._active.values())

    def inject(self, kind: str, target: str = "", value: float = 0.0, duration_s: float = 0.0) -> str:
        """Raises a fault, for ``duration_s`` of simulated time or, with 0, until it is cleared.

        ``clear`` as the kind ends the fault of the kind named by ``target`` (``kind`` or ``kind:target``; empty: all).
        Returns what was done. Raises FaultRefused.
        """
        if kind == CLEAR:
            return self._clear_by_name(target)
        row = BY_NAME.get(kind)
        if row is None:
            raise FaultRefused(f"no fault {kind!r}; there are {', '.join(BY_NAME)} and {CLEAR}")
        if row.targets is not None and target not in row.targets:
            accepted = ", ".join(repr(name) if name else "''" for name in row.targets)
            raise FaultRefused(f"{kind}: target must be one of {accepted}, is {target!r}")
        if not math.isfinite(duration_s) or duration_s < 0.0:
            raise FaultRefused(f"{kind}: duration_s must be 0 or more, is {duration_s}")
        amount = value if value != 0.0 else row.default
        if not row.low <= amount <= row.high or not math.isfinite(amount):
            raise FaultRefused(f"{kind}: value ({row.value}) must be in {row.low:g}..{row.high:g}, is {value}")
        done = row.change(self._sim, target, amount)
        self._note(row, target, amount, duration_s)
        return done + (f" for {duration_s:g} s" if duration_s > 0.0 else "")

    def _note(self, row: FaultKind, target: str, amount: float, duration_s: float) -> None:
        until_s = self._sim.time_s + duration_s if duration_s > 0.0 else math.inf
        if not row.lasts or (row.name == "estop_button" and amount <= 0.5):
            self._active.pop((row.name, target), None)  # it has happened; and a released button is no fault
        else:
            self._active[row.name, target] = ActiveFault(row.name, target, until_s)
        self._plan()

    def update(self) -> None:
        """Ends what has lasted its time; call it every step."""
        if self._sim.time_s < self._next_end_s:
            return
        for fault in self.active:
            if self._sim.time_s >= fault.until_s:
                self._end(fault)

    def _clear_by_name(self, name: str) -> str:
        kind, _, target = name.partition(":")
        if kind and kind not in BY_NAME:
            raise FaultRefused(f"{CLEAR}: no fault {kind!r}; there are {', '.join(BY_NAME)}")
        chosen = [item for item in self.active if kind in ("", item.kind) and target in ("", item.target)]
        for fault in chosen:
            self._end(fault)
        names = ", ".join(f"{item.kind}:{item.target}" if item.target else item.kind for item in chosen)
        return f"cleared {names}" if names else "nothing to clear"

    def _end(self, fault: ActiveFault) -> None:
        BY_NAME[fault.kind].change(self._sim, fault.target, None)
        del self._active[fault.kind, fault.target]
        self._plan()

    def _plan(self) -> None:
        self._next_end_s = min((fault.until_s for fault in self._active.values()), default=math.inf)
