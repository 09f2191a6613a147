"""Single nodes of the stack on the scheduler, with peers in place of the other nodes. Durations have no spread."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, cast

from builtin_interfaces.msg import Time

from robot_stack.contract.model import Service, Topic
from robot_stack.contract.processes import BY_NAME
from robot_stack.contract.topics import EMERGENCY_STOP, EMERGENCY_STOP_SOURCES
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.emergency_stop import StopSource
from robot_stack.middleware.port import Port
from robot_stack.wmx import EngineError, MotionEngine
from robot_stack.wmx.api import ErrorCode, error_name
from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from sim.plant.simulation import Simulation
from sim.scheduler.process import Process
from sim.scheduler.scheduler import Scheduler
from sim.stack.devices import StackDevices, runs
from sim.stack.engine import WorldEngine
from sim.stack.stack import node_factories
from sim.stack.tool import ToolNode
from tests.simulated.story import Story
from tests.unit.scheduler.rig import constant, params

LATENCY_S, COMPUTE_S, JOB_S, DISCOVERY_S = 0.001, 0.001, 0.02, 0.1
BUTTON_RELEASED, BUTTON_PRESSED = 1, 0
EDGE_FREE = 0xFF  # all inputs of the safety edge, byte 1
_LIMIT_S = 10.0
_READY_S = 0.2  # after which a new process runs and is discovered by all
_SOURCE_PERIOD_S = 0.2
_ENGINE_BLOCK_CYCLES = 5


def _params(peer: str) -> Any:
    """The peer has nearly no computing time, so it records messages on arrival."""
    return params(
        latency={"small": constant(1.0), "bulk": constant(1.0), "call": constant(1.0), "rows": {}},
        compute={"default": constant(1e3 * COMPUTE_S), "names": {peer: constant(0.001)}},
    )


class Peer(Story):
    """A separate node that is not bound by the contract: tests publish any message.

    port: for functions without a method here. process: to stop, hang and start it. prepare: called with each new port.
    """

    def __init__(self, scheduler: Scheduler, name: str, prepare: Callable[[Port], object] = lambda _: None) -> None:
        tools: list[ToolNode] = []

        def make() -> ToolNode:
            tools.append(ToolNode(name))
            prepare(tools[-1].port)
            return tools[-1]

        self.process = scheduler.spawn(f"peer {name}", make)
        scheduler.run_for(_READY_S)
        super().__init__(scheduler, tools[0].port)
        self.name, self.port = name, tools[0].port
        self._repeating: dict[str, object] = {}

    # --- time --------------------------------------------------------------------------------------------------------

    def stamp_s(self) -> float:
        """The time of the ROS clock."""
        return self.port.now_ns() / 1e9

    def stamp(self, later_s: float = 0.0) -> Time:
        return time_from_s(self.stamp_s() + later_s)

    # --- messages ----------------------------------------------------------------------------------------------------

    def repeat(self, row: Topic, make: Callable[[], Any], rate_hz: float) -> None:
        """Publishes ``make()`` now and at ``rate_hz`` until ``silence``; a second call replaces the first."""
        publisher, token, period_ns = self.publisher(row), object(), round(1e9 / rate_hz)
        self._repeating[row.name] = token

        def publish() -> None:
            if self._repeating.get(row.name) is token:
                publisher.publish(make())
                self.scheduler.at(self.scheduler.now_ns + period_ns, publish)

        publish()

    def silence(self, row: Topic) -> None:
        self._repeating.pop(row.name, None)

    def serve(self, row: Service, callback: Callable[[Any, Any], Any]) -> None:
        self.port.serve(row.type, row.name, lambda request, response, answer: answer(callback(request, response)))


class Source:
    """A source of the emergency stop that publishes its reports until ``end``."""

    def __init__(self, peer: Peer, name: str) -> None:
        stop, reports = peer.publisher(EMERGENCY_STOP), peer.publisher(EMERGENCY_STOP_SOURCES)
        self._source = StopSource(name, peer.port.process_id, stop, reports, peer.stamp)
        self._ended = False
        peer.run(_READY_S)  # until its publishers are discovered
        peer.scheduler.every(round(1e9 * _SOURCE_PERIOD_S), self._repeat)

    def publish(self, pressed: bool) -> None:
        self._source.publish(pressed)

    def end(self) -> None:
        """Stops the reports, like a dead process."""
        self._ended = True

    def _repeat(self) -> None:
        if not self._ended:
            self._source.repeat()


class BenchEngine:
    """A motion engine on drives without physics; it starts with ``run``. drives: for faults."""

    def __init__(self, scheduler: Scheduler, port: Port) -> None:
        self._scheduler, self._port = scheduler, port
        self._world: WorldEngine | None = None
        self._epoch = 0
        self.drives = VirtualDrives(8, 0.001)
        self._device: MotionEngine | None = None

    def run(self) -> BenchEngine:
        """Starts a new engine without starting communication."""
        config = load_engine_config()
        inputs = self.drives.inputs or {0: BUTTON_RELEASED, 1: EDGE_FREE}
        self.drives = VirtualDrives(config.n_axes, config.cycle_time_s)
        self.drives.inputs = inputs
        self._epoch += 1
        engine = Engine(config, self.drives)
        machine = cast(Simulation, SimpleNamespace(engine_stalled=False))
        world = self._world = WorldEngine(engine, machine, lambda: self._scheduler.now_s, epoch=self._epoch)

        def block() -> None:
            if not world.ended:
                for _ in range(_ENGINE_BLOCK_CYCLES):
                    engine.cycle()
                world.end_block()

        period_ns = round(1e9 * _ENGINE_BLOCK_CYCLES * config.cycle_time_s)
        self._scheduler.every(period_ns, block, start_ns=self._scheduler.now_ns + period_ns)
        self._device = world.open(self._port, lambda: True)
        return self

    def up(self) -> BenchEngine:
        """Starts the bus and switches the servos on."""
        self.device.api.StartCommunication()  # takes effect within the next cycles
        self._wait(lambda: self.device.read_status()[1].communicating, "communication")
        self.servos(True)
        return self

    def servos(self, on: bool) -> None:
        for axis in range(self.drives.n_axes):
            assert self.device.core_motion.axisControl.SetServoOn(axis, int(on)) == 0
        self._wait(lambda: all(bool(one) == on for one in self.device.read_status()[1].servo_on), f"servos {on}")

    def press(self, pressed: bool) -> None:
        """Sets the contact of the stop button."""
        self.drives.inputs = {0: BUTTON_PRESSED if pressed else BUTTON_RELEASED, 1: EDGE_FREE}

    def alarm(self, axis: int, code: int) -> None:
        """Raises an alarm that stays until ``recover``."""
        self.drives.stubborn = True
        self.drives.alarms[axis] = code

    def recover(self) -> None:
        """Recovers like the hardware interface after a fault: clears the alarms and switches the servos on."""
        self.drives.connected, self.drives.stubborn = True, False
        if not self.device.read_status()[1].communicating:
            self.device.api.StartCommunication()  # takes effect within the next cycles
            self._wait(lambda: self.device.read_status()[1].communicating, "communication")
        for axis in range(self.drives.n_axes):
            self.device.core_motion.axisControl.ClearAmpAlarm(axis)
        self._wait(lambda: not any(self.device.read_status()[1].amp_alarm), "no alarm")
        self.servos(True)

    def kill(self) -> None:
        assert self._world is not None
        self._world.ended = True

    def open(self, port: Port) -> MotionEngine:
        """Opens the engine for the node of a port. Raises EngineError."""
        if self._world is None or self._world.ended:
            code = ErrorCode.IMLibIsNotRunning
            raise EngineError(f"{port.name}: no motion engine runs", code, error_name(code))
        return self._world.open(port, lambda: runs(port))

    @property
    def device(self) -> MotionEngine:
        assert self._device is not None
        return self._device

    def _wait(self, condition: Callable[[], Any], what: str) -> None:
        assert self._scheduler.run_for(_LIMIT_S, condition), f"waited {_LIMIT_S} s of virtual time for {what}"


class Bench(Peer):
    """The common peer of every bench, with the nodes under test.

    engine: does not run before its ``run``. devices: display's cable, computer, disk, touch screen. expected_failures:
    processes that may fail.
    """

    def __init__(self, scheduler: Scheduler) -> None:
        super().__init__(scheduler, "peer")
        self.engine = BenchEngine(scheduler, self.port)
        self.devices = StackDevices(scheduler, self.engine.open, lambda: None)
        self.expected_failures: set[str] = set()

    def start(self, name: str, parameters: dict[str, Any] | None = None, *, known: bool = True) -> Process:
        """Starts a process of the contract and waits until it runs and is discovered.

        parameters: by dotted name. known: False returns at once.
        """
        process = self.scheduler.spawn(name, *node_factories(BY_NAME[name]), parameters={name: parameters or {}})
        if known:
            self.run(_READY_S)
        return process

    def start_again(self, process: Process) -> None:
        """Restarts a process that has ended, and waits until it is discovered."""
        process.start()
        self.run(_READY_S)

    def stop(self, process: Process) -> int:
        """Stops a process like SIGTERM. Returns the exit code."""
        process.stop()
        self.wait(lambda: not process.alive, f"the end of {process.name}")
        assert process.exit_code is not None
        return process.exit_code

    def peer(self, name: str, prepare: Callable[[Port], object] = lambda _: None) -> Peer:
        """Another node, which may have the name of one of the contract."""
        return Peer(self.scheduler, name, prepare)

    def heart(self, name: str) -> Peer:
        """A peer that only updates the node record of a contract's process, ten times a second."""

        def beat(port: Port) -> None:
            port.add_timer(0.1, lambda: port.node_record.beat(True, ""))

        return self.peer(name, beat)

    def source(self, name: str = "peer") -> Source:
        return Source(self, name)

    def assert_well(self) -> None:
        """Checks at the end of each test that no unexpected process failed."""
        failed = [item for item in self.scheduler.failures if item.process not in self.expected_failures]
        assert not failed, "\n".join(f"{1e-9 * item.time_ns:.3f} s {item.process}: {item.text}" for item in failed)


@contextmanager
def open_bench() -> Iterator[Bench]:
    with Scheduler(1, _params("peer")) as scheduler:
        made = Bench(scheduler)
        yield made
        made.assert_well()
