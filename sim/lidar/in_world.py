"""The LiDAR of a running ``sim.plant.world.World``, in simulated time: for rides, maps and benches without ROS.

lidar = WorldLidar(world, load_lidar_params(), seed=1)
while ...:
    world.step()
    half = lidar.step()      # a half sweep every 50 ms of simulated time, None in between
    if half is not None and half.turn is not None: ...   # the full sweep it completes
"""

from __future__ import annotations

from dataclasses import dataclass

from sim.lidar.params import LidarParams
from sim.lidar.scene import build_scene
from sim.lidar.sensor import CLEAR, Conditions, Lidar, Sweep, join
from sim.lidar.sweeper import Sweeper
from sim.plant.wheelchair import matrix_of
from sim.plant.world import World

_SAMPLE_S = 0.01


@dataclass(frozen=True, slots=True)
class HalfSweep:
    """half: what has just been measured; turn: the full sweep that it completes, for every second one."""

    half: Sweep
    turn: Sweep | None


class WorldLidar:
    """``step`` after every step of the world."""

    def __init__(self, world: World, params: LidarParams, seed: int, *, passenger: bool = True) -> None:
        names = [walker.name for walker in world.people]
        scene = build_scene(world.setup.world, params, world.params.wheelchair, people=names, passenger=passenger)
        self.lidar = Lidar(scene, params, world.robot, seed)
        self.conditions: Conditions = CLEAR
        self._world, self._sweeper = world, Sweeper(self.lidar)
        self._every = max(1, round(_SAMPLE_S / world.dt_s))
        self._first: tuple[int, Sweep] | None = None

    def step(self) -> HalfSweep | None:
        world = self._world
        if world.steps % self._every:
            return None
        self._sweeper.add(world.time_s, {name: matrix_of(pose) for name, pose in world.bodies()})
        due = self._sweeper.due()
        if due is None:
            return None
        number, end_s = due
        half = self._sweeper.take(number, end_s, self.conditions)
        if number % 2:
            self._first = (number, half)
            return HalfSweep(half, None)
        whole = self._first is not None and self._first[0] == number - 1
        return HalfSweep(half, join(self._first[1], half) if self._first is not None and whole else None)
