"""Tests of the simulated LiDAR."""
