"""Benchmarks that need the physics."""
