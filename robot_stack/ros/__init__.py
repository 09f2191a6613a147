"""The ROS layer shared by all nodes. Besides the nodes themselves, only this package imports rclpy."""
