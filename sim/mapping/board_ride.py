"""A robot driven by hand before the wheelchair's markers, recorded with its front camera, for ``robot-stack calibrate
extrinsics``: ``python -m sim.mapping.board_ride FOLDER [--seed N]``.

It stops at places to and fro and to both sides, turned to both sides, in sight of the markers. The camera's mount and
optics are off by what ``config/sim_camera.yaml`` allows.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from rich.progress import Progress

from robot_stack.contract.frames import FRONT_CAMERA
from robot_stack.core.camera import camera_file, load_intrinsics, mounting
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2, Twist2
from sim.camera.model import TrueCamera, draw_camera
from sim.camera.params import load_camera_params
from sim.camera.render import Renderer
from sim.camera.scenery import build_scenery
from sim.mapping.recorded_drive import RecordedDrive
from sim.mapping.ride_writer import RideWriter
from sim.plant.terrain import solids
from sim.plant.world import WHEELCHAIR, Setup
from sim.worldfile import WorldFile, load_world

_RATE_HZ = 2.0  # of sweeps and images, as config/recorder.yaml has it
_PLACES, _MOVE_S, _STAND_S = 36, 1.4, 1.4
_BEFORE_M = 2.5  # from base_link to the board, in the middle
_AHEAD_M, _ASIDE_M, _TURN_RAD = 0.8, 0.4, math.radians(14.0)
_GAIN_HZ, _LIMIT_MPS, _LIMIT_RADPS = 2.5, 0.5, 0.4
_IMAGE_AFTER_S = 0.05  # the picture's last row, and poses around it


class BoardRide(RecordedDrive):
    """camera: the true camera of the pictures; by default drawn by the seed."""

    def __init__(self, world: WorldFile, bag: RideWriter, seed: int, camera: TrueCamera | None = None) -> None:
        docks, params = load_docks(), load_camera_params()
        self._dock = next(name for name, dock in docks.docks.items() if dock.kind == "wheelchair")
        place = world.wheelchair
        assert place is not None, "the world has no wheelchair"
        self._middle = place.pose().compose(Pose2(-_BEFORE_M, 0.0, 0.0))
        self._start_s, self._exposed_s = math.inf, -math.inf
        super().__init__(Setup(world, seed=seed, start=self._middle), bag, _RATE_HZ, [WHEELCHAIR])
        self._start_s = self.time_s + _STAND_S
        random = np.random.default_rng([seed, 0])
        calibrated = load_intrinsics(camera_file(FRONT_CAMERA))
        drawn = draw_camera(FRONT_CAMERA, calibrated, mounting(self.robot, FRONT_CAMERA), params, random)
        self.camera = camera or drawn
        self._renderer = Renderer(self.camera, docks, params, random, build_scenery(solids(world), docks))

    @property
    def places(self) -> int:
        """Number of visited ``_PLACES``."""
        return int(max(0.0, self.time_s - self._start_s) / (_MOVE_S + _STAND_S))

    def requested(self) -> Twist2:
        """Drives to the next place, and stands there."""
        at_s = self.time_s - self._start_s
        if at_s < 0.0 or at_s % (_MOVE_S + _STAND_S) > _MOVE_S or self.places >= _PLACES:
            return Twist2(0.0, 0.0, 0.0)
        error = self._middle.compose(_place(self.places)).relative_to(self.truth())
        return Twist2(
            _limited(_GAIN_HZ * error.x, _LIMIT_MPS),
            _limited(_GAIN_HZ * error.y, _LIMIT_MPS),
            _limited(_GAIN_HZ * error.yaw, _LIMIT_RADPS),
        )

    def sense(self) -> None:
        """A sweep and an image."""
        super().sense()
        newest_s = self.bodies.newest_s
        if newest_s is None or not self.bodies.covers(newest_s - 2.0 * _IMAGE_AFTER_S, newest_s):
            return
        stamp_s = newest_s - _IMAGE_AFTER_S
        picture = self._renderer.render(self.bodies.motion(stamp_s, {WHEELCHAIR: self._dock}))
        self._bag.image(stamp_s, FRONT_CAMERA, picture)


def _place(number: int) -> Pose2:
    turn = math.tau * number / _PLACES
    return Pose2(_AHEAD_M * math.sin(turn), _ASIDE_M * math.sin(2.0 * turn), _TURN_RAD * math.sin(7.0 * turn))


def _limited(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def record(folder: Path, seed: int, camera: TrueCamera | None = None) -> BoardRide:
    """Drives and records."""
    with RideWriter(folder) as bag, Progress() as progress:
        ride = BoardRide(load_world("yard"), bag, seed, camera)
        task = progress.add_task("driving", total=_PLACES)
        while ride.places < _PLACES:
            ride.run(1.0)
            progress.update(task, completed=ride.places)
        ride.run(_STAND_S)
    return ride


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1, help="of the camera's errors and all noise")
    arguments = parser.parse_args()
    record(arguments.folder, arguments.seed)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
