"""Hours of orders with faults on one whole stack in simulated time: what is lost, and what grows."""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from custom_msgs.msg import MissionOrder, MissionQueue, SafetyStatus, UICommand
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
from robot_stack.contract.states import MissionState
from sim.run.scenario import Scenario
from sim.scheduler.streams import Streams
from sim.stack.run import RunOptions, ScheduledRun
from tests.benchmarks.support.framework import Aim, Result

AIMS = {
    "orders_lost": Aim("<=", 0),
    "restarts_unexplained": Aim("<=", 0),
    "processes_down": Aim("<=", 0),
    "collisions": Aim("<=", 0),
    "invariants_broken": Aim("<=", 0),
    "memory_growth_mb_per_h": Aim("<=", 5.0),
}
_WORLD: Final = "yard"
_MISSION: Final = "short_hop"
_ORDER_PERIOD_S: Final = 60.0
_LOOK_S: Final = 5.0  # between two looks of the operator at the screen
_MOST_WAITING: Final = 5
# The first share of the time, in which caches fill; growth counts from its end.
_WARM_SHARE: Final = 0.2
_KILLED: Final = (
    "aruco_detector",
    "camera_driver",
    "costmap_server",
    "docking_controller",
    "ehmi_bridge",
    "lidar_driver",
    "mission_manager",
    "navigation_controller",
    "ndt_localization",
    "perception_pipeline",
    "safety_monitor",
    "swerve_controller",
    "swerve_hardware_interface",
    "system_monitor",
    "touch_ui",
)
_SOURCE_PERIOD_NS: Final = 200_000_000
_PRESS: Final = "emergency stop"


@dataclass(frozen=True, slots=True)
class Fault:
    """A process that is killed, or an emergency stop that is pressed for a moment."""

    at_s: float
    what: str


@dataclass(frozen=True, slots=True)
class Size:
    """Pss of this process without the benchmark's own notes, bytes of the log so far, bytes in the state folder."""

    at_s: float
    memory: int
    log: int
    disk: int


@dataclass(slots=True)
class Notes:
    """orders: accepted ids. ended: state by id. waiting: ids in the queue or under way at the end.

    restarts: by process. down: processes that do not run at the end. refused: orders that were answered with a refusal.
    """

    orders: list[str] = field(default_factory=list)
    ended: dict[str, int] = field(default_factory=dict)
    waiting: set[str] = field(default_factory=set)
    refused: int = 0
    faults: list[Fault] = field(default_factory=list)
    restarts: dict[str, int] = field(default_factory=dict)
    down: tuple[str, ...] = ()
    touched: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()
    sizes: list[Size] = field(default_factory=list)
    simulated_s: float = 0.0


def run(hours: float = 8.0, seed: int = 1, faults_per_h: float = 12.0) -> Result:
    """One stack with light sensors; an order a minute of mission short_hop, by an operator who looks every 5 s.

    hours: simulated. seed: of everything. faults_per_h: on average; 0 for none. Takes about as long as it simulates.
    """
    length_s = 3600.0 * hours
    scenario = Scenario(description="soak", world=_WORLD, seed=seed, limit_s=3600.0)
    with ScheduledRun(scenario, seed, RunOptions(light=True, parallel=False)) as ride:
        ride.start()
        notes = _Day(ride, draw(seed, length_s, faults_per_h), length_s).spend()
    return Result(figures(notes), _conditions(notes, hours, seed, faults_per_h))


def draw(seed: int, length_s: float, faults_per_h: float) -> list[Fault]:
    """Faults in the order of time, a fifth of them presses of the emergency stop."""
    random = Streams(seed).generator("soak")
    count = round(faults_per_h * length_s / 3600.0)
    found = []
    for _ in range(count):
        at, kind, which = random.random(3).tolist()
        found.append(Fault(round(at * length_s, 2), _PRESS if kind < 0.2 else _KILLED[int(which * len(_KILLED))]))
    return sorted(found, key=lambda item: (item.at_s, item.what))


def figures(notes: Notes) -> dict[str, float]:
    """See ``_conditions``."""
    kills = Counter(fault.what for fault in notes.faults if fault.what != _PRESS)
    names = {*kills, *notes.restarts}
    ended = Counter(notes.ended[name] for name in notes.orders if name in notes.ended)
    return {
        "simulated_h": notes.simulated_s / 3600.0,
        "orders": len(notes.orders),
        "orders_completed": ended[MissionOrder.COMPLETED],
        "orders_failed": ended[MissionOrder.FAILED] + ended[MissionOrder.ABORTED],
        "orders_lost": len(set(notes.orders) - notes.ended.keys() - notes.waiting),
        "faults": len(notes.faults),
        "restarts": sum(notes.restarts.values()),
        "restarts_unexplained": sum(abs(notes.restarts.get(name, 0) - kills[name]) for name in names),
        "processes_down": len(notes.down),
        "collisions": len(notes.touched),
        "invariants_broken": len(notes.broken),
        "memory_mb": 1e-6 * notes.sizes[-1].memory if notes.sizes else math.nan,
        "memory_growth_mb_per_h": 1e-6 * growth_per_h([(item.at_s, item.memory) for item in notes.sizes]),
        "log_mb_per_h": 1e-6 * growth_per_h([(item.at_s, item.log) for item in notes.sizes]),
        "disk_mb_per_h": 1e-6 * growth_per_h([(item.at_s, item.disk) for item in notes.sizes]),
    }


def growth_per_h(points: list[tuple[float, int]]) -> float:
    """Slope of the least-squares line, per hour; NaN for less than two points."""
    if len(points) < 2:
        return math.nan
    mean_s = sum(at_s for at_s, _ in points) / len(points)
    mean = sum(value for _, value in points) / len(points)
    spread = sum((at_s - mean_s) ** 2 for at_s, _ in points)
    return 3600.0 * sum((at_s - mean_s) * (value - mean) for at_s, value in points) / spread


class _Day:
    """A run after its start, with its operator."""

    def __init__(self, ride: ScheduledRun, faults: list[Fault], length_s: float) -> None:
        self._ride, self._due, self._length_s = ride, faults, length_s
        self._notes = Notes()
        self._queue: MissionQueue | None = None
        self._log_bytes = self._number = 0
        self._next_order_s = 0.0
        self._pressed = False
        # A press that is not repeated would pass for one of a dead source.
        ride.stack.scheduler.every(_SOURCE_PERIOD_NS, ride.repeat_stop_source)
        tool, port = ride.stack.test_tool, ride.stack.operator.port
        tool.subscribe(topics.MISSION_QUEUE, self._on_queue)
        self._edit = port.client(services.EDIT_MISSION_QUEUE.type, services.EDIT_MISSION_QUEUE.name)

    def spend(self) -> Notes:
        ride, notes, next_size_s = self._ride, self._notes, _WARM_SHARE * self._length_s
        size_period_s = max(_LOOK_S, 0.02 * self._length_s)
        while ride.now_s < self._length_s:
            ride.stack.scheduler.run_for(_LOOK_S)
            while self._due and self._due[0].at_s <= ride.now_s:
                self._raise(self._due.pop(0))
            self._operate()
            self._forget()
            if ride.now_s >= next_size_s:
                next_size_s += size_period_s
                notes.sizes.append(self._size())
                print(self._line(), file=sys.stderr, flush=True)
        ride.stack.scheduler.run_for(4.0 * _LOOK_S)  # a process that was killed last starts again
        notes.restarts = ride.stack.supervision.restarts()
        processes = ride.stack.scheduler.processes
        notes.down = tuple(row.name for row in ride.stack.plan.processes if not processes[row.name].running)
        notes.touched = tuple(sorted(ride.world.sim.world.touched))
        notes.broken = tuple(item.describe() for item in ride.invariants.broken)
        queue = self._queue
        notes.waiting = set() if queue is None else {order.id for order in (*queue.orders, *queue.current)}
        notes.simulated_s = ride.now_s
        return notes

    def _raise(self, fault: Fault) -> None:
        if fault.what == _PRESS:
            self._ride.emergency_stop(True)
            self._pressed = True
        elif self._ride.stack.scheduler.processes[fault.what].alive:
            self._ride.stack.faults.inject("process_killed", fault.what)
        else:
            return
        self._notes.faults.append(fault)

    def _operate(self) -> None:
        """Releases what was pressed, resumes what waits for a person, and orders."""
        ride = self._ride
        safety, mission, queue = ride.safety, ride.mission, self._queue
        stopped = safety is not None and safety.safety_state == SafetyStatus.EMERGENCY_STOP
        if self._pressed:
            ride.emergency_stop(False)
            self._pressed = False
        elif stopped:
            ride.reset()
        elif mission is not None and mission.state == MissionState.PAUSED:
            ride.command(UICommand.RESUME)
        elif queue is not None and queue.held_by != MissionQueue.NOTHING:
            self._edit.call(EditMissionQueue.Request(operation=EditMissionQueue.Request.RELEASE), self._on_release)
        if ride.now_s >= self._next_order_s and queue is not None and len(queue.orders) < _MOST_WAITING:
            self._next_order_s = ride.now_s + _ORDER_PERIOD_S
            self._order()

    def _order(self) -> None:
        self._number += 1
        order = MissionOrder(id=f"soak_{self._number}", mission_id=_MISSION, origin=MissionOrder.CLI, priority=100)

        def on_answer(answer: Any) -> None:
            if answer.success:
                self._notes.orders.append(order.id)
            else:
                self._notes.refused += 1

        self._edit.call(EditMissionQueue.Request(operation=EditMissionQueue.Request.ADD, order=order), on_answer)

    def _on_release(self, answer: Any) -> None:
        if answer.success:
            self._ride.invariants.note_request()

    def _on_queue(self, message: MissionQueue) -> None:
        self._queue = message
        self._notes.ended |= {order.id: order.state for order in message.ended}

    def _forget(self) -> None:
        """Empties the lists that the run keeps for its own figures, so that they do not count as growth."""
        ride = self._ride
        scheduler, log, notes = ride.stack.scheduler, ride.run_log, ride.notes.ride
        self._log_bytes += sum(len(line.text) + len(line.node) for line in scheduler.log)
        moving: tuple[list[Any], ...] = (log.moments, log.commands, log.requested, log.estimates, log.plans)
        noted: tuple[list[Any], ...] = (notes.samples, notes.estimates, notes.plans, notes.wheelchair, notes.limits)
        for kept in (*moving, *noted):
            del kept[:-1]
        scheduler.log.clear()

    def _size(self) -> Size:
        files = (path.stat().st_size for path in _files(self._ride.stack.folder))
        return Size(self._ride.now_s, _pss_bytes(), self._log_bytes, sum(files))

    def _line(self) -> str:
        notes, size = self._notes, self._notes.sizes[-1]
        mission, safety, queue = self._ride.mission, self._ride.safety, self._queue
        held = "" if queue is None else queue.reason
        faults = () if safety is None else (safety.safety_state, *safety.active_faults)
        return (
            f"{size.at_s:.0f} s: {len(notes.orders)} orders, {len(notes.ended)} ended, {len(notes.faults)} faults, "
            f"{1e-6 * size.memory:.0f} MB, disk {1e-6 * size.disk:.1f} MB, "
            f"mission {'' if mission is None else mission.state}, {' '.join(faults)}; {held}"
        )


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())


def _pss_bytes() -> int:
    lines: Iterable[str] = Path("/proc/self/smaps_rollup").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def _conditions(notes: Notes, hours: float, seed: int, faults_per_h: float) -> dict[str, object]:
    return {
        "run": f"seed {seed}, {hours:g} simulated h in {_WORLD}, light sensors, without black box; an order of "
        f"{_MISSION} a minute while fewer than {_MOST_WAITING} wait",
        "faults": f"{faults_per_h:g} per hour: kills of {len(_KILLED)} processes, and a press of the emergency stop",
        "operator": "looks every 5 s: releases and resets the stop, RESUME, releases the queue",
        "orders_lost": "accepted and neither ended nor waiting at the end",
        "restarts_unexplained": "restarts by the supervisor beside the kills, of each process; missing ones as well",
        "growth": f"least-squares line from {_WARM_SHARE:.0%} of the time on; memory is the Pss of the process with "
        "stack and world, log the nodes' lines, disk the state folder",
        "refused": notes.refused,
        "down": notes.down,
        "touched": notes.touched,
        "broken": notes.broken,
        "restarts": notes.restarts,
        "peer": "none",
    }
