"""A publisher of this stack, or its subscriber on another computer (argument "receive"), which runs until it is ended.

The publisher prints "sent" once it has published 60 MB to its subscriber.
"""

import sys
import time

from robot_stack.ros import transport

transport.apply()

import rclpy  # noqa: E402
from std_msgs.msg import String  # noqa: E402

rclpy.init()
node = rclpy.create_node(f"slow_link_{sys.argv[1]}")
if sys.argv[1] == "receive":
    node.create_subscription(String, "/slow_link", lambda _: None, 10)
    rclpy.spin(node)
publisher = node.create_publisher(String, "/slow_link", 10)
while not publisher.get_subscription_count():
    time.sleep(0.1)
for _ in range(1000):
    publisher.publish(String(data="x" * 60000))
print("sent")
