"""The machine and its surroundings: physics, drives, motion sensors, battery, latch, people, and their faults."""
