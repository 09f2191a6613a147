"""Markers in camera images: search, edge fit, joint pose of a board. Kernels only."""
