"""A manually driven robot and its sensor data, recorded in the recorder's format.

Physics, engine, sensors and the drive's kernels in one process. The driver gets the true pose; only sensor data is
recorded.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract import topics
from robot_stack.contract.frames import BASE_LINK
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.robot import load_robot
from robot_stack.drive.kinematics import ModuleSetPoints
from robot_stack.drive.odometry import Encoders
from sim.camera.history import BodyHistory
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.mapping.ride_writer import RideWriter
from sim.params import load_sim_params
from sim.plant.rig import Rig, TwistController
from sim.plant.wheelchair import matrix_of
from sim.plant.world import Setup

F64 = NDArray[np.float64]
_TURN_S = 0.15  # of the LiDAR, with room for the poses around it


class RecordedDrive(TwistController):
    """movers: bodies visible to the LiDAR beside the world's own. true_poses: stamp and (4, 4) base_link in map of each
    sweep, only for evaluation.
    """

    def __init__(self, setup: Setup, bag: RideWriter, sweep_rate_hz: float, movers: Collection[str]) -> None:
        self.robot = load_robot()
        super().__init__(self.robot, lambda _: self.requested(), setup.attached_at_start)
        self._bag, self._movers = bag, movers
        self.bodies = BodyHistory()
        self.true_poses: list[tuple[float, F64]] = []
        sim_params, params = load_sim_params(), load_lidar_params()
        self._rig = Rig(self.robot, sim_params, setup)
        self._rig.on_imu = bag.imu
        self.sim = self._rig.sim
        people = [walker.name for walker in self.sim.world.people]
        scene = build_scene(setup.world, params, sim_params.wheelchair, people=people)
        self.lidar = Lidar(scene, params, self.robot, setup.seed)
        self._readings = 0
        self._sweep_readings = round(topics.JOINT_STATES.nominal_rate_hz / sweep_rate_hz)

    @property
    def time_s(self) -> float:
        return self.sim.time_s

    def truth(self) -> Pose2:
        """True pose in map."""
        return self.sim.world.truth().pose()

    def run(self, duration_s: float) -> None:
        self._rig.run(duration_s, self, self._sense)

    @abstractmethod
    def requested(self) -> Twist2:
        """The driver's command."""

    # --- sensors -----------------------------------------------------------------------------------------------------

    def observe(self, encoders: Encoders) -> None:
        super().observe(encoders)
        self._bag.joint_states(encoders)
        self._bag.odometry(encoders.stamp_s, self.odometry)

    def _sense(self, _: ModuleSetPoints | None) -> None:
        self.bodies.add(self.time_s, {name: matrix_of(pose) for name, pose in self.sim.world.bodies()})
        self._readings += 1
        if self._readings % self._sweep_readings == 0:
            self.sense()

    def sense(self) -> None:
        """Records a sweep, at the rate of sweeps."""
        stamp_s = self.bodies.newest_s
        if stamp_s is None or not self.bodies.covers(stamp_s - _TURN_S, stamp_s):
            return
        tracks = self.bodies.tracks()
        seen = {name: track for name, track in tracks.items() if name in self._movers}
        sweep = self.lidar.sweep(tracks[BASE_LINK], stamp_s, seen)
        self.true_poses.append((stamp_s, tracks[BASE_LINK].poses[-1]))
        self._bag.sweep(stamp_s, sweep.points)
