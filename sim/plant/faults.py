"""The faults of a simulation, one row each, for ``/sim/inject_fault`` and scenarios."""

from __future__ import annotations

import math
from collections.abc import Callable

from robot_stack.contract.frames import DRIVE_AXES, JOINTS
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import SIDES
from sim.plant.drives import EDGE_RELAY
from sim.plant.fault_table import CLEAR as CLEAR
from sim.plant.fault_table import ActiveFault as ActiveFault
from sim.plant.fault_table import FaultKind, FaultTable
from sim.plant.fault_table import FaultRefused as FaultRefused
from sim.plant.simulation import Simulation
from sim.plant.surface import Area

DEFAULT_ALARM_CODE = 0x4210  # CiA 402: excess temperature of the device
DEFAULT_PATCH_SIZE_M = 2.0
LARGEST_SHIFT_M, LARGEST_CARRY_M = 5.0, 100.0
DRIVE_JOINTS = tuple(JOINTS[axis] for axis in DRIVE_AXES)
ONLY = ("",)  # a kind with one target, which needs no name


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


def _edge_pressed(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.drives.set_edge_pressed(target, value is not None)
    return f"the safety edge is pressed at the {target}"


def _edge_wire_cut(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.drives.set_edge_wire_cut(target, value is not None)
    return f"the wire of the safety edge's input {target} is cut"


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


def _charger(sim: Simulation, target: str, value: float | None) -> str:
    sim.battery.charger_w = value or 0.0
    return f"a charger gives {sim.battery.charger_w:g} W"


def _charger_dead(sim: Simulation, target: str, value: float | None) -> str:
    sim.contacts.dead = value is not None
    return "the charging contacts give no power"


def _door_dead(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.building.dead = value is not None
    return "the building does not answer requests for doors"


def _door_stuck(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.building.stuck = value is not None
    return "the doors do not open"


def _door_closes(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.building.closes = value is not None
    return "the doors close, whatever is requested"


def _latch_stuck(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.latch.stuck = value is not None
    return "the latch does not move"


def _latch_no_confirm(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.latch.set_no_confirm(value is not None)
    return "the latch's closed input stays 0"


def _latch_opens(sim: Simulation, target: str, value: float | None) -> str:
    sim.world.latch.fail_open(value is not None)
    return "the latch has opened"


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


def _process_killed(sim: Simulation, target: str, value: float | None) -> str:
    sim.processes.kill(target)
    return f"the process {target} is killed"


def _process_hang(sim: Simulation, target: str, value: float | None) -> str:
    if value is None:
        sim.processes.resume(target)
    else:
        sim.processes.stop(target)
    return f"the process {target} hangs"


_FRICTION = ("friction coefficient", 0.01, 2.0, 0.1)
_ALARM, _FACTOR = ("alarm code", 1.0, 65535.0, DEFAULT_ALARM_CODE), ("factor", 0.0, 1000.0, 10.0)


def _row(
    change: Callable[[Simulation, str, float | None], str],
    what: str,
    targets: tuple[str, ...] | None = ONLY,
    value: tuple[str, float, float, float] = ("none", 0.0, 0.0, 0.0),
    lasts: bool = True,
    over_at: float = -math.inf,
) -> FaultKind:
    name, low, high, default = value
    return FaultKind(change.__name__.lstrip("_"), what, targets, name, change, low, high, default, lasts, over_at)


FAULT_KINDS: tuple[FaultKind, ...] = (
    _row(_drive_alarm, "a fault inside a servo drive; its alarm stays until the engine clears it", JOINTS, _ALARM),
    _row(_bus_loss, "no telegram passes between engine and drives"),
    _row(_encoder_freeze, "an encoder repeats its last count", JOINTS),
    _row(_slip, "ground slippery under a wheel wherever it is; no target: all", ("", *DRIVE_JOINTS), _FRICTION),
    _row(_slip_patch, "slippery ground at x,y,length,width in m; no target: ahead of the robot", None, _FRICTION),
    _row(_imu_silent, "the inertial unit sends nothing"),
    _row(_imu_frozen, "the inertial unit repeats its last values"),
    _row(_imu_noise, "the inertial unit is noisier", ONLY, _FACTOR),
    _row(_estop_button, "the emergency stop button", ONLY, ("1 pressed, 0 released", 0.0, 1.0, 0.0), over_at=0.5),
    _row(_edge_pressed, "a side of the safety edge is pressed, and with it its relay", SIDES),
    _row(
        _edge_wire_cut, "the wire of one input of the safety edge is cut; relay: of the relay's", (*SIDES, EDGE_RELAY)
    ),
    _row(_engine_stall, "the motion engine stops cycling"),
    _row(_latch_stuck, "the latch of the wheelchair does not move"),
    _row(_latch_no_confirm, "the latch moves, but its closed input stays 0"),
    _row(_latch_opens, "the latch loses its closed input, opens at once and stays open"),
    _row(_chair_moved, "shifts the standing wheelchair by dx,dy,dyaw (m, degrees) in its own frame", None, lasts=False),
    _row(_robot_moved, "displaces the robot by dx,dy,dyaw (m, degrees) in its own frame", None, lasts=False),
    _row(_process_killed, "SIGKILL to the process of a node", None, lasts=False),
    _row(_process_hang, "SIGSTOP to the process of a node; the world does not wait for it", None),
    _row(_door_dead, "the building's interface of the doors takes no requests and reports nothing"),
    _row(_door_stuck, "the doors do not open"),
    _row(_door_closes, "the doors close, whatever is requested"),
    _row(_charger_dead, "the charging contacts of the stations give no power"),
    _row(_charger, "no fault: a charger is plugged", ONLY, ("power, W", 0.0, 5e3, 500.0)),
    _row(_wheelchair, "no fault: the wheelchair hangs on the latch at once", ONLY, ("passenger, kg", 0.0, 1e3, 0.0)),
)

BY_NAME: dict[str, FaultKind] = {kind.name: kind for kind in FAULT_KINDS}


class Faults(FaultTable):
    """The faults in force in one simulation."""

    def __init__(self, sim: Simulation) -> None:
        super().__init__(sim, BY_NAME)
