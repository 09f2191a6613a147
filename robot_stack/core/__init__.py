"""What subsystems share without ROS: geometry, configuration, input health, the runtime folder."""
