"""Node sim_world: ground truth, /clock and fault injection."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from functools import partial
from typing import Annotated, Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from pydantic import Field, model_validator
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from robot_stack.contract import frames, services, topics
from robot_stack.contract.model import Topic
from robot_stack.core.config import Config
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.node import StackNode
from sim.faults import FaultRefused
from sim.lockstep import Lockstep
from sim.pacing import PaceReport
from sim.requests import NotServed
from sim.world import Setup, Truth
from sim.worldfile import load_world
from tf2_msgs.msg import TFMessage

REAL_TIME = 1.0
# What a stack that keeps up publishes all the time. The world waits before a silence counts as one.
_SIGNS_OF_LIFE = (
    topics.WHEEL_COMMANDS,
    topics.JOINT_STATES,
    topics.ODOM,
    topics.OBSTACLES,
    topics.CURRENT_POSE,
    topics.SAFETY_STATUS,
    topics.FRONT_CAMERA_INFO,
    topics.REAR_CAMERA_INFO,
    topics.ARUCO_DETECTIONS,
    topics.DOCKING_STATUS,
)
# Comes at its rate also without images: what tells who keeps up is the image's stamp in it.
_OF_IMAGES = topics.ARUCO_DETECTIONS
_SHARE_OF_STALE = 0.6


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
    catch_up_s: Annotated[float, Field(gt=0.0)]
    wait_for_stack_s: Annotated[float, Field(ge=0.0, le=10.0)]
    thread_switch_interval_s: Annotated[float, Field(gt=0.0)]
    clock_start_s: Annotated[float, Field(gt=0.0)]

    def setup(self) -> Setup:
        """What these parameters make. Raises ConfigError for an unknown or wrong world."""
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
        )

    @model_validator(mode="after")
    def _waits_in_its_own_time(self) -> SimWorldParams:
        if self.wait_for_stack_s and self.speed == REAL_TIME:
            raise ValueError("wait_for_stack_s needs a speed other than 1.0: the system clock waits for nobody")
        return self

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
    """Publishes what the loop gives it; ``inject`` is set by the loop and carries faults into it."""

    def __init__(self) -> None:
        super().__init__("sim_world", SimWorldParams)
        self.setup = self.params.setup()
        self.inject: Callable[[str, str, float, float], str] = _not_running
        self._truth = self.advertise(topics.SIM_GROUND_TRUTH)
        self._joints = self.advertise(topics.SIM_JOINT_STATES)
        self._bodies = self.advertise(topics.SIM_BODIES)
        self._touched = self.advertise(topics.SIM_TOUCHED)
        self._touched_text: str | None = None
        self._clock_topic = None if self.real_time else self.advertise(topics.CLOCK)
        self.serve(services.INJECT_FAULT, self._on_inject_fault)

    @property
    def real_time(self) -> bool:
        """The world lives on the system clock."""
        return bool(self.params.speed == REAL_TIME)

    def lockstep(self, time_s: Callable[[], float]) -> Lockstep:
        """Hears the rest of the stack; what is said does not matter to the world, but how old it is. time_s: now."""
        steps = Lockstep({row.name: _SHARE_OF_STALE * row.stale_s for row in _SIGNS_OF_LIFE if row.stale_s is not None})
        for row in _SIGNS_OF_LIFE:
            note = partial(_note, steps, row, time_s)
            self.create_subscription(interface_class(row.type), row.name, note, qos_profile(row.qos), raw=True)
        return steps

    def publish_clock(self, stamp: Time) -> None:
        if self._clock_topic is not None:
            self._clock_topic.publish(Clock(clock=stamp))

    def publish_truth(self, truth: Truth, stamp: Time) -> None:
        odometry = Odometry(child_frame_id=frames.BASE_LINK)
        odometry.header.frame_id, odometry.header.stamp = frames.MAP, stamp
        pose, twist = odometry.pose.pose, odometry.twist.twist
        pose.position.x, pose.position.y, pose.position.z = truth.position_m
        q = pose.orientation
        q.x, q.y, q.z, q.w = truth.quaternion_xyzw
        twist.linear.x, twist.linear.y, twist.linear.z = truth.linear_mps
        twist.angular.x, twist.angular.y, twist.angular.z = truth.angular_radps
        self._truth.publish(odometry)
        joints = JointState(name=list(frames.JOINTS))
        joints.header.stamp = stamp
        joints.position = truth.joint_positions_rad.tolist()
        joints.velocity = truth.joint_speeds_radps.tolist()
        joints.effort = truth.joint_torques_nm.tolist()
        self._joints.publish(joints)

    def publish_bodies(self, bodies: list[tuple[str, NDArray[np.float64]]], stamp: Time) -> None:
        """Frame ids and poses in map: (7,) x y z m, w x y z."""
        message = TFMessage()
        for name, pose in bodies:
            body = TransformStamped(child_frame_id=name)
            body.header.frame_id, body.header.stamp = frames.MAP, stamp
            x, y, z, qw, qx, qy, qz = pose.tolist()
            move, turn = body.transform.translation, body.transform.rotation
            move.x, move.y, move.z = x, y, z
            turn.x, turn.y, turn.z, turn.w = qx, qy, qz, qw
            message.transforms.append(body)
        self._bodies.publish(message)

    def publish_touched(self, names: Iterable[str]) -> None:
        """Says it again only when there is something new."""
        text = ",".join(names)
        if text != self._touched_text:
            self._touched_text = text
            self._touched.publish(String(data=text))

    def show_pace(self, report: PaceReport, total_overruns: int, total_dropped_s: float, waited_s: float) -> None:
        """The loop's statistics, into /diagnostics."""
        self.report.values |= {
            "sim_speed": f"{report.speed:.4f}",
            "overruns": str(total_overruns),
            "dropped_s": f"{total_dropped_s:.3f}",
            "worst_lag_ms": f"{1e3 * report.worst_lag_s:.1f}",
            "waited_for_stack_s": f"{waited_s:.3f}",
        }
        slow = self.real_time and report.drops > 0
        late = f"the machine is too slow: {total_dropped_s:.1f} s of simulation given up so far"
        self.set_health(True, late if slow else f"world {self.params.world}, seed {self.params.seed}")

    def _on_inject_fault(self, request: Any, response: Any) -> Any:
        try:
            response.message = self.inject(request.kind, request.target, request.value, request.duration_s)
            response.success = True
            self.get_logger().warning(f"fault: {response.message}")
        except (FaultRefused, NotServed) as error:
            response.message = str(error)
        return response


def _note(steps: Lockstep, row: Topic, time_s: Callable[[], float], message: bytes) -> None:
    if row is not _OF_IMAGES:
        steps.heard(row.name, time_s())
        return
    # In CDR the header's stamp follows the four bytes that tell the encoding.
    seconds, nanoseconds = struct.unpack_from("<iI", message, 4)
    if seconds or nanoseconds:
        steps.heard(row.name, seconds + 1e-9 * nanoseconds)


def _not_running(*_: object) -> str:
    raise NotServed("the world does not run yet")
