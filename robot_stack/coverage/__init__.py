"""What the robot's range sensors see around it, by ray casting against the robot's own model."""
