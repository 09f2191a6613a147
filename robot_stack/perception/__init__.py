"""Perception: computes obstacles from LiDAR sweeps by crop, de-skew, ground removal and filtering."""
