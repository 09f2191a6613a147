"""Matching of LiDAR sweeps against a map of normal distributions (P2D-NDT)."""
