"""Nodes of the motion-engine layer."""
