"""A six-axis arm with a two-finger gripper: bodies, joint drives, faults."""
