"""The physical world on the scheduler: physics, motion engine and simulated sensors in blocks of virtual time."""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Time

from robot_stack.docking.nodes.attached_file import AttachedFile
from robot_stack.middleware.conversions import NANOSECONDS
from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from sim.nodes.battery_driver import BatteryDriver
from sim.nodes.imu_driver import ImuDriver
from sim.nodes.sim_world import SimWorld
from sim.nodes.world_outputs import WorldOutputs, build_simulation
from sim.params import load_sim_params
from sim.plant.faults import Faults
from sim.stack.engine import WorldEngine

_TOUCHED_RATE_HZ = 10.0


class ScheduledWorld:
    """The process ``sim_world`` builds it when its nodes exist.

    now_ns: virtual time. ros_ns: the ROS clock at virtual time 0, which a step of the system clock changes.
    after_block: called at the end of each block.

    Raises ConfigError for a world that cannot be built.
    """

    def __init__(
        self, nodes: tuple[SimWorld, ImuDriver, BatteryDriver], now_ns: Callable[[], int], ros_ns: Callable[[], int]
    ) -> None:
        AttachedFile().forget()  # removes the state of the previous world's wheelchair
        self.node = nodes[0]
        params = load_sim_params()
        self.sim = build_simulation(self.node, params)
        self._ros_ns = ros_ns
        self._begun_ns = now_ns()
        self._now_ns = now_ns
        self._engines = 0
        self.engine = self._new_engine()
        self.faults = Faults(self.sim)
        self.node.inject = self.faults.inject
        self._outputs = WorldOutputs(nodes, self.sim, params, self._stamp)
        self._tasks = (
            *self._outputs.tasks(),
            self._outputs.every(_TOUCHED_RATE_HZ, self._outputs.publish_touched),
        )
        self.after_block: list[Callable[[], None]] = []
        self.block_steps: int = self.node.params.block_steps
        self.block_ns = round(NANOSECONDS * self.block_steps * self.sim.world.dt_s)
        self.ended = False
        self.node.set_health(True, f"world {self.node.params.world}, seed {self.node.params.seed}")

    @property
    def time_s(self) -> float:
        """Time since the start of the world."""
        return self.sim.time_s

    @property
    def age_s(self) -> float:
        """Time since the end of the newest block."""
        return (self._now_ns() - self._begun_ns) / NANOSECONDS - self.time_s

    def end(self) -> None:
        """Ends the world and its motion engine with their process; the last state stays readable."""
        self.ended = self.engine.ended = True

    def run_block(self) -> None:
        """Computes the block that ends now. Raises SimulationDiverged."""
        if self.ended:
            return
        sim, tasks = self.sim, self._tasks
        for _ in range(self.block_steps):
            sample = sim.step()
            self.faults.update()
            if sample is not None:
                self._outputs.publish_sample(sample)
            steps = sim.world.steps
            for task in tasks:
                if steps % task.period_steps == 0:
                    task.run()
        self.engine.end_block()
        for callback in self.after_block:
            callback()

    def switch_engine_off(self) -> None:
        """Power loss of the motion engine's computer: no telegram reaches the drives."""
        self.sim.engine_cycle = _no_cycle
        self.sim.world.drives.set_bus(False)

    def switch_engine_on(self) -> None:
        """Starts a new motion engine without the state of the previous one."""
        self.sim.world.drives.set_bus(True)
        self.engine = self._new_engine()

    def _new_engine(self) -> WorldEngine:
        self._engines += 1
        engine = Engine(load_engine_config(), self.sim.world.drives)
        self.sim.engine_cycle = engine.cycle
        return WorldEngine(engine, self.sim, lambda: self._now_ns() / NANOSECONDS, epoch=self._engines)

    def _stamp(self, time_s: float) -> Time:
        nanoseconds = self._ros_ns() + self._begun_ns + round(time_s * NANOSECONDS)
        return Time(sec=nanoseconds // NANOSECONDS, nanosec=nanoseconds % NANOSECONDS)


def _no_cycle() -> None:
    """Replaces the cycle while no engine runs."""
