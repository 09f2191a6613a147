"""A ramp too steep to climb is still ground: the slope limit stops the robot on it, not an obstacle in front of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.contract.frames import OVERHEAD_LIDAR
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.perception.pipeline import Pipeline
from sim.lidar.bodies import robot_shapes
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import WHEELCHAIR, build_scene
from sim.lidar.sensor import Lidar
from sim.params import load_sim_params
from sim.worldfile import load_world
from tests.unit.space.yard import PARAMS, ROBOT, STEP_S, _track

FOOT_M, CREST_M, ASIDE_M = 1.5, 4.1, 0.5  # of config/worlds/steep_ramp.yaml
REACHED_M = 1.0  # of base_link: the front is at the foot
_ELSEWHERE = _track([(0.0, Pose2(100.0, 100.0, 0.0))])


class Ride:
    """Drives straight towards the ramp, with both LiDARs, until the front wheels are about to climb."""

    def __init__(self, seed: int, columns: int) -> None:
        world, chair = load_world("steep_ramp"), load_sim_params().wheelchair
        params, above = load_lidar_params().with_columns(columns), load_lidar_params(OVERHEAD_LIDAR)
        own = robot_shapes(ROBOT, load_robot_shape())
        self._lidar = Lidar(build_scene(world, params, chair), params, ROBOT, seed)
        self._overhead = Lidar(build_scene(world, above, chair, own=own), above, ROBOT, seed + 1, OVERHEAD_LIDAR)
        self.pipeline = Pipeline(ROBOT, PARAMS)
        self.pose, self._now_s, self._half = IDENTITY, 100.0, 0

    def step(self, vx_mps: float) -> NDArray[np.float32]:
        """Runs half a turn of the LiDAR. Returns the obstacles between robot and crest, (n, 3) odom."""
        self._now_s += STEP_S
        before, self.pose = self.pose, self.pose.compose(Pose2(vx_mps * STEP_S, 0.0, 0.0))
        self.pipeline.motion.on_odometry(self._now_s, self.pose, Twist2(vx_mps, 0.0, 0.0))
        base = _track([(self._now_s - STEP_S, before), (self._now_s, self.pose)])
        self._half = 1 - self._half
        if self._half:
            frame = self._overhead.sweep(base, self._now_s, {WHEELCHAIR: _ELSEWHERE})
            self.pipeline.overhead(frame.points, self._now_s)
        sweep = self._lidar.half_sweep(base, self._now_s, self._half, {WHEELCHAIR: _ELSEWHERE})
        found = self.pipeline.scene(sweep.points, self._now_s).obstacles
        found[:, 0] += np.float32(self.pose.x)
        return found[(np.abs(found[:, 1]) < ASIDE_M) & (found[:, 0] < CREST_M)]


@pytest.mark.parametrize(("columns", "seed"), [(400, 1), (400, 2), (800, 3)])
def test_steep_ramp_yields_no_obstacle_at_its_foot(columns: int, seed: int) -> None:
    """A remembered obstacle would stop the robot in front of it. Far up, single cells may appear as steps."""
    ride = Ride(seed, columns)
    while ride.pose.x < REACHED_M:
        found = ride.step(0.5)
        assert not (found[:, 0] < FOOT_M + 1.2).any(), ride.pose
