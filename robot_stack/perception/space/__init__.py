"""What is seen, unseen and remembered around the robot: one grid for everybody who must not drive into anything."""
