"""Shared test helpers: conditions with deadlines, separate ROS domains, real node processes."""
