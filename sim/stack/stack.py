"""The robot's whole stack on the deterministic scheduler: a seed determines the run."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self, cast

from robot_stack.contract import topics
from robot_stack.contract.model import Process as Row
from robot_stack.contract.model import Topic
from robot_stack.core.config import SITE_VARIABLE
from robot_stack.middleware.node import StackNode, node_class
from robot_stack.middleware.port import Port, Publisher
from robot_stack.supervisor.profile import WORLD_NODES, Plan, load_plan
from robot_stack.wmx import EngineError, MotionEngine
from robot_stack.wmx.api import ErrorCode, error_name
from sim.nodes.battery_driver import BatteryDriver
from sim.nodes.imu_driver import ImuDriver
from sim.nodes.sim_world import SimWorld
from sim.scheduler.observers import LifeChange, Observer
from sim.scheduler.scheduler import Scheduler
from sim.settings import own_site
from sim.stack.devices import StackDevices, runs
from sim.stack.faults import StackFaults
from sim.stack.screen import ScheduledServer
from sim.stack.supervision import ENDED, Supervision
from sim.stack.tool import ToolNode
from sim.stack.world import ScheduledWorld

_WORLD, _BLACK_BOX = "sim_world", "black_box"
_STATE_VARIABLES = ("XDG_STATE_HOME", "XDG_DATA_HOME")
# Nodes start in random order within this time.
_START_WITHIN_S = 0.5


@dataclass(frozen=True, slots=True)
class StackSetup:
    """Settings of one run. settings: ``node.parameter=value`` on top of the profile. only: processes, all if empty.

    black_box: runs it too. It writes 7 MB per simulated second into files that are deleted with the run.
    prepare: called with the first world before its first step.
    """

    seed: int
    settings: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    profile: str = "sim"
    black_box: bool = False
    prepare: Callable[[ScheduledWorld], None] | None = None


class SimulatedStack(Observer):
    """A context manager. ``world`` is None until the process of the world has constructed its nodes.

    State files are written to ``folder``, a temporary folder of the run that is deleted on exit.
    """

    def __init__(self, setup: StackSetup, *, parallel: bool = True) -> None:
        """Raises ConfigError for a wrong profile or setting."""
        self.setup = setup
        seeds = tuple(f"{node}.seed={setup.seed}" for node in WORLD_NODES)
        self.plan: Plan = load_plan(
            setup.profile,
            settings=(*seeds, *setup.settings),
            only=setup.only,
            without=() if setup.black_box else (_BLACK_BOX,),
            system_time=True,
        )
        self.scheduler = Scheduler(setup.seed, parallel=parallel)
        self.world: ScheduledWorld | None = None
        self._devices = StackDevices(self.scheduler, self._open_engine, lambda: self.faults.lose_power())
        self.computer, self.cable, self.disk = self._devices.computer, self._devices.cable, self._devices.disk
        self.broker = self._devices.broker
        self._exit = contextlib.ExitStack()
        self.folder = Path()

    def __enter__(self) -> Self:
        self._exit.enter_context(self.scheduler)
        self.folder = Path(tempfile.mkdtemp(prefix="robot_stack_state-"))
        self._exit.callback(shutil.rmtree, self.folder, ignore_errors=True)
        variables = {name: str(self.folder / name.lower()) for name in _STATE_VARIABLES} | dict(self.plan.environment)
        variables[SITE_VARIABLE] = own_site(str(self.plan.parameters.get(_WORLD, {}).get("world", "")))
        self._exit.enter_context(_environment(variables))
        self.faults = StackFaults(self)
        self.scheduler.add_observer(self)
        self.operator, self.test_tool = self.tool(topics.OPERATOR_TOOL), self.tool(topics.TEST_TOOL)
        start, begun_s = self.scheduler.streams.generator("start order"), self.scheduler.now_s
        for row in self.plan.processes:
            # The world starts first, because the ground exists before any node.
            wait_s = 0.0 if row.name == _WORLD else _START_WITHIN_S * float(start.random())
            self.scheduler.spawn(row.name, *node_factories(row), at_s=begun_s + wait_s, parameters=self.plan.parameters)
        self.supervision = Supervision(self.scheduler, self.plan.processes)
        return self

    def __exit__(self, *_: object) -> None:
        self._exit.close()

    @property
    def time_s(self) -> float:
        """Virtual time."""
        return self.scheduler.now_s

    @property
    def server(self) -> ScheduledServer | None:
        """The touch screen's server, or None if it does not run."""
        return self._devices.server

    def advertise(self, row: Topic) -> Publisher:
        """The publisher of the tool node that may publish the row. Raises ContractViolation if neither may."""
        tool = self.operator if self.operator.port.name in row.publishers else self.test_tool
        return tool.advertise(row)

    def tool(self, name: str) -> ToolNode:
        """A node outside of the process table that runs when this returns."""
        tools: list[ToolNode] = []

        def make() -> ToolNode:
            tools.append(ToolNode(name))
            return tools[-1]

        process = self.scheduler.spawn(name, make, computer="operator")
        self.scheduler.run(self.scheduler.now_s + 10.0, lambda: process.running)
        return tools[0]

    def on_life_change(self, time_ns: int, process: str, change: LifeChange) -> None:
        if process != _WORLD:
            return
        if change is LifeChange.READY:
            self._begin_world()
        elif change in ENDED and self.world is not None:
            self.world.end()

    def _begin_world(self) -> None:
        nodes = cast(tuple[SimWorld, ImuDriver, BatteryDriver], tuple(self.scheduler.processes[_WORLD].nodes))
        scheduler, first = self.scheduler, self.world is None
        world = self.world = ScheduledWorld(
            nodes, lambda: scheduler.now_ns, lambda: scheduler.computer().system_start_ns
        )
        if first and self.setup.prepare is not None:
            self.setup.prepare(world)
        world.sim.processes = self.faults.processes
        world.after_block.append(self.faults.update)
        scheduler.every(world.block_ns, world.run_block, start_ns=scheduler.now_ns + world.block_ns)

    def _open_engine(self, port: Port) -> MotionEngine:
        """Raises EngineError while no world runs."""
        if self.world is None or self.world.ended:
            code = ErrorCode.IMLibIsNotRunning
            raise EngineError(f"{port.name}: no motion engine runs", code, error_name(code))
        return self.world.engine.open(port, lambda: runs(port))


def node_factories(row: Row) -> Sequence[Callable[[], StackNode]]:
    """Factories of the nodes of a process of the contract."""
    if row.name == _WORLD:
        return SimWorld, ImuDriver, BatteryDriver
    return (node_class(row),)


@contextlib.contextmanager
def _environment(variables: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
