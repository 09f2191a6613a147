"""Prints the sequence number in the frame id of each received point cloud, until as many have been received."""

import sys
import time

import rclpy
from sensor_msgs.msg import PointCloud2

from robot_stack.contract import topics
from robot_stack.ros import transport
from robot_stack.ros.interfaces import qos_profile

wanted = int(sys.argv[1])
seen: list[int] = []


def take(cloud: PointCloud2) -> None:
    seen.append(int(cloud.header.frame_id))
    print(f"cloud {seen[-1]}", flush=True)


transport.apply(bulk=True)
rclpy.init()
node = rclpy.create_node(f"cloud_counter_{time.monotonic_ns()}")
subscription = node.create_subscription(
    PointCloud2,
    topics.LIDAR_POINTS.name,
    take,
    qos_profile(topics.LIDAR_POINTS.qos),
)
while subscription.get_publisher_count() == 0:
    rclpy.spin_once(node, timeout_sec=0.1)
print("connected", flush=True)
while len(seen) < wanted:
    rclpy.spin_once(node, timeout_sec=0.1)
node.destroy_node()
rclpy.shutdown()
