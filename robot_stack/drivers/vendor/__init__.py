"""Cameras, inertial units and batteries of other vendors' ROS drivers as messages of the contract."""
