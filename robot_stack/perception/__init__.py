"""From LiDAR sweeps to obstacles: crop, de-skew, ground removal, filtering."""
