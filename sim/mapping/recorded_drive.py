"""A manually driven robot and its sensor data, recorded in the recorder's format.

Physics, drives, sensors and the kernels of drive and odometry in lockstep. The driver gets the
true pose; only sensor data is recorded.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.frames import BASE_LINK
from robot_stack.core.geometry import Twist2
from robot_stack.drive.arbitration import Source
from robot_stack.drive.odometry import Encoders, Odometry
from sim.camera.history import BodyHistory
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.mapping.kernel_stack import KernelStack
from sim.mapping.ride_writer import RideWriter
from sim.params import load_sim_params
from sim.plant.imu import ImuSample
from sim.plant.wheelchair import matrix_of
from sim.plant.world import Setup

F64 = NDArray[np.float64]
_BODY_RATE_HZ = 100.0
_TURN_S = 0.15  # of the LiDAR, with room for the poses around it


class RecordedDrive(KernelStack):
    """movers: bodies visible to the LiDAR beside the world's own. true_poses: stamp and (4, 4) base_link in map of each
    sweep, only for evaluation.
    """

    def __init__(self, setup: Setup, bag: RideWriter, sweep_rate_hz: float, movers: Collection[str]) -> None:
        self._bag, self._movers = bag, movers
        self.bodies = BodyHistory()
        self.true_poses: list[tuple[float, F64]] = []
        super().__init__(setup)
        params = load_lidar_params()
        people = [walker.name for walker in self.sim.world.people]
        scene = build_scene(setup.world, params, load_sim_params().wheelchair, people=people)
        self.lidar = Lidar(scene, params, self.robot, setup.seed)
        self.every(_BODY_RATE_HZ, self._bodies_tick)
        self.every(sweep_rate_hz, self._sweep)

    @abstractmethod
    def requested(self) -> Twist2:
        """The driver's command."""

    def _navigation_tick(self) -> None:
        twist = self.requested()
        self._send(lambda: self.drive.on_command(Source.NAVIGATION, twist, self.time_s))

    # --- sensors -----------------------------------------------------------------------------------------------------

    def _imu(self, sample: ImuSample) -> None:
        super()._imu(sample)
        self._bag.imu(sample)

    def _odometry(self, encoders: Encoders) -> None:
        self._bag.joint_states(encoders)
        super()._odometry(encoders)

    def on_odometry(self, stamp_s: float, odometry: Odometry) -> None:
        self._bag.odometry(stamp_s, odometry)

    def _bodies_tick(self) -> None:
        self.bodies.add(self.time_s, {name: matrix_of(pose) for name, pose in self.sim.world.bodies()})

    def _sweep(self) -> None:
        stamp_s = self.bodies.newest_s
        if stamp_s is None or not self.bodies.covers(stamp_s - _TURN_S, stamp_s):
            return
        tracks = self.bodies.tracks()
        seen = {name: track for name, track in tracks.items() if name in self._movers}
        sweep = self.lidar.sweep(tracks[BASE_LINK], stamp_s, seen)
        self.true_poses.append((stamp_s, tracks[BASE_LINK].poses[-1]))
        self._bag.sweep(stamp_s, sweep.points)
