"""The corridor: what every node shares of ROS. Besides the nodes themselves, only this package imports rclpy."""
