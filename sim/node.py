"""Process sim_world: physics and motion engine in the main thread, ROS in a second one.

The main thread steps engine, drives, physics and sensors every millisecond and publishes; the second thread serves the
ROS side that may wait: services, timers of heartbeat and diagnostics, /clock.
"""

from __future__ import annotations

import gc
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import cast

from builtin_interfaces.msg import Time

from robot_stack.contract import topics
from robot_stack.contract.model import ContractViolation
from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import AlreadyRunning, runtime_dir
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.process import EXIT_CRASHED, EXIT_REFUSED, StopSignal, ros_process
from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.simulated.engine import Engine
from robot_stack.wmx.simulated.server import EngineServer
from sim.faults import Faults
from sim.imu import ImuSample
from sim.lockstep import Lockstep
from sim.loop import Loop, Task
from sim.nodes.battery_driver import BatteryDriver
from sim.nodes.imu_driver import ImuDriver
from sim.nodes.sim_world import SimWorld
from sim.pacing import Pacer
from sim.parameters import SimParams, load_sim_params
from sim.simulation import Simulation

_NANOSECONDS = 1_000_000_000
_CLOCK_RATE_HZ = 100.0
_REPORT_RATE_HZ = 1.0
_SENSOR_WATCH_RATE_HZ = 10.0
_WAIT_S = 0.005


class WorldProcess:
    """Engine, world, sensors and their nodes, wired together."""

    def __init__(self, world_node: SimWorld, imu_node: ImuDriver, battery_node: BatteryDriver) -> None:
        self._node, self._imu_node, self._battery_node = world_node, imu_node, battery_node
        self._params: SimParams = load_sim_params()
        self._sim = _build(world_node, self._params)
        self.server = _serve_engine(self._sim)
        dt_s = self._sim.world.dt_s
        settings = world_node.params
        self._pacer = Pacer(dt_s, settings.speed, settings.catch_up_s, time.monotonic())
        self._loop = Loop(self._sim, Faults(self._sim), self._pacer, self._tasks(dt_s), self._on_sample)
        world_node.inject = self._loop.inject
        self._lockstep = world_node.lockstep(lambda: self._sim.time_s) if settings.wait_for_stack_s else None
        self._waited_s = 0.0

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Until ``should_stop`` says so. Raises SimulationDiverged."""
        gc.collect()
        gc.freeze()  # what exists now stays: spares the loop the collector's long pauses
        self._loop.run(should_stop)

    def _tasks(self, dt_s: float) -> tuple[Task, ...]:
        def every(rate_hz: float | None, run: object) -> Task:
            assert rate_hz is not None
            return Task(round(1.0 / (rate_hz * dt_s)), run)  # type: ignore[arg-type]

        tasks = [
            every(topics.SIM_GROUND_TRUTH.rate_hz, self._publish_truth),
            every(topics.BATTERY_STATE.rate_hz, self._publish_battery),
            every(_SENSOR_WATCH_RATE_HZ, lambda: self._imu_node.watch(self._sim.time_s)),
            every(_REPORT_RATE_HZ, self._report),
        ]
        return tuple(tasks) if self._node.real_time else (every(_CLOCK_RATE_HZ, self._tick), *tasks)

    def _tick(self) -> None:
        """Tells the time, after everybody has followed up to it."""
        if self._lockstep is not None:
            self._wait_for_stack(self._lockstep)
        self._node.publish_clock(self._stamp(self._sim.time_s))

    def _wait_for_stack(self, lockstep: Lockstep) -> None:
        start_s = now_s = time.monotonic()
        behind = lockstep.behind(self._sim.time_s)
        while behind and now_s - start_s < self._node.params.wait_for_stack_s:
            self._node.publish_clock(self._stamp(self._sim.time_s))  # the one before may have been lost
            time.sleep(_WAIT_S)
            behind, now_s = lockstep.behind(self._sim.time_s), time.monotonic()
        lockstep.give_up(behind)
        self._waited_s += now_s - start_s

    def _stamp(self, time_s: float) -> Time:
        """The time on the nodes' clock at a simulated time."""
        if self._node.real_time:
            nanoseconds = time.time_ns() - round((self._sim.time_s - time_s) * _NANOSECONDS)
        else:
            nanoseconds = round((self._node.params.clock_start_s + time_s) * _NANOSECONDS)
        return Time(sec=nanoseconds // _NANOSECONDS, nanosec=nanoseconds % _NANOSECONDS)

    def _on_sample(self, sample: ImuSample) -> None:
        self._imu_node.publish(sample, self._stamp(sample.time_s))

    def _publish_truth(self) -> None:
        stamp = self._stamp(self._sim.time_s)
        self._node.publish_truth(self._sim.world.truth(), stamp)
        self._node.publish_bodies(self._sim.world.bodies(), stamp)

    def _publish_battery(self) -> None:
        reading = self._sim.battery.read()
        self._battery_node.publish(reading, self._params.battery.capacity_ah, self._stamp(self._sim.time_s))

    def _report(self) -> None:
        self._node.publish_touched(self._sim.world.touched)
        report = self._pacer.report(time.monotonic())
        self._node.show_pace(report, self._pacer.total_overruns, self._pacer.total_dropped_s, self._waited_s)


def _build(node: SimWorld, params: SimParams) -> Simulation:
    try:
        return Simulation(node.robot, params, node.setup)
    except ValueError as error:
        raise ConfigError(f"sim_world: {error}") from error


def _serve_engine(sim: Simulation) -> EngineServer:
    """The simulated engine on the world's drives, in lockstep with it. Raises ConfigError, AlreadyRunning."""
    config = load_engine_config()
    if config.cycle_time_s != sim.world.dt_s:
        raise ConfigError(
            f"wmx_engine.yaml: cycle_time_s ({config.cycle_time_s}) must equal sim.yaml's timestep_s ({sim.world.dt_s})"
        )
    server = EngineServer(Engine(config, sim.world.drives), runtime_dir())
    sim.engine_cycle = server.cycle
    return server


def run_world() -> int:
    """Runs the process until SIGINT or SIGTERM. Returns the exit code."""
    should_stop = StopSignal()
    try:
        with ros_process(SimWorld, ImuDriver, BatteryDriver) as (executor, nodes):
            world_node, imu_node, battery_node = nodes
            process = WorldProcess(
                cast(SimWorld, world_node), cast(ImuDriver, imu_node), cast(BatteryDriver, battery_node)
            )
            sys.setswitchinterval(world_node.params.thread_switch_interval_s)
            _run_beside(process, executor, should_stop)
    except (ConfigError, AlreadyRunning, ContractViolation, OSError) as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return EXIT_REFUSED
    except Exception:
        traceback.print_exc()
        return EXIT_CRASHED
    return 0


def _run_beside(process: WorldProcess, executor: LeanExecutor, should_stop: StopSignal) -> None:
    """The world in this thread, ROS callbacks in another; neither goes on without the other."""
    callbacks = threading.Thread(target=executor.spin, name="ros", daemon=True)
    callbacks.start()
    try:
        process.run(lambda: should_stop() or not callbacks.is_alive())
        if not should_stop():
            raise RuntimeError("the ROS thread has ended")
    finally:
        executor.stop()
        callbacks.join(2.0)
        process.server.engine.stop_engine()
        process.server.close()


def main() -> None:
    raise SystemExit(run_world())
