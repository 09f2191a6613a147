"""How near the robot keeps to its planned path, in physics, by the truth and by its own estimate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Bool

from robot_stack.contract import frames, topics
from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from robot_stack.middleware.conversions import pose_stamped
from robot_stack.navigation.controller import Output, Situation
from robot_stack.navigation.path import Path
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.states import NavigationState
from tests.benchmarks.support.few_nodes import DRIVE, WITHOUT_MAP, FewNodes
from tests.benchmarks.support.framework import Aim, BenchError, Result

AIMS = {"rms_mm": Aim("<", 20.0)}
_WORLD = "flat"
_LEG_LIMIT_S = 60.0
# Spacing of the compared points of the path: on a corner of 1 m radius, chords deviate by 0.05 mm.
_SPACING_M, _POSES = 0.02, 5000


@dataclass(frozen=True, slots=True)
class Leg:
    """A goal. The robot stops at it, or the next goal is sent before."""

    goal: Pose2
    stop: bool


@dataclass(frozen=True, slots=True)
class Sample:
    """One tick of the navigation controller: its output, plan and pose, and the true state (poses in map)."""

    output: Output
    path: Path | None
    located: Located | None
    truth: Pose2
    true_twist: Twist2


class TrackedRide(FewNodes):
    """Drive, localization by wheels and gyro, and navigation in the world "flat". samples: one per tick."""

    def __init__(self, seed: int, *settings: str) -> None:
        nodes = (*DRIVE, "navigation_controller")
        super().__init__(seed, nodes, [f"sim_world.world={_WORLD}", *WITHOUT_MAP, *settings])
        self.samples: list[Sample] = []

    def __enter__(self) -> Self:
        super().__enter__()
        controller = self.node("navigation_controller").controller
        tick = controller.tick

        def noted(situation: Situation) -> Output:
            output: Output = tick(situation)
            self.samples.append(Sample(output, controller.path, situation.located, *self.truth()))
            return output

        controller.tick = noted
        return self

    def go(self, goal: Pose2) -> None:
        self.publish(topics.GOAL_POSE, pose_stamped(goal, frames.MAP, self.stamp()))


# Straight, diagonal with a change of yaw, then an S of three corners, the middle one with a change of yaw.
ROUTE = (
    Leg(Pose2(6.0, 0.0, 0.0), stop=True),
    Leg(Pose2(10.0, 4.0, 1.2), stop=True),
    Leg(Pose2(13.0, 1.0, 1.2), stop=False),
    Leg(Pose2(16.0, 4.0, 0.0), stop=False),
    Leg(Pose2(19.0, 1.0, 0.0), stop=True),
)


def run(
    speed_mps: float = 1.0, seeds: int = 3, stand_s: float = 10.0, pass_m: float = 1.0, passenger_kg: float = 0.0
) -> Result:
    """Returns (figures, conditions) of the route, driven once for each seed.

    stand_s: standstill before the ride, for the estimate of the gyro bias. pass_m: distance before a passed goal at
    which the next goal is sent. passenger_kg: above 0, with wheelchair and passenger and their limits.
    """
    rides = [ride(seed, speed_mps, stand_s, pass_m, passenger_kg) for seed in range(1, seeds + 1)]
    driving = [sample for samples in rides for sample in samples if sample.output.state is NavigationState.DRIVING]
    beside = _beside_mm(driving, lambda sample: sample.truth)
    estimated = _beside_mm(driving, _located)
    figures = {
        "rms_mm": _rms(beside),
        "max_mm": float(beside.max()),
        "estimate_rms_mm": _rms(estimated),
        "estimate_max_mm": float(estimated.max()),
        "position_rms_mm": _rms(_off_plan_mm(driving)),
        "yaw_max_deg": max(math.degrees(abs(wrap_angle(s.truth.yaw - _planned(s).yaw))) for s in driving),
        "localization_max_mm": 1e3 * max(_located(sample).distance_to(sample.truth) for sample in driving),
        "speed_max_mps": max(sample.true_twist.speed() for sample in driving),
    }
    return Result(
        figures,
        {
            "route": "6 m straight, 5.7 m diagonal turning 1.2 rad, S of 12.7 m with 3 corners turning 1.2 rad back",
            "speed_mps": speed_mps,
            "rides": f"{seeds}, seeds 1 to {seeds}: noise, wheel radii, steering zeros, phases of the nodes",
            "world": f"{_WORLD}; five nodes on the deterministic scheduler, the safety monitor is played",
            "load": f"wheelchair with {passenger_kg} kg" if passenger_kg > 0.0 else "empty robot",
            "rms_mm, max_mm": "distance of the true pose from the planned path, every 50 ms of driving",
            "estimate": "the same of the estimated pose: without the error of the localization",
            "position_rms_mm": "true position against the planned one at that moment, along the path included",
            "localization": "wheel odometry and gyro only, from the true start pose",
        },
    )


def ride(seed: int, speed_mps: float, stand_s: float, pass_m: float, passenger_kg: float = 0.0) -> list[Sample]:
    """One ride over the route. Raises BenchError if a goal is not reached."""
    settings = [f"navigation_controller.plan_spacing_m={_SPACING_M}", f"navigation_controller.plan_max_poses={_POSES}"]
    if passenger_kg > 0.0:
        settings += ["sim_world.attached_at_start=true", f"sim_world.passenger_mass_kg={passenger_kg}"]
    with TrackedRide(seed, *settings) as stack:
        if passenger_kg > 0.0:
            stack.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
        # Plans use a share of the limit, so the limit is raised to drive at the requested speed.
        stack.limit_mps = speed_mps / stack.node("navigation_controller").params.limits.speed_share
        stack.scheduler.run_for(stand_s)
        for leg in ROUTE:
            begin = len(stack.samples)
            stack.go(leg.goal)
            if not stack.scheduler.run_for(_LEG_LIMIT_S, _ended(stack, leg, begin, pass_m)):
                place = stack.truth()[0]
                raise BenchError(f"seed {seed}: {leg.goal} not reached in {_LEG_LIMIT_S} s, robot at {place}")
        return stack.samples


def _ended(stack: TrackedRide, leg: Leg, begin: int, pass_m: float) -> Callable[[], bool]:
    if leg.stop:
        return lambda: len(stack.samples) > begin and stack.samples[-1].output.reached
    return lambda: stack.truth()[0].distance_to(leg.goal) < pass_m


def _beside_mm(samples: Iterable[Sample], pose_of: Callable[[Sample], Pose2]) -> NDArray[np.float64]:
    """(n,) distances from the path."""
    distances = []
    for sample in samples:
        assert sample.path is not None
        pose = pose_of(sample)
        distances.append(1e3 * abs(sample.path.project(pose.x, pose.y)[1]))
    return np.array(distances)


def _off_plan_mm(samples: Iterable[Sample]) -> NDArray[np.float64]:
    return np.array([1e3 * sample.truth.distance_to(_planned(sample)) for sample in samples])


def _planned(sample: Sample) -> Pose2:
    assert sample.output.planned is not None
    return sample.output.planned


def _located(sample: Sample) -> Pose2:
    assert sample.located is not None
    return sample.located.pose


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))
