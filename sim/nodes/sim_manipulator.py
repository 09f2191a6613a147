"""Process sim_manipulator: the arm in physics and the simulated motion engine in lockstep with it."""

from __future__ import annotations

from sensor_msgs.msg import JointState

from robot_stack.contract import services, topics
from robot_stack.core.config import ConfigError
from robot_stack.wmx.config import EngineConfig
from sim.arm.model import FINGERS
from sim.arm.params import ArmParams, disagreement
from sim.arm.warm_up import warm_up
from sim.arm.world import ArmWorld
from sim.nodes.engine_host import EngineHost, run_engine_host
from sim.plant.engine_loop import EveryCycles


class SimManipulator(EngineHost):
    """Publishes the arm's true state; everything else about it goes through the engine."""

    plant: ArmWorld

    def __init__(self) -> None:
        super().__init__("sim_manipulator", ArmParams, services.INJECT_ARM_FAULT)
        self._names = [*self.params.names, *FINGERS]
        self._truth = self.advertise(topics.SIM_JOINT_STATES)

    def build(self, config: EngineConfig) -> ArmWorld:
        problem = disagreement(self.params, config)
        if problem:
            raise ConfigError(f"sim_manipulator.yaml does not fit the engine's configuration: {problem}")
        warm_up()
        return ArmWorld(self.params, config.cycle_time_s)

    def tasks(self) -> tuple[EveryCycles, ...]:
        return (EveryCycles(self.cycles(topics.SIM_JOINT_STATES.nominal_rate_hz), self._publish_truth),)

    def _publish_truth(self) -> None:
        truth = self.plant.truth()
        message = JointState(name=self._names)
        message.header.stamp = self.stamp()
        message.position = truth.positions.tolist()
        message.velocity = truth.speeds.tolist()
        message.effort = truth.efforts.tolist()
        self._truth.publish(message)


def main() -> None:
    raise SystemExit(run_engine_host(SimManipulator))


if __name__ == "__main__":
    main()
