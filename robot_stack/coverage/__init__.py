"""Coverage of the robot's range sensors, by ray casting against the robot's own model."""
