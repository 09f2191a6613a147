"""The machine and what is around it: physics, drives, sensors of motion, battery, latch, people, and their faults."""
