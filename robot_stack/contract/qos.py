"""The QoS profiles of the contract, by purpose."""

from robot_stack.contract.model import Durability, Qos, Reliability

COMMAND = Qos(Reliability.RELIABLE, Durability.VOLATILE, 1)
LATCHED = Qos(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, 1)
SENSOR = Qos(Reliability.BEST_EFFORT, Durability.VOLATILE, 1)
STATUS = SENSOR
REQUEST_QUEUE = Qos(Reliability.RELIABLE, Durability.VOLATILE, 10)
DIAGNOSTICS = REQUEST_QUEUE
# Several nodes publish on one topic within the same few milliseconds; depth 1 would lose all but the last.
HEARTBEAT = Qos(Reliability.BEST_EFFORT, Durability.VOLATILE, 50)
# tf2's own profiles: tf2_ros/qos.hpp, DynamicBroadcasterQoS and StaticBroadcasterQoS.
TF = Qos(Reliability.RELIABLE, Durability.VOLATILE, 100)
TF_STATIC = Qos(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, 1)
# rclpy's default for /clock (rclcpp::ClockQoS).
CLOCK = Qos(Reliability.BEST_EFFORT, Durability.VOLATILE, 1)
