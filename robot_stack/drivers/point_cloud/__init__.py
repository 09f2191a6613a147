"""Point clouds of other vendors' ROS drivers as sweeps of the contract."""
