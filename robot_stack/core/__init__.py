"""Code shared by the subsystems, without ROS: geometry, configuration, input health, the runtime folder."""
