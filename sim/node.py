"""Process sim_world: physics and motion engine in the main thread, ROS in a second one.

The main thread steps engine, drives, physics and sensors every millisecond and publishes; the second thread serves the
ROS side that may wait: services, timers of heartbeat and diagnostics.
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

from robot_stack.contract.model import ContractViolation
from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import AlreadyRunning, runtime_dir
from robot_stack.docking.nodes.attached_file import AttachedFile
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.process import EXIT_CRASHED, EXIT_REFUSED, StopSignal, ros_process
from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.server import EngineServer
from sim.nodes.battery_driver import BatteryDriver
from sim.nodes.imu_driver import ImuDriver
from sim.nodes.sim_world import SimWorld
from sim.nodes.world_outputs import WorldOutputs, build_simulation
from sim.nodes.world_time import WorldTime
from sim.params import load_sim_params
from sim.plant.faults import Faults
from sim.plant.simulation import Simulation
from sim.run.loop import Loop, Task
from sim.run.pacing import Pacer
from sim.run.processes import Processes

_NANOSECONDS = 1_000_000_000
_CLOCK_RATE_HZ = 100.0
_REPORT_RATE_HZ = 1.0


class WorldProcess:
    """Engine, world, sensors and their nodes, wired together."""

    def __init__(self, world_node: SimWorld, imu_node: ImuDriver, battery_node: BatteryDriver) -> None:
        self._node = world_node
        params = load_sim_params()
        self._sim = build_simulation(world_node, params)
        self._outputs = WorldOutputs((world_node, imu_node, battery_node), self._sim, params, self._stamp)
        self.server = _serve_engine(self._sim)
        dt_s = self._sim.world.dt_s
        settings = world_node.params
        block = settings.block_steps
        self._pacer = Pacer(block * dt_s, settings.speed, settings.catch_up_s, time.monotonic())
        processes = self._sim.processes = Processes()
        self._time = None if world_node.real_time else WorldTime(world_node, processes, self._serve)
        self._should_stop: Callable[[], bool] = lambda: False
        self._loop = Loop(
            self._sim,
            Faults(self._sim),
            self._pacer,
            self._tasks(dt_s),
            self._outputs.publish_sample,
            block,
            self._before_block,
        )
        world_node.inject = self._loop.inject

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Runs until ``should_stop`` returns True. Raises SimulationDiverged."""
        gc.collect()
        gc.freeze()  # present objects stay: exclude them from garbage collection in the loop
        self._should_stop = should_stop
        self._loop.run(should_stop)

    def _tasks(self, dt_s: float) -> tuple[Task, ...]:
        every = self._outputs.every
        tasks = (*self._outputs.tasks(), every(_REPORT_RATE_HZ, self._report))
        if self._time is None:
            return tasks
        clock = self._time
        block = self._node.params.block_steps
        write = Task(block, lambda: clock.write(self._sim.time_s, block * dt_s))
        return (write, every(_CLOCK_RATE_HZ, lambda: clock.publish(self._sim.time_s)), *tasks)

    def _before_block(self) -> None:
        if self._time is not None:
            self._time.follow(self._sim.time_s, self._should_stop)

    def _serve(self) -> None:
        """Serves requests of other processes while the world waits for them."""
        self._loop.requests.serve()
        if not self._sim.engine_stalled:
            self.server.poll()

    def _stamp(self, time_s: float) -> Time:
        """The time on the nodes' clock at a simulated time."""
        if self._time is not None:
            return self._time.stamp(time_s)
        nanoseconds = time.time_ns() - round((self._loop.block_end_s - time_s) * _NANOSECONDS)
        return Time(sec=nanoseconds // _NANOSECONDS, nanosec=nanoseconds % _NANOSECONDS)

    def _report(self) -> None:
        self._outputs.publish_touched()
        report = self._pacer.report(time.monotonic())
        waited_s = 0.0 if self._time is None else self._time.waited_s
        if self._time is not None:
            self._time.write_pace(report.speed)
        self._node.show_pace(report, self._pacer.total_overruns, self._pacer.total_dropped_s, waited_s)


def _serve_engine(sim: Simulation) -> EngineServer:
    """The simulated engine on the world's drives, in lockstep with it. Raises ConfigError, AlreadyRunning."""
    config = load_engine_config()
    if config.cycle_time_s != sim.world.dt_s:
        raise ConfigError(
            f"wmx_engine.yaml: cycle_time_s ({config.cycle_time_s}) must equal sim.yaml's timestep_s ({sim.world.dt_s})"
        )
    AttachedFile().forget()  # not the wheelchair of the previous world
    server = EngineServer(Engine(config, sim.world.drives), runtime_dir())
    sim.engine_begin, sim.engine_cycle, sim.engine_end = server.begin, server.engine.cycle, server.end
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
