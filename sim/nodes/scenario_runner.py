"""The scenario runner's two nodes: one speaks as the operator and the test tool, both note what the stack does."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from custom_msgs.msg import MissionStatus, SafetyStatus, SwerveModuleCommandArray, UICommand
from custom_msgs.srv import InjectFault
from robot_stack.contract import frames, services, topics
from robot_stack.contract.model import ContractViolation, Service, Topic
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped, time_to_s, twist_stamped
from robot_stack.middleware.emergency_stop import StopSource
from robot_stack.ros import transport
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.interfaces import interface_class, qos_profile
from sim.run.run_log import Four, Moment, RunLog

_SPIN_S = 0.02


class ScenarioNode:
    """A context manager. Notes are taken inside ``spin``; their times are simulated s since ``begin``."""

    def __init__(self, wheel_radius_m: float) -> None:
        transport.apply()
        self.run_log = RunLog()
        self.mission: MissionStatus | None = None
        self.safety: SafetyStatus | None = None
        self.moment: Moment | None = None
        self._radius_m = wheel_radius_m
        self._begun_s: float | None = None
        self._truth: Odometry | None = None
        self._context = Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        clock = [rclpy.Parameter("use_sim_time", value=True)]
        options: dict[str, Any] = {"context": self._context, "use_global_arguments": False}
        self._nodes = {
            name: Node(name, parameter_overrides=clock, **options) for name in (topics.OPERATOR_TOOL, topics.TEST_TOOL)
        }
        self._executor = LeanExecutor(context=self._context)
        for node in self._nodes.values():
            self._executor.add_node(node)
        self._publishers = {row.name: self._advertise(row) for row in _SPOKEN}
        stop, reports = (self._publishers[row.name] for row in (topics.EMERGENCY_STOP, topics.EMERGENCY_STOP_SOURCES))
        operator = self._node(topics.OPERATOR_TOOL).get_clock()
        self._stop = StopSource(topics.OPERATOR_TOOL, os.getpid(), stop, reports, lambda: operator.now().to_msg())
        for row, callback in self._heard():
            self._node(topics.TEST_TOOL).create_subscription(
                interface_class(row.type), row.name, callback, qos_profile(row.qos)
            )

    def __enter__(self) -> ScenarioNode:
        return self

    def __exit__(self, *_: object) -> None:
        for node in self._nodes.values():
            node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self._context)

    def spin(self) -> None:
        """Takes what has arrived, waiting a moment for it."""
        self._executor.spin_once(_SPIN_S)

    def begin(self) -> None:
        """From the newest ground truth on, time counts."""
        assert self._truth is not None
        self._begun_s = time_to_s(self._truth.header.stamp)

    @property
    def alive(self) -> bool:
        """World, safety and mission have been heard."""
        return None not in (self._truth, self.safety, self.mission)

    def describe(self) -> str:
        """What has been heard last, in words."""
        safety, mission = self.safety, self.mission
        state = "unheard" if safety is None else f"{safety.safety_state} {' '.join(safety.active_faults)}".strip()
        return f"safety {state}, mission {'unheard' if mission is None else mission.state}"

    @property
    def now_s(self) -> float:
        """Simulated time by the newest ground truth; 0 before ``begin``."""
        return self.moment.time_s if self.moment is not None and self._begun_s is not None else 0.0

    # --- speaking -------------------------------------------------------------------------------------------------

    def goal(self, pose: Pose2) -> None:
        stamp = self._node(topics.OPERATOR_TOOL).get_clock().now().to_msg()
        self._publishers[topics.GOAL_POSE.name].publish(pose_stamped(pose, frames.MAP, stamp))

    def teleop(self, twist: Twist2) -> None:
        stamp = self._node(topics.OPERATOR_TOOL).get_clock().now().to_msg()
        self._publishers[topics.TELEOP_CMD_VEL.name].publish(twist_stamped(twist, frames.BASE_LINK, stamp))

    def start_mission(self, mission_id: str) -> None:
        command = UICommand(command_type=UICommand.START_MISSION, mission_id=mission_id)
        command.header.stamp = self._node(topics.OPERATOR_TOOL).get_clock().now().to_msg()
        self._publishers[topics.UI_COMMAND.name].publish(command)

    def emergency_stop(self, active: bool) -> None:
        self._stop.publish(active)

    def passenger(self, attached: bool) -> None:
        self._publishers[topics.PASSENGER_ATTACHED.name].publish(Bool(data=attached))

    def inject(self, kind: str, target: str, value: float, duration_s: float) -> str:
        """Raises ValueError if the fault is refused, TimeoutError if nobody answers."""
        request = InjectFault.Request(kind=kind, target=target, value=value, duration_s=duration_s)
        answer = self._call(services.INJECT_FAULT, request)
        if not answer.success:
            raise ValueError(answer.message)
        return str(answer.message)

    def reset(self) -> str:
        """Asks for the release from an emergency stop. Returns the answer."""
        service = interface_class(services.SAFETY_RESET.type)
        answer = self._call(services.SAFETY_RESET, service.Request())
        return f"reset {'granted' if answer.success else 'refused'}: {answer.message}"

    def _call(self, row: Service, request: Any, tries: int = 250) -> Any:
        client = self._node(topics.TEST_TOOL).create_client(interface_class(row.type), row.name)
        try:
            self._spin_until(client.service_is_ready, tries, f"nobody serves {row.name}")
            future = client.call_async(request)
            self._spin_until(future.done, tries, f"no answer of {row.name}")
            return future.result()
        finally:
            self._node(topics.TEST_TOOL).destroy_client(client)

    def _spin_until(self, condition: Callable[[], bool], tries: int, problem: str) -> None:
        for _ in range(tries):
            if condition():
                return
            self.spin()
        raise TimeoutError(problem)

    def _node(self, name: str) -> Node:
        return self._nodes[name]

    def _advertise(self, row: Topic) -> Any:
        for name, node in self._nodes.items():
            if name in row.publishers:
                return node.create_publisher(interface_class(row.type), row.name, qos_profile(row.qos))
        raise ContractViolation(f"no tool may publish {row.name}")

    # --- noting ---------------------------------------------------------------------------------------------------

    def _heard(self) -> tuple[tuple[Topic, Callable[[Any], None]], ...]:
        return (
            (topics.SIM_GROUND_TRUTH, self._on_truth),
            (topics.SIM_JOINT_STATES, self._on_joints),
            (topics.WHEEL_COMMANDS, self._on_wheel_commands),
            (topics.CMD_VEL_LIMITED, self._on_requested),
            (topics.CURRENT_POSE, self._on_estimate),
            (topics.PLAN, self._on_plan),
            (topics.SAFETY_STATUS, self._on_safety),
            (topics.MISSION_STATUS, self._on_mission),
        )

    def _on_truth(self, message: Odometry) -> None:
        self._truth = message

    def _on_joints(self, message: JointState) -> None:
        """Comes right after the ground truth of the same stamp."""
        truth = self._truth
        if truth is None or truth.header.stamp != message.header.stamp or self._begun_s is None:
            return
        linear, speeds = truth.twist.twist.linear, message.velocity
        self.moment = Moment(
            time_to_s(message.header.stamp) - self._begun_s,
            pose_from_msg(truth.pose.pose),
            Twist2(linear.x, linear.y, truth.twist.twist.angular.z),
            _four([self._radius_m * speeds[axis] for axis in frames.DRIVE_AXES]),
            _four([message.position[axis] for axis in frames.STEER_AXES]),
        )
        self.run_log.moments.append(self.moment)

    def _on_wheel_commands(self, message: SwerveModuleCommandArray) -> None:
        if self._begun_s is not None:
            speeds = _four([module.drive_velocity for module in message.modules])
            angles = _four([module.steering_angle for module in message.modules])
            self.run_log.commands.append((self.now_s, speeds, angles))

    def _on_requested(self, message: TwistStamped) -> None:
        if self._begun_s is not None:
            twist = message.twist
            self.run_log.requested.append((self.now_s, Twist2(twist.linear.x, twist.linear.y, twist.angular.z)))

    def _on_estimate(self, message: PoseStamped) -> None:
        if self._begun_s is not None:
            time_s = time_to_s(message.header.stamp) - self._begun_s
            self.run_log.estimates.append((time_s, pose_from_msg(message.pose)))

    def _on_plan(self, message: Path) -> None:
        points = [(item.pose.position.x, item.pose.position.y) for item in message.poses]
        if self._begun_s is not None:
            self.run_log.plans.append((self.now_s, np.array(points, dtype=np.float64).reshape(-1, 2)))

    def _on_safety(self, message: SafetyStatus) -> None:
        self.safety = message
        if self._begun_s is not None:
            faults = f" ({', '.join(message.active_faults)})" if message.active_faults else ""
            self.run_log.log_state(self.now_s, f"{message.safety_state}{faults}")

    def _on_mission(self, message: MissionStatus) -> None:
        self.mission = message


_SPOKEN = (
    topics.GOAL_POSE,
    topics.TELEOP_CMD_VEL,
    topics.UI_COMMAND,
    topics.EMERGENCY_STOP,
    topics.EMERGENCY_STOP_SOURCES,
    topics.PASSENGER_ATTACHED,
)


def _four(values: list[float]) -> Four:
    a, b, c, d = (float(value) if math.isfinite(value) else 0.0 for value in values)
    return a, b, c, d
