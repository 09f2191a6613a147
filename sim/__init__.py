"""Physics simulation of the robot: world, servo drives, sensors, faults, scenarios."""
