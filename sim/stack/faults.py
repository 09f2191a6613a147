"""All faults of a run on the scheduler, in one table, for a plan, a seed or a test.

The rows of the simulated world keep the names they have for ``/sim/inject_fault``; those of the other simulated devices
have their device's name in front, such as ``lidar.rain`` or ``display.cable``. The rows of this module are faults of
messages, processes, the computer's power, its disk and its clock.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field

from robot_stack.contract import topics
from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import System
from robot_stack.core.config import Config, ConfigError, read_yaml, validate
from robot_stack.core.robot import SIDES
from sim.camera import faults as camera
from sim.computer import faults as computer
from sim.ehmi import faults as display
from sim.lidar import faults as lidar
from sim.plant import faults as plant
from sim.plant.drives import EDGE_RELAY
from sim.plant.fault_table import CLEAR, FaultKind, FaultRefused, FaultTable
from sim.scheduler.events import NANOSECONDS
from sim.scheduler.params import Spread
from sim.scheduler.parts import SimulatedStack
from sim.scheduler.process import Life
from sim.scheduler.rules import Corrupt, Delay, Duplicate, Lose, MessageRule, Reorder
from sim.scheduler.streams import Streams
from sim.stack.disk import FILES

WORLD: Final = "sim_world"
# By prefix: the process whose first node has ``inject_fault``.
DEVICES: Final = {
    "lidar": "lidar_driver",
    "overhead_lidar": "overhead_lidar_driver",
    "camera": "camera_driver",
    "display": "ehmi_display",
    "computer": "sim_computer",
}
INJECTED = "InjectedCrash"
_LONGEST_HANG_S = 3600.0
_BOOT_S = 4.0
_REORDERED_BY_S = 1.5  # of the row's period
_SMALLEST_MS = 0.001
_ROWS = {row.name: row for row in topics.of_system(System.ROBOT, System.SIMULATION)}


class InjectedCrash(RuntimeError):
    """The exception of the fault process_crash."""


# --- rows of this module ---------------------------------------------------------------------------------------------


def _messages_lost(stack: SimulatedStack, target: str, value: float | None) -> str:
    topic, subscriber = _link(target)
    _rule(
        stack, "messages_lost", target, value and Lose(name="", topic=topic, subscriber=subscriber, probability=value)
    )
    return f"{_percent(value)} of the messages of {target} are lost"


def _messages_late(stack: SimulatedStack, target: str, value: float | None) -> str:
    topic, subscriber = _link(target)
    rule = value and Delay(name="", topic=topic, subscriber=subscriber, extra=_spread(value))
    _rule(stack, "messages_late", target, rule)
    return f"the messages of {target} arrive about {value} s later"


def _messages_doubled(stack: SimulatedStack, target: str, value: float | None) -> str:
    topic, subscriber = _link(target)
    extra = _spread(_REORDERED_BY_S * _period_s(topic))
    rule = value and Duplicate(name="", topic=topic, subscriber=subscriber, probability=value, extra=extra)
    _rule(stack, "messages_doubled", target, rule)
    return f"{_percent(value)} of the messages of {target} arrive twice"


def _messages_reordered(stack: SimulatedStack, target: str, value: float | None) -> str:
    topic, subscriber = _link(target)
    extra = _spread(_REORDERED_BY_S * _period_s(topic))
    rule = value and Reorder(name="", topic=topic, subscriber=subscriber, probability=value, extra=extra)
    _rule(stack, "messages_reordered", target, rule)
    return f"{_percent(value)} of the messages of {target} are overtaken by later ones"


def _messages_corrupted(stack: SimulatedStack, target: str, value: float | None) -> str:
    link, _, change = target.partition(":")
    path, equals, number = change.partition("=")
    if not path or not equals:
        raise FaultRefused(f"messages_corrupted: target must be 'TOPIC[>SUBSCRIBER]:FIELD=NUMBER', is {target!r}")
    topic, subscriber = _link(link)
    try:
        content = float(number)
    except ValueError:
        raise FaultRefused(f"messages_corrupted: {number!r} is not a number") from None
    rule = value and Corrupt(name="", topic=topic, subscriber=subscriber, probability=value, path=path, value=content)
    _rule(stack, "messages_corrupted", target, rule)
    return f"{path} is {number} in {_percent(value)} of the messages of {link}"


def _process_crash(stack: SimulatedStack, target: str, value: float | None) -> str:
    life = stack.faults.processes.life(target)

    def crash() -> None:
        raise InjectedCrash(f"{INJECTED}: an exception in a callback of {target}")

    life.ports[0].call_soon(crash)
    return f"a callback of {target} raises an exception"


def _power_lost(stack: SimulatedStack, target: str, value: float | None) -> str:
    stack.faults.lose_power(value or _BOOT_S)
    return f"the robot's computer loses its power and starts again after {value:g} s"


def _clock_step(stack: SimulatedStack, target: str, value: float | None) -> str:
    stack.scheduler.step_system_clock(value or 0.0)
    return f"the system clock jumps by {value:g} s"


def _disk_broken(stack: SimulatedStack, target: str, value: float | None) -> str:
    stack.disk.broken = value is not None
    return "every write to the disk fails"


def _disk_full(stack: SimulatedStack, target: str, value: float | None) -> str:
    stack.disk.full = value is not None
    stack.computer.disk.full = value is not None
    return "the disk is full"


def _disk_slow(stack: SimulatedStack, target: str, value: float | None) -> str:
    stack.disk.slow_s = value or 0.0
    return f"a write to the disk takes {value} s"


def _disk_torn(stack: SimulatedStack, target: str, value: float | None) -> str:
    stack.disk.torn = target if value is not None else ""
    stack.disk.torn_bytes = int(value or 0)
    return f"the power goes in the next write of the file {target}, after {stack.disk.torn_bytes} bytes"


def _row(
    change: Callable[[Any, str, float | None], str],
    what: str,
    targets: tuple[str, ...] | None = plant.ONLY,
    value: tuple[str, float, float, float] = ("none", 0.0, 0.0, 0.0),
    *,
    lasts: bool = True,
) -> FaultKind:
    name, low, high, default = value
    return FaultKind(change.__name__.lstrip("_"), what, targets, name, change, low, high, default, lasts)


_SHARE = ("share of the messages", 0.0, 1.0, 1.0)
OWN_KINDS: tuple[FaultKind, ...] = (
    _row(_messages_lost, "messages of TOPIC[>SUBSCRIBER] are lost", None, _SHARE),
    _row(_messages_late, "messages of TOPIC[>SUBSCRIBER] arrive later", None, ("s", 0.001, 10.0, 0.2)),
    _row(_messages_doubled, "messages of TOPIC[>SUBSCRIBER] arrive twice", None, _SHARE),
    _row(_messages_reordered, "messages of TOPIC[>SUBSCRIBER] are overtaken by later ones", None, _SHARE),
    _row(_messages_corrupted, "a field is wrong: TOPIC[>SUBSCRIBER]:FIELD=NUMBER", None, _SHARE),
    _row(_process_crash, "an exception in a callback of a process", None, lasts=False),
    _row(
        _power_lost,
        "the robot's computer loses its power: memory is lost, files stay, all processes start again",
        value=("s until the processes start", 0.5, 600.0, _BOOT_S),
        lasts=False,
    ),
    _row(_clock_step, "the system clock jumps", value=("s", -1e6, 1e6, 3600.0), lasts=False),
    _row(_disk_broken, "every write to the disk fails"),
    _row(_disk_full, "the disk has no free blocks; files are overwritten in place as before"),
    _row(_disk_slow, "writes by workers take longer", value=("s", 0.01, 600.0, 5.0)),
    _row(_disk_torn, "the power goes in the next write of a file", FILES, ("bytes written", 1.0, 4096.0, 32.0)),
)
OWN: dict[str, FaultKind] = {kind.name: kind for kind in OWN_KINDS}


def _link(target: str) -> tuple[str, str | None]:
    """TOPIC[>SUBSCRIBER]. Raises FaultRefused."""
    topic, _, subscriber = target.partition(">")
    if topic not in _ROWS:
        raise FaultRefused(f"no topic {topic!r} in the contract; the target must be TOPIC or TOPIC>SUBSCRIBER")
    return topic, subscriber or None


def _period_s(topic: str) -> float:
    return 1.0 / (_ROWS[topic].rate_hz or 10.0)


def _spread(median_s: float) -> Spread:
    median_ms = max(_SMALLEST_MS, 1e3 * median_s)
    return Spread(median_ms=median_ms, p99_ms=1.5 * median_ms)


def _percent(value: float | None) -> str:
    return f"{100.0 * (value or 0.0):g} %"


def _rule(stack: SimulatedStack, kind: str, target: str, rule: Any) -> None:
    """Replaces the rule of this kind and target; none if there is nothing to do."""
    network, name = stack.scheduler.network, f"{kind} {target}"
    network.remove_rule(name)
    if rule:
        assert isinstance(rule, MessageRule)
        object.__setattr__(rule, "name", name)
        network.add_rule(rule)


# --- the table -------------------------------------------------------------------------------------------------------


class ScheduledProcesses:
    """Counterpart of ``sim.run.processes.Processes``: the processes of the stack, by name. Raises FaultRefused."""

    def __init__(self, stack: SimulatedStack) -> None:
        self._stack = stack
        self._hung: dict[str, Life] = {}

    def life(self, name: str) -> Life:
        process = self._stack.scheduler.processes.get(name)
        if process is None or name not in {row.name for row in self._stack.plan.processes}:
            raise FaultRefused(f"no process {name!r} in this stack")
        if name == WORLD:
            raise FaultRefused(f"{name} is the world itself, which has no faults of a process")
        if process.life is None or not process.life.alive or not process.life.ports:
            raise FaultRefused(f"the process {name} does not run now")
        return process.life

    def kill(self, name: str) -> None:
        self.life(name)
        self._stack.scheduler.processes[name].kill()

    def stop(self, name: str) -> None:
        self._hung[name] = self.life(name)
        self._stack.scheduler.processes[name].hang(_LONGEST_HANG_S)

    def resume(self, name: str) -> None:
        """Ends ``stop``. The supervisor may have replaced the process meanwhile."""
        if self._hung.pop(name, None) is self._stack.scheduler.processes[name].life:
            self._stack.scheduler.processes[name].resume()


@dataclass(frozen=True, slots=True)
class Raised:
    """A fault that was raised, at virtual time."""

    time_s: float
    kind: str
    target: str


class StackFaults:
    """The faults in force in one stack. history: all faults raised so far."""

    def __init__(self, stack: SimulatedStack) -> None:
        self._stack = stack
        self.processes = ScheduledProcesses(stack)
        self._own = FaultTable(stack, OWN)
        self.history: list[Raised] = []

    def inject(self, kind: str, target: str = "", value: float = 0.0, duration_s: float = 0.0) -> str:
        """See ``FaultTable.inject``. ``clear`` as the kind ends ``target``; empty: everything. Raises FaultRefused."""
        if kind == CLEAR:
            return self._clear(target)
        table = self._table(kind)
        done = table(kind.rpartition(".")[2], target, value, duration_s)
        self.history.append(Raised(self._stack.scheduler.now_s, kind, target))
        return done

    def update(self) -> None:
        """Ends expired faults; called with each block of the world."""
        self._own.update()

    def active(self) -> list[str]:
        """Names of the world's faults and of this module's, for reports."""
        world = self._stack.world
        found = [*self._own.active, *(world.faults.active if world is not None else ())]
        return [f"{item.kind}:{item.target}" if item.target else item.kind for item in found]

    def is_active(self, *kinds: str) -> bool:
        return any(name.partition(":")[0] in kinds for name in self.active())

    def _table(self, kind: str) -> Callable[[str, str, float, float], str]:
        """Raises FaultRefused."""
        device, _, _ = kind.rpartition(".")
        if device:
            if device not in DEVICES:
                raise FaultRefused(f"no device {device!r}; there are {', '.join(DEVICES)}")
            return self._device(device)
        if kind in OWN:
            return self._own.inject
        if kind not in plant.BY_NAME:
            raise FaultRefused(f"no fault {kind!r}; there are {', '.join(kinds())} and {CLEAR}")
        if self._stack.world is None:
            raise FaultRefused(f"{kind}: there is no world yet")
        return self._stack.world.faults.inject

    def _device(self, device: str) -> Callable[[str, str, float, float], str]:
        nodes = self._stack.scheduler.processes[DEVICES[device]].nodes
        if not nodes:
            raise FaultRefused(f"{DEVICES[device]} does not run now")
        inject: Callable[[str, str, float, float], str] = getattr(nodes[0], "inject_fault")  # noqa: B009
        return inject

    def _clear(self, name: str) -> str:
        if name:
            kind, colon, target = name.partition(":")
            return self._table(kind)(CLEAR, kind.rpartition(".")[2] + colon + target, 0.0, 0.0)
        tables: list[Callable[[str, str, float, float], str]] = [self._own.inject]
        if self._stack.world is not None:
            tables.append(self._stack.world.faults.inject)
        tables += [
            self._device(device) for device, row in DEVICES.items() if self._stack.scheduler.processes[row].nodes
        ]
        return "; ".join(done for table in tables if (done := table(CLEAR, "", 0.0, 0.0)) != "nothing to clear")

    # --- the computer's power ----------------------------------------------------------------------------------------

    def lose_power(self, off_s: float = _BOOT_S) -> None:
        """Kills all processes of the robot's computer, clears its memory, and starts the supervisor after ``off_s``.

        The simulated world, the external display and their processes are not on that computer.
        """
        stack, scheduler = self._stack, self._stack.scheduler
        names = [row.name for row in stack.plan.processes if row.name not in (WORLD, "ehmi_display", "sim_computer")]
        stack.supervision.stop_watching(names)
        for name in names:
            scheduler.processes[name].kill()
        kept = {node for row in stack.plan.processes if row.name not in names for node in row.nodes}
        _forget_memory(scheduler.runtime_folder, kept)
        if stack.world is not None:
            stack.world.switch_engine_off()

        def start() -> None:
            if stack.world is not None:
                stack.world.switch_engine_on()
            stack.supervision.begin_again(names)

        scheduler.at(scheduler.now_ns + round(off_s * NANOSECONDS), start)


def _forget_memory(folder: Path, kept: set[str]) -> None:
    """Empties the runtime folder except for the records of the nodes that continue."""
    for path in folder.iterdir():
        if path.name == "nodes":
            for record in path.iterdir():
                if record.name not in kept:
                    record.unlink()
        elif path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def kinds() -> dict[str, FaultKind]:
    """Every row, by the name that ``inject`` takes."""
    # The cameras and markers depend on the docks of a site.
    cameras = camera.kinds(("front", "rear"), ())
    tables: dict[str, Mapping[str, FaultKind]] = {
        "lidar": lidar.BY_NAME,
        "overhead_lidar": lidar.BY_NAME,
        "camera": {kind.name: kind for kind in cameras},
        "display": display.BY_NAME,
        "computer": computer.BY_NAME,
    }
    named = {f"{device}.{name}": kind for device, table in tables.items() for name, kind in table.items()}
    return {**plant.BY_NAME, **OWN, **named}


# --- plans -----------------------------------------------------------------------------------------------------------


class PlannedFault(Config):
    """One fault at ``at_s``, counted from when the robot may drive. See ``StackFaults.inject`` for the rest."""

    at_s: Annotated[float, Field(ge=0.0)]
    kind: str
    target: str = ""
    value: float = 0.0
    duration_s: Annotated[float, Field(ge=0.0)] = 0.0

    def describe(self) -> str:
        amount = f" {self.value:g}" if self.value else ""
        lasting = f" for {self.duration_s:g} s" if self.duration_s else ""
        return f"{self.at_s:g} s: {self.kind} {self.target}{amount}{lasting}".replace("  ", " ")


class FaultPlan(Config):
    """A file of faults."""

    faults: list[PlannedFault]


def load_faults(path: Path) -> tuple[PlannedFault, ...]:
    """The faults of a YAML file, ``faults: [{at_s, kind, target, value, duration_s}]``. Raises ConfigError."""
    plan = validate(FaultPlan, read_yaml(path), str(path))
    known = kinds()
    for index, fault in enumerate(plan.faults):
        problem = _problem(fault, known)
        if problem:
            raise ConfigError(f"{path}: faults.{index}: {problem}")
    return tuple(plan.faults)


def plan_text(faults: tuple[PlannedFault, ...]) -> str:
    """The text for ``load_faults``, one fault per line."""
    lines = []
    for fault in faults:
        fields = fault.model_dump(exclude_defaults=True)
        inner = ", ".join(f"{name}: {value!r}" for name, value in fields.items())
        lines.append(f"  - {{{inner}}}\n")
    return "faults:\n" + "".join(lines) if lines else "faults: []\n"


def _problem(fault: PlannedFault, known: Mapping[str, FaultKind]) -> str:
    """Why the fault is invalid, as far as known before the run, else an empty text."""
    if fault.kind == CLEAR:
        return ""
    row = known.get(fault.kind)
    if row is None:
        return f"no fault {fault.kind!r}; there are {', '.join(sorted(known))} and {CLEAR}"
    if row.targets and fault.target not in row.targets and fault.target:
        return f"{fault.kind}: target must be one of {', '.join(map(repr, row.targets))}, is {fault.target!r}"
    amount = fault.value or row.default
    if not row.low <= amount <= row.high:
        return f"{fault.kind}: value ({row.value}) must be in {row.low:g}..{row.high:g}, is {fault.value:g}"
    if fault.kind.startswith("messages_"):
        try:
            _link(fault.target.partition(":")[0])
        except FaultRefused as error:
            return f"{fault.kind}: {error}"
    return ""


@dataclass(frozen=True, slots=True)
class Chance:
    """An entry for ``random_faults``: a kind, its targets, the range of its value and of its duration in s.

    A value is drawn evenly on a logarithmic scale where its range begins above 0; a duration of (0, 0) is none.
    """

    kind: str
    targets: tuple[str, ...] = ("",)
    low: float = 0.0
    high: float = 0.0
    shortest_s: float = 0.5
    longest_s: float = 6.0


_PROCESSES = (
    "swerve_hardware_interface",
    "swerve_controller",
    "emergency_stop_button",
    "safety_monitor",
    "ndt_localization",
    "navigation_controller",
    "mission_manager",
    "lidar_driver",
    "overhead_lidar_driver",
    "camera_driver",
    "perception_pipeline",
    "costmap_server",
    "aruco_detector",
    "docking_controller",
    "ehmi_bridge",
    "touch_ui",
    "system_monitor",
)
_LINKS = (
    *(
        row.name
        for row in topics.of_system(System.ROBOT)
        if row.rate_hz and not row.bulk and not row.name.startswith("/sensors/camera")
    ),
    *("/emergency_stop", "/passenger_attached", "/mission/status", "/goal_pose", "/plan"),
)
_FIELDS = (
    "/joint_states:velocity.0=nan",
    "/joint_states:position.2=1e9",
    "/odom:pose.pose.position.x=nan",
    "/odom:twist.twist.linear.x=50.0",
    "/current_pose:pose.position.x=nan",
    "/current_pose:pose.position.y=1e6",
    "/cmd_vel:linear.x=nan",
    "/cmd_vel:linear.x=100.0",
    "/docking/cmd_vel:twist.angular.z=nan",
    "/safety/velocity_limit:max_linear_velocity=nan",
    "/sensors/imu:angular_velocity.z=nan",
    "/sensors/imu:linear_acceleration.z=1e9",
    "/battery_state:percentage=nan",
    "/localization/quality:data=nan",
    "/swerve/wheel_commands:modules.0.drive_velocity=nan",
    "/swerve/wheel_commands:modules.0.drive_velocity=50.0",
)
CHANCES: tuple[Chance, ...] = (
    Chance("drive_alarm", JOINTS, 1.0, 65535.0, shortest_s=0.0, longest_s=0.0),
    Chance("bus_loss", longest_s=1.0, shortest_s=0.02),
    Chance("encoder_freeze", JOINTS),
    Chance("slip", ("", *plant.DRIVE_JOINTS), 0.05, 0.5),
    Chance("slip_patch", ("",), 0.05, 0.5, shortest_s=0.0, longest_s=0.0),
    Chance("imu_silent"),
    Chance("imu_frozen"),
    Chance("imu_noise", ("",), 2.0, 100.0),
    Chance("estop_button", ("",), 1.0, 1.0),
    Chance("edge_pressed", SIDES, shortest_s=0.05),
    Chance("edge_wire_cut", (*SIDES, EDGE_RELAY)),
    Chance("engine_stall", shortest_s=0.02, longest_s=2.0),
    Chance("latch_stuck"),
    Chance("latch_no_confirm"),
    Chance("latch_opens"),
    *(Chance(f"{name}.silent") for name in ("lidar", "overhead_lidar")),
    *(Chance(f"{name}.frozen") for name in ("lidar", "overhead_lidar")),
    Chance("lidar.noisy", ("",), 2.0, 30.0),
    Chance("lidar.rate", ("",), 0.5, 8.0),
    Chance("lidar.covered", ("",), 0.05, 1.0),
    Chance("lidar.rain", ("",), 5.0, 150.0, 3.0, 20.0),
    Chance("lidar.snow", ("",), 0.5, 10.0, 3.0, 20.0),
    Chance("lidar.dust", ("",), 20.0, 500.0, 3.0, 20.0),
    Chance("lidar.sun", ("",), 1.0, 360.0, 3.0, 20.0),
    Chance("camera.silent", ("front", "rear")),
    Chance("camera.frozen", ("front", "rear")),
    Chance("camera.glare", ("front", "rear"), 60.0, 600.0),
    Chance("camera.rain", ("front", "rear"), 0.1, 1.0),
    Chance("camera.dark", ("front", "rear"), 0.005, 0.1),
    Chance("camera.blur", ("front", "rear"), 1.0, 10.0),
    Chance("display.cable"),
    Chance("display.silent"),
    Chance("display.noise", ("",), 0.01, 0.5),
    Chance("display.power", shortest_s=0.0, longest_s=0.0),
    Chance("computer.overheat", ("",), 80.0, 120.0),
    Chance("computer.cpu_high", ("",), 90.0, 100.0, 5.0, 20.0),
    Chance("computer.memory_high", ("",), 90.0, 99.0),
    Chance("messages_lost", _LINKS, 0.1, 1.0, 0.2, 4.0),
    Chance("messages_lost", _LINKS, 0.1, 1.0, 0.2, 4.0),
    Chance("messages_late", _LINKS, 0.01, 1.0, 0.2, 4.0),
    Chance("messages_late", _LINKS, 0.01, 1.0, 0.2, 4.0),
    Chance("messages_doubled", _LINKS, 0.1, 1.0, 0.2, 4.0),
    Chance("messages_reordered", _LINKS, 0.1, 1.0, 0.2, 4.0),
    Chance("messages_corrupted", _FIELDS, 0.1, 1.0, 0.1, 2.0),
    Chance("messages_corrupted", _FIELDS, 0.1, 1.0, 0.1, 2.0),
    Chance("process_crash", _PROCESSES, shortest_s=0.0, longest_s=0.0),
    Chance("process_killed", _PROCESSES, shortest_s=0.0, longest_s=0.0),
    Chance("process_killed", _PROCESSES, shortest_s=0.0, longest_s=0.0),
    Chance("process_hang", _PROCESSES, shortest_s=0.05, longest_s=8.0),
    Chance("process_hang", _PROCESSES, shortest_s=0.05, longest_s=8.0),
    Chance("power_lost", ("",), 1.0, 8.0, shortest_s=0.0, longest_s=0.0),
    Chance("clock_step", ("",), 0.05, 1e5, shortest_s=0.0, longest_s=0.0),
    Chance("clock_step", ("",), -1e5, -0.05, shortest_s=0.0, longest_s=0.0),
    Chance("disk_broken"),
    Chance("disk_full"),
    Chance("disk_slow", ("",), 0.1, 10.0),
    Chance("disk_torn", FILES, 1.0, 200.0, 5.0, 20.0),
)


def random_faults(seed: int, duration_s: float, count: int) -> tuple[PlannedFault, ...]:
    """``count`` faults within ``duration_s``, in order of time.

    Each is drawn from a stream of its own: the first ones are the same for a greater count.
    """
    streams = Streams(seed)
    drawn = [_draw(streams.generator(f"faults/{index}"), duration_s) for index in range(count)]
    return tuple(sorted(drawn, key=lambda fault: fault.at_s))


def _draw(random: np.random.Generator, duration_s: float) -> PlannedFault:
    at_s, which, target, value, lasting = random.random(5).tolist()
    chance = CHANCES[int(which * len(CHANCES))]
    return PlannedFault(
        at_s=round(at_s * duration_s, 3),
        kind=chance.kind,
        target=chance.targets[int(target * len(chance.targets))],
        value=_rounded(_between(chance.low, chance.high, value)),
        duration_s=round(chance.shortest_s + lasting * (chance.longest_s - chance.shortest_s), 3),
    )


def _between(low: float, high: float, share: float) -> float:
    if low > 0.0:
        return low * math.exp(share * math.log(high / low))
    if high < 0.0:
        return -_between(-high, -low, share)
    return low + share * (high - low)


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
