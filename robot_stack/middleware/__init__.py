"""Code shared by all nodes: the node base and the port to the middleware.

A node runs unchanged on ROS (``robot_stack.ros``) and on the deterministic scheduler of the simulation.
Nothing here imports rclpy; the implementation of the port does.
"""
