"""Node sim_world: ground truth, /clock and fault injection."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated

import numpy as np
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from pydantic import Field, model_validator
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from custom_msgs.msg import BuildingRequest, BuildingState
from robot_stack.contract import frames, services, topics
from robot_stack.core.config import Config, ConfigError
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.world_clock import slow_text
from robot_stack.middleware.node import StackNode
from sim.nodes.fault_service import serve_faults
from sim.nodes.message_bytes import Numbers, Transforms
from sim.plant.doors import DoorReport
from sim.plant.warm_up import warm_up
from sim.plant.world import Setup, Truth
from sim.run.pacing import PaceReport
from sim.run.requests import NotServed
from sim.worldfile import load_world

REAL_TIME = 1.0


class SimWorldParams(Config):
    """``config/sim_world.yaml``."""

    world: str
    seed: Annotated[int, Field(ge=0)]
    speed: Annotated[float, Field(gt=0.0, le=1000.0)]
    start_x_m: float | None
    start_y_m: float | None
    start_yaw_rad: float | None
    wheelchair: bool
    wheelchair_x_m: float | None
    wheelchair_y_m: float | None
    wheelchair_yaw_rad: float | None
    attached_at_start: bool
    passenger_mass_kg: Annotated[float, Field(ge=0.0)]
    people: bool
    slope_rad: Annotated[float, Field(gt=-1.0, lt=1.0)]
    slope_direction_rad: float
    block_steps: Annotated[int, Field(ge=1, le=10)]
    catch_up_s: Annotated[float, Field(gt=0.0)]
    wait_tolerance_s: Annotated[float, Field(gt=0.0, le=0.5)]
    thread_switch_interval_s: Annotated[float, Field(gt=0.0)]
    clock_start_s: Annotated[float, Field(gt=0.0)]

    def setup(self) -> Setup:
        """The set-up from these parameters. Raises ConfigError for an unknown or invalid world."""
        file = load_world(self.world)
        start = _either((self.start_x_m, self.start_y_m, self.start_yaw_rad), file.start.pose())
        chair = (self.wheelchair_x_m, self.wheelchair_y_m, self.wheelchair_yaw_rad)
        own = file.wheelchair.pose() if file.wheelchair is not None else None
        if own is None and None not in chair:
            own = IDENTITY
        return Setup(
            file,
            self.seed,
            start,
            wheelchair=self.wheelchair,
            attached_at_start=self.attached_at_start,
            passenger_mass_kg=self.passenger_mass_kg,
            wheelchair_pose=None if own is None else _either(chair, own),
            people=self.people,
            slope_rad=self.slope_rad,
            slope_direction_rad=self.slope_direction_rad,
        )

    @model_validator(mode="after")
    def _wheelchair_has_a_place(self) -> SimWorldParams:
        chair = (self.wheelchair_x_m, self.wheelchair_y_m, self.wheelchair_yaw_rad)
        if len({value is None for value in chair}) > 1:
            raise ValueError("wheelchair_x_m, wheelchair_y_m and wheelchair_yaw_rad are given together or not at all")
        return self


def _either(given: tuple[float | None, float | None, float | None], default: Pose2) -> Pose2:
    x, y, yaw = given
    return Pose2(default.x if x is None else x, default.y if y is None else y, default.yaw if yaw is None else yaw)


class SimWorld(StackNode):
    """Publishes the output of the simulation loop. The loop sets ``inject``, which passes faults to it."""

    def __init__(self) -> None:
        super().__init__("sim_world", SimWorldParams)
        if self.params.speed != REAL_TIME and not self.simulated_time:
            raise ConfigError("sim_world: speed: other than 1.0 needs use_sim_time, the system clock has no other")
        warm_up()
        self.setup = self.params.setup()
        self.inject: Callable[[str, str, float, float], str] = _not_running
        self._truth = self.advertise(topics.SIM_GROUND_TRUTH)
        self._joints = self.advertise(topics.SIM_JOINT_STATES)
        self._bodies = self.advertise(topics.SIM_BODIES)
        odometry = Odometry(child_frame_id=frames.BASE_LINK)
        odometry.header.frame_id = frames.MAP
        none = [0.0] * len(frames.JOINTS)
        self._odometry_bytes, self._body_bytes = Numbers(odometry), Transforms()
        self._joint_bytes = Numbers(JointState(name=list(frames.JOINTS), position=none, velocity=none, effort=none))
        self.request_door: Callable[[str, str, bool], None] = _ignored
        if self.setup.world.doors:
            self._doors = self.advertise(topics.BUILDING_STATE)
            self.subscribe(topics.BUILDING_REQUEST, self._on_request)
        self._touched = self.advertise(topics.SIM_TOUCHED)
        self._touched_text: str | None = None
        self._clock_topic = None if self.real_time else self.advertise(topics.CLOCK)
        serve_faults(self, services.INJECT_FAULT, lambda *fault: self.inject(*fault))

    @property
    def real_time(self) -> bool:
        """True if the world runs on the system clock."""
        return not self.simulated_time

    def publish_clock(self, stamp: Time) -> None:
        if self._clock_topic is not None:
            self._clock_topic.publish(Clock(clock=stamp))

    def publish_truth(self, truth: Truth, stamp: Time) -> None:
        odometry = self._odometry_bytes
        odometry.put(85, (*truth.position_m, *truth.quaternion_xyzw))  # before the twist and two covariances
        odometry.put(42, (*truth.linear_mps, *truth.angular_radps))
        self._truth.publish(odometry.stamped(stamp))
        joints = self._joint_bytes
        joints.put(26, truth.joint_positions_rad.tolist())  # each array of eight numbers follows its length
        joints.put(17, truth.joint_speeds_radps.tolist())
        joints.put(8, truth.joint_torques_nm.tolist())
        self._joints.publish(joints.stamped(stamp))

    def publish_bodies(self, bodies: list[tuple[str, NDArray[np.float64]]], stamp: Time) -> None:
        """bodies: frame ids and poses in map, (7,) x y z m, w x y z."""
        self._bodies.publish(self._body_bytes.filled(bodies, stamp))

    def publish_doors(self, reports: Iterable[DoorReport], stamp: Time) -> None:
        for report in reports:
            message = BuildingState(name=report.name, mode=int(report.mode), sessions=list(report.sessions))
            message.header.stamp = stamp
            self._doors.publish(message)

    def _on_request(self, message: BuildingRequest) -> None:
        self.request_door(message.name, message.requester, message.mode == BuildingRequest.OPEN)

    def publish_touched(self, names: Iterable[str]) -> None:
        """Publishes only if the names have changed."""
        text = ",".join(names)
        if text != self._touched_text:
            self._touched_text = text
            self._touched.publish(String(data=text))

    def show_waiting(self, text: str) -> None:
        """Reports the nodes the world waits for; an empty text means it runs."""
        self.report.values["waits_for"] = text
        if text:
            self.report.values["waited_for_last"] = text
            self.get_logger().warning(f"the world waits for {text}", throttle_duration_sec=5.0)

    def show_pace(self, report: PaceReport, total_overruns: int, total_dropped_s: float, waited_s: float) -> None:
        """Reports the loop's statistics in /diagnostics."""
        self.report.values |= {
            "sim_speed": f"{report.speed:.4f}",
            "overruns": str(total_overruns),
            "dropped_s": f"{total_dropped_s:.3f}",
            "worst_lag_ms": f"{1e3 * report.worst_lag_s:.1f}",
            "waited_for_stack_s": f"{waited_s:.3f}",
        }
        text = f"world {self.params.world}, seed {self.params.seed}"
        if self.real_time and report.drops > 0:
            text = f"the machine is too slow: {total_dropped_s:.1f} s of simulation given up so far"
        elif slow := slow_text(report.speed, self.params.speed):
            text = f"{text}, {slow}"
        self.set_health(True, text)


def _ignored(*_: object) -> None:
    """Replaces the building before the world runs."""


def _not_running(*_: object) -> str:
    raise NotServed("the world does not run yet")
