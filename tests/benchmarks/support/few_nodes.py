"""A few nodes of the stack on the deterministic scheduler, for benchmarks that do not need the whole robot.

A peer publishes in place of the safety monitor: the state NORMAL and a speed limit chosen by the benchmark.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

from builtin_interfaces.msg import Time

from custom_msgs.msg import SafetyStatus, VelocityLimit
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.geometry import Pose2, Twist2, exp_se2
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import Publisher
from sim.plant.world import World
from sim.scheduler.events import NANOSECONDS
from sim.stack.stack import SimulatedStack, StackSetup
from tests.benchmarks.support.framework import BenchError

DRIVE = ("sim_world", "swerve_hardware_interface", "swerve_controller", "ndt_localization")
# For a navigation controller without a LiDAR.
WITHOUT_MAP = ('navigation_controller.map=""', "navigation_controller.use_costmap=false")
_READY_S = 60.0
_DISCOVERED_S = 2.0


class FewNodes(SimulatedStack):
    """On entry, waits until all nodes are ready and have discovered each other.

    nodes: processes of the profile. settings: ``node.parameter=value``. Raises ConfigError; BenchError on entry.
    """

    def __init__(self, seed: int, nodes: Sequence[str], settings: Sequence[str]) -> None:
        own = 'ndt_localization.map=""', "sim_world.people=false", *settings
        super().__init__(StackSetup(seed, own, tuple(nodes)), parallel=False)
        self.limit_mps = math.inf
        self._publishers: dict[str, Publisher] = {}

    def __enter__(self) -> Self:
        super().__enter__()
        monitor = self.tool(topics.SAFETY_STATUS.publishers[0])
        status, limit = monitor.advertise(topics.SAFETY_STATUS), monitor.advertise(topics.VELOCITY_LIMIT)

        def publish() -> None:
            status.publish(SafetyStatus(safety_state=SafetyStatus.NORMAL, min_obstacle_distance=math.inf))
            limit.publish(VelocityLimit(max_linear_velocity=self.limit_mps, max_angular_velocity=math.inf))

        self.scheduler.every(round(NANOSECONDS / topics.VELOCITY_LIMIT.nominal_rate_hz), publish)
        if not self.scheduler.run_for(_READY_S, self.supervision.all_ready):
            waiting = self.supervision.waiting()
            self.__exit__()
            raise BenchError(f"seed {self.setup.seed}: not ready after {_READY_S:.0f} s: {waiting}")
        self.scheduler.run_for(_DISCOVERED_S)
        return self

    def node(self, name: str) -> Any:
        """The node of a process."""
        node = self.scheduler.processes[name].nodes[0]
        assert isinstance(node, StackNode)
        return node

    @property
    def physics(self) -> World:
        assert self.world is not None
        return self.world.sim.world

    def truth(self) -> tuple[Pose2, Twist2]:
        """True pose in map and true twist in base_link, now."""
        truth = self.physics.truth()
        twist = Twist2(truth.linear_mps[0], truth.linear_mps[1], truth.angular_radps[2])
        assert self.world is not None
        return truth.pose().compose(exp_se2(twist, self.world.age_s)), twist

    def publish(self, row: Topic, message: Any) -> None:
        """Publishes as a tool. The first call waits until the publisher is discovered."""
        publisher = self._publishers.get(row.name)
        if publisher is None:
            publisher = self._publishers[row.name] = self.advertise(row)
            self.scheduler.run_for(_DISCOVERED_S)
        publisher.publish(message)

    def stamp(self) -> Time:
        return time_from_s(self.operator.port.now_ns() / NANOSECONDS)
