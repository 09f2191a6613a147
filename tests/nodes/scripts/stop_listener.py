"""Prints the messages on /emergency_stop; subscribes to joint states too, so that its socket can overflow."""

import time

from robot_stack.contract import topics
from robot_stack.ros import transport

transport.apply()

import rclpy  # noqa: E402

from robot_stack.ros.interfaces import interface_class, qos_profile  # noqa: E402

rclpy.init()
node = rclpy.create_node(f"stop_listener_{time.monotonic_ns()}")
for row, take in (
    (topics.EMERGENCY_STOP, lambda message: print("stop" if message.data else "no stop", flush=True)),
    (topics.JOINT_STATES, lambda message: None),
):
    node.create_subscription(interface_class(row.type), row.name, take, qos_profile(row.qos))
rclpy.spin(node)
