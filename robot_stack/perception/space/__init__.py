"""The space around the robot: observed, unseen and stored cells in one grid, shared by all users."""
