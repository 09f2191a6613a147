"""Joint states as a straightforward node publishes them: a timer of rclpy, a message built and filled at each tick."""

from __future__ import annotations

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from robot_stack.contract import topics
from robot_stack.core.config import load
from robot_stack.ros import transport
from robot_stack.ros.interfaces import qos_profile
from robot_stack.wmx import connect
from robot_stack.wmx.manipulator.params import ManipulatorStateParams


class PlainJointStates(Node):
    """The same engine, topics, QoS and rate as manipulator_state."""

    def __init__(self) -> None:
        super().__init__("plain_joint_states")
        self._params = load(ManipulatorStateParams, "manipulator_state")
        self._engine = connect("plain_joint_states")
        code = self._engine.api.StartCommunication(10000)
        assert code == 0, self._engine.api.ErrorToString(code)
        rows = topics.WMX_JOINT_STATES, topics.GAZEBO_COMMANDS
        self._joints = self.create_publisher(JointState, rows[0].name, qos_profile(rows[0].qos))
        self._gazebo = self.create_publisher(Float64MultiArray, rows[1].name, qos_profile(rows[1].qos))
        self.create_timer(1.0 / self._params.joint_feedback_rate, self._tick)

    def _tick(self) -> None:
        code, snapshot = self._engine.read_status()
        if code or not snapshot.communicating:
            return
        n = self._params.joint_number
        closed = snapshot.output_bit(0, 0)
        finger = self._params.gripper_close_value if closed else self._params.gripper_open_value
        message = JointState(name=list(self._params.joint_name))
        message.position = [*snapshot.actual_pos[:n].tolist(), finger, finger]
        message.velocity = [*snapshot.actual_velocity[:n].tolist(), 0.0, 0.0]
        message.header.stamp = self.get_clock().now().to_msg()
        self._joints.publish(message)
        self._gazebo.publish(Float64MultiArray(data=message.position))


def main() -> None:
    transport.apply()
    rclpy.init()
    try:
        rclpy.spin(PlainJointStates())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
