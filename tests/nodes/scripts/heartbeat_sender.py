"""Sends the heartbeats of one process of the contract until it is killed. Usage: heartbeat_sender.py NAME."""

from __future__ import annotations

import sys

import rclpy
from rclpy.node import Node

from custom_msgs.msg import Heartbeat
from robot_stack.contract import topics
from robot_stack.ros import transport
from robot_stack.ros.interfaces import qos_profile


def main() -> None:
    transport.apply()
    rclpy.init()
    node = Node(f"heart_of_{sys.argv[1]}")
    publisher = node.create_publisher(Heartbeat, topics.HEARTBEAT.name, qos_profile(topics.HEARTBEAT.qos))
    node.create_timer(0.1, lambda: publisher.publish(Heartbeat(node=sys.argv[1], ready=True)))
    rclpy.spin(node)


if __name__ == "__main__":
    main()
