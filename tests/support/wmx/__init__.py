"""Stand-ins for the motion engine's surroundings."""
