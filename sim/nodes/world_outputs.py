"""Topics and rates of the world's nodes, equal for every way to run a simulation."""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Time

from robot_stack.contract import topics
from robot_stack.core.config import ConfigError
from sim.nodes.battery_driver import BatteryDriver
from sim.nodes.imu_driver import ImuDriver
from sim.nodes.sim_world import SimWorld
from sim.params import SimParams
from sim.plant.imu import ImuSample
from sim.plant.simulation import Simulation
from sim.run.loop import Task

_SENSOR_WATCH_RATE_HZ = 10.0


def build_simulation(node: SimWorld, params: SimParams) -> Simulation:
    """Raises ConfigError for a world that cannot be built."""
    try:
        return Simulation(node.robot, params, node.setup)
    except ValueError as error:
        raise ConfigError(f"sim_world: {error}") from error


class WorldOutputs:
    """stamp: the time on the nodes' clock of a simulated time."""

    def __init__(
        self,
        nodes: tuple[SimWorld, ImuDriver, BatteryDriver],
        sim: Simulation,
        params: SimParams,
        stamp: Callable[[float], Time],
    ) -> None:
        self._world, self._imu, self._battery = nodes
        self._sim, self._params, self._stamp = sim, params, stamp
        self._world.request_door = sim.world.building.request

    def tasks(self) -> tuple[Task, ...]:
        return (
            self.every(topics.SIM_GROUND_TRUTH.nominal_rate_hz, self._publish_truth),
            self.every(topics.BUILDING_STATE.nominal_rate_hz, self._publish_doors),
            self.every(topics.BATTERY_STATE.nominal_rate_hz, self._publish_battery),
            self.every(_SENSOR_WATCH_RATE_HZ, lambda: self._imu.watch(self._sim.time_s)),
        )

    def every(self, rate_hz: float, run: Callable[[], None]) -> Task:
        return Task(round(1.0 / (rate_hz * self._sim.world.dt_s)), run)

    def publish_sample(self, sample: ImuSample) -> None:
        self._imu.publish(sample, self._stamp(sample.time_s))

    def publish_touched(self) -> None:
        self._world.publish_touched(self._sim.world.touched)

    def _publish_truth(self) -> None:
        stamp = self._stamp(self._sim.time_s)
        self._world.publish_truth(self._sim.world.truth(), stamp)
        self._world.publish_bodies(self._sim.world.bodies(), stamp)

    def _publish_doors(self) -> None:
        self._world.publish_doors(self._sim.world.building.reports(), self._stamp(self._sim.time_s))

    def _publish_battery(self) -> None:
        reading = self._sim.battery.read()
        self._battery.publish(reading, self._params.battery.capacity_ah, self._stamp(self._sim.time_s))
