"""Error of the wheel odometry: on perfect encoders beside WPILib's, and its drift in physics."""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass

import numpy as np

from robot_stack.core.geometry import IDENTITY, Twist2
from robot_stack.core.robot import load_robot
from robot_stack.drive.kinematics import ModuleSetPoints
from sim.params import load_sim_params
from sim.plant.rig import Rig, TwistController
from sim.plant.world import Setup
from sim.worldfile import load_world
from tests.benchmarks.support.framework import Aim, Result
from tests.benchmarks.support.perfect_ride import RATE_HZ, error_m, mixed_twist, perfect_ride, wpilib_error_m

AIMS = {"integration_error_mm": Aim("<", 2.0), "drift_pct_100m": Aim("<", 0.5)}
_WORLD = "flat"
# The mean speed of the mixed ride exceeds this, the ramp at the start included.
_LEAST_MEAN_MPS = 0.9


@dataclass(frozen=True, slots=True)
class Drift:
    """of_way: distance between odometry and truth at the end over the length of the true path. yaw_rad: yaw error over
    the same.
    """

    of_way: float
    yaw_rad: float
    distance_m: float


def run(distance_m: float = 78.0, drift_m: float = 100.0, seeds: int = 3) -> Result:
    """Returns (figures, conditions).

    distance_m: of the ride with perfect encoders. drift_m: of each ride in physics. seeds: number of machines, each
    with its own wheel radii, steering zeros and noise.
    """
    robot = load_robot()
    ride = perfect_ride(robot, distance_m)
    figures = {"integration_error_mm": 1e3 * error_m(ride, robot)}
    conditions: dict[str, object] = {
        "distance_m": ride.distance_m,
        "rate_hz": RATE_HZ,
        "integration": "distance of the last pose from the truth; encoders perfect; the ride is mixed_twist",
        "wpilib": "SwerveDrive4Odometry on the same readings, with a perfect gyro",
        "drift": f"mean over {seeds} seeds of the distance at the end over the way; the same ride in physics, no gyro",
        "world": _WORLD,
    }
    try:
        figures["wpilib_error_mm"] = 1e3 * wpilib_error_m(ride, robot)
    except ImportError as error:
        conditions["wpilib"] = f"not measured: {error}"
    drifts = [drift(seed, drift_m) for seed in range(1, seeds + 1)]
    figures["drift_pct_100m"] = 100.0 * statistics.fmean(item.of_way for item in drifts)
    figures["drift_pct_100m_worst"] = 100.0 * max(item.of_way for item in drifts)
    figures["yaw_drift_deg_worst"] = math.degrees(max(abs(item.yaw_rad) for item in drifts))
    conditions["drift_way_m"] = [round(item.distance_m, 1) for item in drifts]
    return Result(figures, conditions)


def drift(seed: int, distance_m: float) -> Drift:
    """Odometry against the truth after a mixed ride of ``distance_m`` in physics, with parameters of the seed."""
    rig = Rig(load_robot(), load_sim_params(), Setup(load_world(_WORLD), seed, IDENTITY))
    controller = TwistController(rig.robot, _course, passenger=False)
    start = last = rig.moment().pose
    made_m = 0.0

    def each(_: ModuleSetPoints | None) -> None:
        nonlocal last, made_m
        pose = rig.moment().pose
        last, made_m = pose, made_m + pose.distance_to(last)

    while made_m < distance_m:
        rig.run(max(1.0, (distance_m - made_m) * _LEAST_MEAN_MPS), controller, each)
    controller.observe(rig.encoders())
    truth = rig.moment().pose.relative_to(start)
    yaw_error = math.remainder(controller.odometry.pose.yaw - truth.yaw, 2.0 * math.pi)
    return Drift(controller.odometry.pose.distance_to(truth) / made_m, yaw_error, made_m)


def _course(time_s: float) -> Twist2:
    vx, vy, omega = (float(row[0]) for row in mixed_twist(np.array([time_s])))
    return Twist2(vx, vy, omega)
