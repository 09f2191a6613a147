"""Velodyne LiDARs by their UDP packets; velodyne-decoder knows their geometry and timing."""
