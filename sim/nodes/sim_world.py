"""Node sim_world: ground truth, /clock and fault injection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from pydantic import Field
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from robot_stack.contract import frames, services, topics
from robot_stack.core.config import Config
from robot_stack.core.geometry import Pose2
from robot_stack.ros.node import StackNode
from sim.faults import FaultRefused
from sim.pacing import PaceReport
from sim.requests import NotServed
from sim.world import Setup, Truth
from sim.worldfile import load_world

REAL_TIME = 1.0
_ANSWER_S = 2.0


class SimWorldParams(Config):
    """``config/sim_world.yaml``."""

    world: str
    seed: Annotated[int, Field(ge=0)]
    speed: Annotated[float, Field(gt=0.0, le=1000.0)]
    start_x_m: float | None
    start_y_m: float | None
    start_yaw_rad: float | None
    wheelchair: bool
    attached_at_start: bool
    passenger_mass_kg: Annotated[float, Field(ge=0.0)]
    catch_up_s: Annotated[float, Field(gt=0.0)]
    thread_switch_interval_s: Annotated[float, Field(gt=0.0)]
    clock_start_s: Annotated[float, Field(gt=0.0)]

    def setup(self) -> Setup:
        """What these parameters make. Raises ConfigError for an unknown or wrong world."""
        file = load_world(self.world)
        given = (self.start_x_m, self.start_y_m, self.start_yaw_rad)
        own = file.start.pose()
        x, y, yaw = (
            default if value is None else value for value, default in zip(given, (own.x, own.y, own.yaw), strict=True)
        )
        return Setup(file, self.seed, Pose2(x, y, yaw), self.wheelchair, self.attached_at_start, self.passenger_mass_kg)


class SimWorld(StackNode):
    """Publishes what the loop gives it; ``inject`` is set by the loop and carries faults into it."""

    def __init__(self) -> None:
        super().__init__("sim_world", SimWorldParams)
        self.setup = self.params.setup()
        self.inject: Callable[[str, str, float, float], str] = _not_running
        self._truth = self.advertise(topics.SIM_GROUND_TRUTH)
        self._joints = self.advertise(topics.SIM_JOINT_STATES)
        self._clock_topic = None if self.real_time else self.advertise(topics.CLOCK)
        self.serve(services.INJECT_FAULT, self._on_inject_fault)

    @property
    def real_time(self) -> bool:
        """The world lives on the system clock."""
        return bool(self.params.speed == REAL_TIME)

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

    def show_pace(self, report: PaceReport, total_overruns: int, total_dropped_s: float) -> None:
        """The loop's statistics, into /diagnostics."""
        self.report.values |= {
            "sim_speed": f"{report.speed:.4f}",
            "overruns": str(total_overruns),
            "dropped_s": f"{total_dropped_s:.3f}",
            "worst_lag_ms": f"{1e3 * report.worst_lag_s:.1f}",
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


def _not_running(*_: object) -> str:
    raise NotServed("the world does not run yet")
