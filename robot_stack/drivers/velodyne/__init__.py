"""Velodyne LiDARs by their UDP packets; velodyne-decoder implements their geometry and timing."""
