"""Nodes of docking."""
