"""Counts point clouds by the sequence number in their frame id and says how many of the first N came."""

import sys
import time

import rclpy
from sensor_msgs.msg import PointCloud2

from robot_stack.contract import topics
from robot_stack.ros import transport
from robot_stack.ros.interfaces import qos_profile

wanted = int(sys.argv[1])
seen: set[int] = set()
transport.apply(bulk=True)
rclpy.init()
node = rclpy.create_node(f"cloud_counter_{time.monotonic_ns()}")
subscription = node.create_subscription(
    PointCloud2,
    topics.LIDAR_POINTS.name,
    lambda message: seen.add(int(message.header.frame_id)),
    qos_profile(topics.LIDAR_POINTS.qos),
)
while subscription.get_publisher_count() == 0:
    rclpy.spin_once(node, timeout_sec=0.1)
print("connected", flush=True)
last_s = time.monotonic()
while (not seen or max(seen) < wanted) and time.monotonic() < last_s + 60.0:
    rclpy.spin_once(node, timeout_sec=0.1)
print(f"received {len([n for n in seen if n <= wanted])} of the first {wanted}", flush=True)
node.destroy_node()
rclpy.shutdown()
