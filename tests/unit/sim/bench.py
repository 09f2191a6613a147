"""A world with direct access to its drives: commands in joint units, as from an engine, without an engine."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.robot import Robot, load_robot
from robot_stack.wmx.bus import MODE_POSITION, MODE_VELOCITY, DriveCommands, DriveFeedback
from sim.params import SimParams, load_sim_params
from sim.plant.world import Setup, World
from sim.worldfile import load_world

ROBOT: Robot = load_robot()
PARAMS: SimParams = load_sim_params()
DRIVES, STEERS = [0, 2, 4, 6], [1, 3, 5, 7]
DRIVE_RAD_PER_COUNT = 2.0 * math.pi / ROBOT.drive.counts_per_turn
STEER_RAD_PER_COUNT = 2.0 * math.pi / ROBOT.steer.counts_per_turn


class Bench:
    """Steps a world at 1 ms and exchanges telegrams with its drives each time."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.out = DriveCommands.zeros(8, 8)
        self.inp = DriveFeedback.zeros(8, 8)
        self.out.mode[DRIVES] = MODE_VELOCITY
        self.out.mode[STEERS] = MODE_POSITION
        self.talking = True

    def run(self, duration_s: float, each: Callable[[], None] = lambda: None) -> None:
        for _ in range(round(duration_s / self.world.dt_s)):
            if self.talking:
                self.world.drives.exchange(self.out, self.inp)
            each()
            self.world.step()

    def servo(self, on: bool = True) -> None:
        self.out.servo_on[:] = on
        self.out.position_counts[:] = self.inp.position_counts
        self.run(0.1)

    def command(self, speeds_radps: NDArray[np.float64] | float, angles_rad: NDArray[np.float64] | float = 0.0) -> None:
        self.out.velocity_counts_per_s[DRIVES] = np.asarray(speeds_radps) / DRIVE_RAD_PER_COUNT
        self.out.position_counts[STEERS] = np.round(np.asarray(angles_rad) / STEER_RAD_PER_COUNT)

    def ramp(
        self,
        target_radps: NDArray[np.float64] | float,
        acceleration_mps2: float,
        angles_rad: NDArray[np.float64] | float = 0.0,
    ) -> None:
        """Moves the wheel speeds to ``target_radps`` with the same ramp for all."""
        start = self.out.velocity_counts_per_s[DRIVES] * DRIVE_RAD_PER_COUNT
        target = np.broadcast_to(np.asarray(target_radps, float), (4,))
        duration_s = float(np.max(np.abs(target - start))) * ROBOT.wheel_radius_m / acceleration_mps2
        n = max(1, round(duration_s / self.world.dt_s))
        k = 0

        def follow() -> None:
            nonlocal k
            k += 1
            self.command(start + (target - start) * k / n, angles_rad)

        self.run(n * self.world.dt_s, follow)

    def drive(self, twist: Twist2, acceleration_mps2: float = 1.0) -> None:
        """Steers the modules for a twist, then ramps the wheels up to it."""
        speeds, angles = wheels(twist)
        self.turn_modules(angles)
        self.ramp(speeds, acceleration_mps2, angles)

    def turn_modules(self, angles_rad: NDArray[np.float64], duration_s: float = 0.8) -> None:
        """Moves the steering axes along a smooth (cosine) profile with speed feed-forward, wheels at rest."""
        start = self.out.position_counts[STEERS] * STEER_RAD_PER_COUNT
        n = round(duration_s / self.world.dt_s)
        k = 0

        def follow() -> None:
            nonlocal k
            k += 1
            way = 0.5 * (1.0 - math.cos(math.pi * k / n))
            rate = 0.5 * math.pi / duration_s * math.sin(math.pi * k / n)
            self.command(0.0, start + (angles_rad - start) * way)
            self.out.velocity_counts_per_s[STEERS] = (angles_rad - start) * rate / STEER_RAD_PER_COUNT

        self.run(duration_s, follow)
        self.out.velocity_counts_per_s[STEERS] = 0.0
        self.run(0.1)

    def twist(self) -> Twist2:
        truth = self.world.truth()
        return Twist2(truth.linear_mps[0], truth.linear_mps[1], truth.angular_radps[2])


def wheels(twist: Twist2) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns wheel speeds rad/s and module angles rad (+-90 deg) of a twist: module v = (vx - w y, vy + w x)."""
    speeds, angles = np.zeros(4), np.zeros(4)
    for i, (x, y) in enumerate(ROBOT.module_positions_m()):
        vx, vy = twist.vx - twist.omega * y, twist.vy + twist.omega * x
        sign = 1.0 if vx > 1e-12 or (abs(vx) <= 1e-12 and vy > 0.0) else -1.0
        speeds[i] = sign * math.hypot(vx, vy) / ROBOT.wheel_radius_m
        angles[i] = math.atan2(sign * vy, sign * vx)
    return speeds, angles


def make_bench(
    world: str = "flat",
    seed: int = 1,
    start: Pose2 | None = None,
    passenger_kg: float | None = None,
    params: SimParams = PARAMS,
) -> Bench:
    """Returns a bench. If passenger_kg is given, a wheelchair with that passenger is attached."""
    file = load_world(world)
    attached = passenger_kg is not None
    setup = Setup(
        file,
        seed,
        start or file.start.pose(),
        wheelchair=attached,
        attached_at_start=attached,
        passenger_mass_kg=passenger_kg or 0.0,
    )
    return Bench(World(ROBOT, params, setup))
