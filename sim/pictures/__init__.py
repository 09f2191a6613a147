"""Pictures of the robot in its world, of rides and of scenarios."""
