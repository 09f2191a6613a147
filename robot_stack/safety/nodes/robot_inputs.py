"""Inputs of the safety monitor from the robot itself: wheels, attitude, pose, battery, and sources of stops."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import BatteryState, CameraInfo, Imu, JointState
from std_msgs.msg import Bool, Float32

from custom_msgs.msg import DockingStatus, EmergencyStopSource, LatchStatus, SwerveModuleCommandArray
from robot_stack.contract import topics
from robot_stack.middleware.node import StackNode
from robot_stack.safety.chair_watch import LatchStatement
from robot_stack.safety.inputs import ImuSample
from robot_stack.safety.observation import CAMERAS, Observation
from robot_stack.safety.stop_sources import SourceReport


class RobotInputs:
    """Subscriptions of the node ``safety_monitor``.

    observation: returns the present one, which a start under /clock replaces. passenger: called at once with whether a
    wheelchair is attached.
    """

    def __init__(
        self, node: StackNode, observation: Callable[[], Observation], passenger: Callable[[bool], None]
    ) -> None:
        self._node, self._observation, self._passenger = node, observation, passenger
        node.subscribe(topics.EMERGENCY_STOP_SOURCES, self._on_stop_source)
        self._joints = node.subscribe(topics.JOINT_STATES, self._on_joint_states)
        node.subscribe(topics.WHEEL_COMMANDS, self._on_wheel_commands)
        self._imu = node.subscribe(topics.IMU, self._on_imu)
        self._pose = node.subscribe(topics.CURRENT_POSE, self._on_pose)
        self._quality = node.subscribe(topics.LOCALIZATION_QUALITY, self._on_quality)
        self._battery = node.subscribe(topics.BATTERY_STATE, self._on_battery)
        node.subscribe(topics.PASSENGER_ATTACHED, self._on_passenger)
        node.subscribe(topics.LATCH_STATUS, self._on_latch)
        node.subscribe(topics.DOCKING_STATUS, self._on_docking)
        for camera in CAMERAS:
            node.subscribe(camera, partial(self._on_camera, camera.name))

    def _on_stop_source(self, message: EmergencyStopSource) -> None:
        begun_ns = 1_000_000_000 * message.begun.sec + message.begun.nanosec
        report = SourceReport(message.name, message.pid, message.presses, message.pressed, begun_ns)
        self._observation().stop_source(report, self._node.steady_s())

    def _on_joint_states(self, message: JointState) -> None:
        received_s = self._joints.received_s
        self._observation().joint_states(message.name, message.position, message.velocity, received_s)

    def _on_wheel_commands(self, message: SwerveModuleCommandArray) -> None:
        modules = sorted(message.modules, key=lambda module: module.module_id)
        self._observation().steering.commanded([module.steering_angle for module in modules], self._node.steady_s())

    def _on_imu(self, message: Imu) -> None:
        force, rate = message.linear_acceleration, message.angular_velocity
        sample = ImuSample(force.x, force.y, force.z, rate.x, rate.y, rate.z)
        self._observation().imu(sample, self._imu.received_s)

    def _on_pose(self, message: PoseStamped) -> None:
        self._observation().pose(message.pose.position.x, message.pose.position.y, self._pose.received_s)

    def _on_quality(self, message: Float32) -> None:
        self._observation().quality(message.data, self._quality.received_s)

    def _on_battery(self, message: BatteryState) -> None:
        self._observation().battery(message.percentage, self._battery.received_s)

    def _on_passenger(self, message: Bool) -> None:
        self._passenger(message.data)

    def _on_latch(self, message: LatchStatus) -> None:
        statement = LatchStatement(message.attached, message.undocking)
        self._observation().chair.stated(statement, self._node.steady_s())

    def _on_docking(self, message: DockingStatus) -> None:
        self._observation().docking(message.state, self._node.steady_s())

    def _on_camera(self, topic: str, _: CameraInfo) -> None:
        self._observation().camera(topic, self._node.steady_s())
