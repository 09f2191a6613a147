"""What every node shares: the node base and the port through which it reaches a middleware.

A node runs on ROS (``robot_stack.ros``) or on the deterministic scheduler of the simulation without knowing which.
Nothing here imports rclpy; the implementation of the port does.
"""
